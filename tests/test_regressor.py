"""The joint regressor: questions, leaves, votes, splits, and a small forest trained on a few poses."""

from __future__ import annotations

import tracemalloc
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as drawn_with
from hypothesis import strategies as st

from database_builder import regressor as parts
from database_builder.growing import grow_trees
from database_builder.images import TrainingImages, draw_images
from database_builder.regressor import RegressorSettings, leaf_votes, train_regressor
from database_builder.views import FOCAL, ViewSettings, body_labels, draw_view, image_window, is_seated
from tests.landmark_helpers import CAMERA, LEVEL, body_cloud
from toolkit.body import skeleton
from toolkit.body.shape import ShapeSpace, load_body
from toolkit.database import canonical
from toolkit.io.errors import DatabaseError, OutputError, SettingsError
from toolkit.kernels.learning import forest, forest_training
from toolkit.landmarks.regressor import JointRegressor, sureness
from toolkit.mocap.procedural import SEATED_MOTIONS, procedural_clips
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.cloud import Cloud

PLAIN = ViewSettings(turned=0.5, cut=0.0, hidden=0.0, raised=0.0, small=0.0, seated=0.0, rooms=0.0)
"""People as the first regressors knew them: adults, standing, in full view."""
SMALL = RegressorSettings(
    images=60,
    pixels=60,
    trees=2,
    depth=6,
    smallest_leaf=20,
    questions=20,
    bins=8,
    node_samples=500,
    views=PLAIN,
    calibration=0,
)
WEIGHTS = (np.arange(256) / 255.0) ** 4
LOG_ODDS = np.log(np.clip(np.arange(256) / 255.0, 0.01, 0.99) / (1.0 - np.clip(np.arange(256) / 255.0, 0.01, 0.99)))


def some_depth(rng: np.random.Generator) -> np.ndarray:
    depth = rng.uniform(1.5, 3.5, (30, 40)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = 0.0
    return depth


def plain_probe(
    depth: np.ndarray, camera: Camera, rotation: np.ndarray, pixel: np.ndarray, x: float, y: float
) -> float:
    """`pixel` (3,) is its point in the level frame; the probe is `x` across and `y` down of it."""
    point = rotation.T @ (pixel + [x, -y, 0.0])
    if point[2] < 0.05:
        return -1.0
    u, v = np.rint(camera.project(point)).astype(int)
    if not (0 <= v < depth.shape[0] and 0 <= u < depth.shape[1]) or depth[v, u] < 0:
        return -1.0
    if depth[v, u] == 0:
        return 1.0
    ray = np.array([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0])
    further = pixel[2] - (rotation @ (ray * depth[v, u]))[2]
    return float(np.clip(further, -1.0, 1.0))


def plain_question(
    depth: np.ndarray, camera: Camera, rotation: np.ndarray, u: int, v: int, offsets: np.ndarray
) -> float:
    ray = np.array([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0])
    pixel = rotation @ (ray * depth[v, u])
    ax, ay, bx, by = (float(x) for x in offsets)
    first = plain_probe(depth, camera, rotation, pixel, ax, ay)
    return first - plain_probe(depth, camera, rotation, pixel, bx, by)


def kernel_question(
    depth: np.ndarray, camera: Camera, rotation: np.ndarray, u: int, v: int, offsets: np.ndarray
) -> float:
    view, asked = forest.View(depth, camera.intrinsics, rotation), forest.empty_block()
    forest.place_pixels(view, np.array([v * depth.shape[1] + u]), 0, asked)
    asked.offsets[:] = offsets[:, None]
    forest.answer(view, asked)
    first, second = asked.answers
    assert len(set(first)) == len(set(second)) == 1  # all places of a block are asked alike
    return float(first[0] - second[0])


TINY = Camera(25.0, 35.0, 20.0, 15.0, 40, 30)
TILTED = level_rotation(np.array([0.05, -0.9, -0.45]))


def random_forest(
    rng: np.random.Generator, trees: int = 3, levels: int = 3, leaves_apart: float = 0.5
) -> JointRegressor:
    """Complete trees of random questions, whose leaves are numbered as they are met."""
    offsets, thresholds, children, roots = [], [], [], []
    count = 0

    def grow(level: int) -> int:
        nonlocal count
        if level == levels:
            count += 1
            return -count
        here = len(offsets)
        offsets.append(rng.uniform(-0.5, 0.5, 4))
        thresholds.append(rng.uniform(-0.3, 0.3))
        children.append([0, 0])
        children[here] = [grow(level + 1), grow(level + 1)]
        return here

    for _ in range(trees):
        roots.append(grow(0))
    return JointRegressor(
        np.array(offsets, dtype=np.float32), np.array(thresholds, dtype=np.float32),
        np.array(children, dtype=np.int32), np.array(roots, dtype=np.int32),
        (100 * rng.normal(0.0, leaves_apart, (count, 20, 3))).clip(-127, 127).astype(np.int8),
        rng.integers(1, 256, (count, 20), dtype=np.uint8),
        rng.integers(1, 256, (count, 20), dtype=np.uint8),
        leaf_person=np.full(count, 255, dtype=np.uint8),
    )  # fmt: skip


# Questions and leaves


@pytest.mark.parametrize("rotation", [LEVEL, TILTED], ids=["level", "tilted"])
def test_a_question_is_the_clipped_difference_of_two_probes_in_the_level_frame(
    rotation: np.ndarray,
) -> None:
    rng = np.random.default_rng(0)
    depth = some_depth(rng)
    depth[:8] = -1.0
    measured = np.argwhere(depth > 0)
    answers = []
    for v, u in measured[rng.integers(len(measured), size=300)]:
        offsets = rng.uniform(-0.8, 0.8, 4)
        answer = kernel_question(depth, TINY, rotation, u, v, offsets)
        assert answer == pytest.approx(plain_question(depth, TINY, rotation, u, v, offsets), abs=1e-6)
        answers.append(answer)
    assert np.std(answers) > 0.3 and np.max(np.abs(answers)) <= 2.0


def test_a_question_has_the_same_answer_at_twice_the_distance_and_twice_the_resolution() -> None:
    near = np.zeros((41, 41), dtype=np.float32)
    near[10:31, 10:31] = 2.0
    offsets = np.array([0.24, 0.0, 0.0, -0.1])
    far = np.where(near > 0, 4.0, 0.0).astype(np.float32)
    camera = Camera(100.0, 100.0, 20.0, 20.0, 41, 41)
    once = kernel_question(near, camera, LEVEL, 20, 20, offsets)
    assert once == 1.0  # 0.24 m to the right there is nothing any more, 0.1 m above there is
    assert kernel_question(far, replace(camera, fx=200.0, fy=200.0), LEVEL, 20, 20, offsets) == once
    fine = Camera(200.0, 200.0, 40.0, 40.0, 82, 82)
    assert kernel_question(np.kron(near, np.ones((2, 2), np.float32)), fine, LEVEL, 40, 40, offsets) == once


def test_a_tilted_camera_answers_as_a_level_one_at_its_place() -> None:
    """A wall with a box before it, seen straight on and with the camera turned down by 20 degrees."""
    answers = []
    camera = Camera(200.0, 200.0, 119.5, 119.5, 240, 240)
    for rotation in (LEVEL, level_rotation(np.array([0.0, -np.cos(0.35), -np.sin(0.35)]))):
        rays = np.concatenate([camera.rays(), np.ones((240, 240, 1))], axis=2) @ rotation.T
        depth = 3.0 / -rays[..., 2]
        box = rays * (2.5 / -rays[..., 2])[..., None]
        inside = (np.abs(box[..., 0]) < 0.3) & (np.abs(box[..., 1] + 0.5) < 0.4)
        depth[inside] = 2.5 / -rays[inside][:, 2]
        u, v = np.rint(camera.project(rotation.T @ [0.1, -0.4, -2.5])).astype(int)
        answers.append(
            [
                kernel_question(depth.astype(np.float32), camera, rotation, u, v, np.array([x, y, 0.0, 0.0]))
                for x in (-0.6, -0.2, 0.1, 0.4) for y in (-0.25, 0.1, 0.2, 0.7)
            ]
        )  # fmt: skip
    assert answers[1] == pytest.approx(answers[0], abs=0.02)
    assert {round(a, 1) for a in answers[0]} == {0.0, 0.5}


def test_pixels_reach_the_leaves_that_a_plain_walk_reaches() -> None:
    rng = np.random.default_rng(1)
    depth, trained = some_depth(rng), random_forest(rng)
    pixels = np.flatnonzero(depth.ravel())[::3]
    leaves = np.empty((len(pixels), 3), dtype=np.int64)
    view = forest.View(depth, TINY.intrinsics, TILTED)
    forest.find_leaves(view, pixels, trained.nodes, trained.roots, leaves)
    for row, pixel in enumerate(pixels):
        for tree in range(3):
            node = trained.roots[tree]
            while node >= 0:
                answer = plain_question(depth, TINY, TILTED, pixel % 40, pixel // 40, trained.offsets[node])
                node = trained.children[node][int(answer >= trained.thresholds[node])]
            assert leaves[row, tree] == -1 - node
    assert len(np.unique(leaves)) >= 20


# Votes


def plain_vote(
    points: np.ndarray, leaves: np.ndarray, trained: JointRegressor, voters: int, bandwidth: float, rounds: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    assert trained.leaf_in_view is not None
    joints, confidence, evidence = np.empty((20, 3)), np.empty(20), np.empty(20)
    for j in range(20):
        weights = ((trained.leaf_sureness[leaves, j] / 255.0) ** 4).ravel()
        shares = (trained.leaf_in_view[leaves, j] / 255.0).ravel()
        votes = (points[:, None] + 0.01 * trained.leaf_offsets[leaves, j]).reshape(-1, 3)
        kept = weights >= np.sort(weights)[-min(voters, len(weights))]
        likely = np.clip(shares, 0.01, 0.99)
        evidence[j] = np.log(likely / (1 - likely)).mean()
        weights, votes, shares = weights[kept], votes[kept], shares[kept]
        weights = weights * shares
        mode = np.average(votes, axis=0, weights=weights)
        for step in range(rounds):
            width = bandwidth * (1 + 2 * (rounds - 1 - step) / (rounds - 1))
            kernel = weights * np.exp(-((votes - mode) ** 2).sum(axis=1) / (2 * width**2))
            mode = np.average(votes, axis=0, weights=kernel)
        held = weights * np.exp(-((votes - mode) ** 2).sum(axis=1) / (2 * bandwidth**2))
        joints[j], confidence[j] = mode, held.sum() / len(votes)
    return joints, confidence, evidence


@pytest.mark.parametrize("voters", [10, 80, 1000])
def test_votes_end_at_the_modes_of_a_plain_mean_shift(voters: int) -> None:
    rng = np.random.default_rng(voters)
    trained = random_forest(rng, leaves_apart=0.1)
    points = rng.normal(0.0, 0.1, (120, 3)).astype(np.float32)
    leaves = rng.integers(0, len(trained.leaf_sureness), (120, 3))
    joints, confidence, evidence = np.empty((20, 3)), np.empty(20), np.empty(20)
    forest.vote(
        points, leaves, trained.leaf_offsets, 0.01, trained.leaf_sureness, trained.leaf_in_view, WEIGHTS, LOG_ODDS,
        voters, 0.06, 4, joints, confidence, evidence,
    )  # fmt: skip
    expected, sure, shown = plain_vote(points.astype(np.float64), leaves, trained, voters, 0.06, 4)
    assert joints == pytest.approx(expected, abs=1e-5)
    assert confidence == pytest.approx(sure, abs=1e-5)
    assert evidence == pytest.approx(shown, abs=1e-5)
    assert (confidence > 0).all() and (confidence <= 1).all()


def test_the_larger_group_of_votes_wins_and_a_divided_vote_is_less_sure() -> None:
    sure_leaves, joints = np.full((2, 1), 255, dtype=np.uint8), np.empty((1, 3))
    confidence, evidence = np.empty(1), np.empty(1)
    offsets = np.array([[[0, 0, 0]], [[100, 0, 0]]], dtype=np.int8)
    points = np.zeros((10, 3), dtype=np.float32)
    sure = []
    for many in (10, 8):
        leaves = (np.arange(10) >= many).astype(np.int64)[:, None]
        forest.vote(
            points,
            leaves,
            offsets,
            0.01,
            sure_leaves,
            sure_leaves,
            WEIGHTS,
            LOG_ODDS,
            100,
            0.06,
            8,
            joints,
            confidence,
            evidence,
        )
        assert joints[0] == pytest.approx([0.0, 0.0, 0.0], abs=0.01)
        sure.append(confidence[0])
    assert sure == pytest.approx([1.0, 0.8], abs=0.01)


def test_a_cloud_of_no_or_one_point_gives_finite_joints() -> None:
    trained = random_forest(np.random.default_rng(2))
    depth = np.zeros((CAMERA.height, CAMERA.width), dtype=np.float32)
    nobody = trained.estimate(Cloud.from_depth(depth, CAMERA, LEVEL), 100)
    depth[100, 100] = 2.0
    speck = trained.estimate(Cloud.from_depth(depth, CAMERA, LEVEL), 100)
    for estimate in (nobody, speck):
        assert estimate.points.shape == (20, 3) and np.isfinite(estimate.points).all()
        assert ((estimate.confidence >= 0) & (estimate.confidence <= 1)).all()
    assert not nobody.confidence.any()


def test_reliability_is_read_off_the_calibration_of_each_joint() -> None:
    steps = np.linspace(0.0, 1.0, 3, dtype=np.float32) ** 2 * np.linspace(0.5, 1.0, 20, dtype=np.float32)[:, None]
    calibrated = replace(random_forest(np.random.default_rng(2), leaves_apart=0.02), calibration=steps)
    estimate = calibrated.estimate(body_cloud(load_body("neutral"), standing(-2.5)), 100)
    expected = [np.interp(c, [0.0, 0.5, 1.0], row) for c, row in zip(estimate.confidence, steps, strict=True)]
    assert estimate.reliability == pytest.approx(expected)


# Training


def entropy(labels: np.ndarray) -> float:
    """Label entropy summed over samples, nats."""
    share = np.bincount(labels) / len(labels)
    share = share[share > 0]
    return float(-len(labels) * (share * np.log(share)).sum())


def plain_stored_question(picture: np.ndarray, window: np.ndarray, u: int, v: int, offsets: np.ndarray) -> float:
    """A question in a crop of a training image, metres, 65.535 = unobserved, focal length 60."""

    def probe(x: float, y: float) -> float:
        iu, iv = round(u + 60.0 / picture[v, u] * x), round(v + 60.0 / picture[v, u] * y)
        if not (window[0] <= iu <= window[1] and window[2] <= iv <= window[3]):
            return -1.0
        inside = 0 <= iv < picture.shape[0] and 0 <= iu < picture.shape[1]
        if not inside or picture[iv, iu] == 0:
            return 1.0
        return -1.0 if picture[iv, iu] == 65.535 else float(np.clip(picture[iv, iu] - picture[v, u], -1.0, 1.0))

    return probe(offsets[0], offsets[1]) - probe(offsets[2], offsets[3])


def test_the_best_split_is_that_of_a_scan_over_all_questions_and_thresholds() -> None:
    rng = np.random.default_rng(3)
    shapes = np.array([[20, 24], [30, 18]])
    images = rng.integers(1500, 3500, int(shapes.prod(axis=1).sum()), dtype=np.uint16)
    images[rng.random(len(images)) < 0.2] = 0
    starts = np.array([0, 480])
    windows = np.array([[-3, 23, -5, 19], [0, 100, -100, 100]])
    images[rng.random(len(images)) < 0.1] = 65535
    image = rng.integers(0, 2, 200).astype(np.int32)
    u = (rng.random(200) * shapes[image, 1]).astype(np.int32)
    v = (rng.random(200) * shapes[image, 0]).astype(np.int32)
    images[starts[image] + v * shapes[image, 1] + u] = 2000
    candidates = rng.uniform(-0.5, 0.5, (6, 4)).astype(np.float32)
    candidates[:3, 2:] = 0.0
    labels = rng.integers(0, 4, 200)
    rows = np.sort(rng.choice(200, 150, replace=False))
    # One question tells the labels apart a little, so that there is something to find.
    answers = np.empty((6, 200))
    for q in range(6):
        for n in range(200):
            k = image[n]
            picture = images[starts[k] : starts[k] + shapes[k].prod()].reshape(shapes[k]).astype(np.float64) * 0.001
            answers[q, n] = plain_stored_question(picture, windows[k], u[n], v[n], candidates[q])
    labels[answers[4] > 0.2] = 1
    bins = 10
    best = (np.inf, -1, 0.0)
    for q in range(6):
        for b in range(1, bins):
            threshold = -0.5 + b / bins
            low, high = (labels[rows][side] for side in (answers[q, rows] < threshold, answers[q, rows] >= threshold))
            if len(low) and len(high):
                best = min(best, (entropy(low) + entropy(high), q, threshold))
    samples = forest_training.Samples(images, starts, shapes, windows, 60.0, image, u, v)
    found = forest_training.best_split(samples, labels, rows, np.ascontiguousarray(candidates.T), bins, 4)
    assert found[0] == best[1] == 4
    assert found[2] == pytest.approx(best[0], rel=1e-6)
    below = answers[4, rows] < found[1]  # several thresholds may part the samples in the same way
    assert entropy(labels[rows][below]) + entropy(labels[rows][~below]) == pytest.approx(best[0], rel=1e-6)
    kernel = np.empty(150, dtype=np.float32)
    forest_training.answers(samples, rows, candidates[4], kernel)
    assert kernel == pytest.approx(answers[4, rows], abs=1e-5)


def test_where_no_question_separates_the_samples_there_is_no_split() -> None:
    images, zero = np.full(100, 2000, dtype=np.uint16), np.zeros(5, dtype=np.int32)
    samples = forest_training.Samples(
        images, np.array([0]), np.array([[10, 10]]), np.array([[0, 9, 0, 9]]), 60.0, zero, zero + 5, zero + 5
    )
    found = forest_training.best_split(samples, np.arange(5), np.arange(5), np.zeros((4, 3), np.float32), 8, 5)
    assert found[0] == -1


def a_few_poses() -> np.ndarray:
    """Canonical poses (40, P): standing, arms anywhere."""
    rng = np.random.default_rng(7)
    poses = np.zeros((40, skeleton.POSE_SIZE))
    for side, down in (("left", -1.0), ("right", 1.0)):
        shoulder = skeleton.POSE_NAMES.index(f"{side}_shoulder_rz")
        poses[:, shoulder] = down * rng.uniform(-0.3, 1.4, 40)
        poses[:, skeleton.POSE_NAMES.index(f"{side}_elbow_ry")] = down * rng.uniform(0.0, 1.0, 40)
    return canonical.canonicalise(poses)[0]


def drawn(views: ViewSettings) -> TrainingImages:
    """Sixty images of sixty pixels each."""
    silent = lambda done, total: None  # noqa: E731
    return draw_images(a_few_poses(), views, SMALL.images, SMALL.pixels, np.random.default_rng(0), silent)


def standing(z: float) -> np.ndarray:
    """Pose (P,) of a person who stands at depth -`z` and faces the camera."""
    return canonical.place(a_few_poses()[5], np.zeros(4), np.array([0.0, 0.0, z]), 0.0)


def test_training_images_show_people_with_their_joints() -> None:
    data = drawn(PLAIN)
    assert len(data.shapes) == SMALL.images
    assert len(data.labels) == SMALL.images * SMALL.pixels
    assert len(data.depth) == data.shapes.prod(axis=1).sum()
    z = data.depth[data.starts[data.sample_image] + data.sample_v * data.shapes[data.sample_image, 1] + data.sample_u]
    assert (z > 900).all() and (z < 5500).all()
    head, foot = data.offsets()[:, 3], data.offsets()[:, 15]
    # The level frame has y up: heads are above feet, and nobody is larger than a tall adult.
    assert ((head - foot)[:, 1] > 0.8).all()
    assert np.linalg.norm(data.offsets(), axis=2).max() < 2.2
    left, right = (data.offsets()[:, skeleton.REPORTED.index(f"{s}_hip")] for s in ("left", "right"))
    assert ((left - right)[:, 0] > 0).mean() > 0.6  # most face the camera
    # Hip to hip is one body's width in all of its pixels.
    width = np.linalg.norm(left - right, axis=1).reshape(SMALL.images, -1)
    assert np.ptp(width, axis=1).max() < 0.005


def test_cut_people_end_at_the_border_and_what_lies_beyond_is_not_in_view() -> None:
    whole, cut = drawn(PLAIN), drawn(replace(PLAIN, cut=1.0))
    assert whole.in_view.mean() > 0.97
    assert 0.3 < cut.in_view.mean() < 0.85
    feet = [skeleton.REPORTED.index(f"{side}_foot") for side in ("left", "right")]
    assert not cut.in_view[:, feet].any()
    assert cut.in_view[:, skeleton.REPORTED.index("head")].mean() > 0.7
    for image, (start, (height, width)) in enumerate(zip(cut.starts, cut.shapes, strict=True)):
        picture = cut.depth[start : start + height * width].reshape(height, width)
        last = cut.windows[image, 3]
        assert (picture[max(last + 1, 0) :] == 65535).all() and last < height
        assert cut.sample_v[cut.sample_image == image].max() <= last


@given(
    st.integers(0, 2**32 - 1), st.floats(0.55, 4.2), st.floats(0.05, 2.2), st.floats(0.05, 2.2), st.floats(-0.5, 1.5),
    st.booleans(),
)  # fmt: skip
@drawn_with(max_examples=1500, deadline=None)
def test_some_of_a_person_is_always_inside_the_image(
    seed: int, distance: float, across: float, tall: float, low: float, cut: bool
) -> None:
    # Any person at any distance, however small, whose joints may even lie outside of the crop.
    rng = np.random.default_rng(seed)
    joints = np.zeros((len(skeleton.REPORTED), 3))
    joints[:, 1] = rng.uniform(-low * tall - 0.01, (1.0 - low) * tall, len(joints))
    joints[:, 2] = -distance
    scale = FOCAL / distance
    shape = (int(np.ceil(scale * tall)) + 4, int(np.ceil(scale * across)) + 4)
    first_u, last_u, first_v, last_v = image_window(joints, np.array([0.0, -scale * tall]), shape, cut, rng)
    assert max(first_u, 0) <= min(last_u, shape[1] - 1)
    assert max(first_v, 0) <= min(last_v, shape[0] - 1)


def test_what_stands_before_people_hides_them() -> None:
    free, hidden = drawn(PLAIN), drawn(replace(PLAIN, hidden=1.0))
    seen = [((d.depth > 0) & (d.depth < 65535)).sum() / len(d.depth) for d in (free, hidden)]
    assert seen[1] < 0.9 * seen[0]
    assert hidden.in_view.mean() < 0.95 < free.in_view.mean()
    assert (hidden.depth == 65535).any()


def test_a_joint_is_in_view_where_a_pixel_near_it_shows_the_person() -> None:
    rng, space, poses = np.random.default_rng(3), ShapeSpace.load(), a_few_poses()
    settings = replace(PLAIN, cut=0.5, hidden=0.5)
    near: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(40):
        view = draw_view(poses, np.zeros(len(poses), dtype=bool), space, settings, rng)
        v, u = np.nonzero((view.depth > 0) & (view.depth < 65535))
        if len(v) < SMALL.pixels:
            continue
        pixels = FOCAL * view.joints[:, :2] * [1.0, -1.0] / -view.joints[:, 2:] - view.corner
        for pixel, shown in zip(pixels, view.in_view, strict=True):
            near[bool(shown)].append(np.hypot(u - pixel[0], v - pixel[1]).min() / FOCAL * -view.joints[0, 2])
    assert np.quantile(near[True], 0.9) < 0.05
    assert np.median(near[False]) > 0.1


def test_raised_cameras_look_down_and_children_are_small() -> None:
    space, poses = ShapeSpace.load(), a_few_poses()
    nobody = np.zeros(len(poses), dtype=bool)
    for settings in (replace(PLAIN, raised=1.0), replace(PLAIN, small=1.0)):
        rng = np.random.default_rng(0)
        joints = np.array([draw_view(poses, nobody, space, settings, rng).joints for _ in range(60)])
        head, feet = joints[:, 3, 1], joints[:, [15, 19], 1].min(axis=1)
        if settings.raised:
            assert feet.max() < -0.2 and feet.min() < -2.0  # the camera's height over the floor
            down = -0.5 * (head + feet) / -joints[:, 0, 2]
            assert 0.6 < down.max() < 1.1
        else:
            assert 0.5 < (head - feet).min() and (head - feet).max() < 1.3


def test_people_who_sit_are_found_among_those_who_stand_and_lie() -> None:
    body = load_body("neutral")
    poses = []
    for names in (("walk", "wave", "bend_forward", "march"), SEATED_MOTIONS):
        clips = procedural_clips(names, 5.0, body=body, variations=1)
        poses.append(canonical.canonicalise(np.concatenate([clip.poses for clip in clips]))[0])
    assert is_seated(poses[0], body).mean() < 0.03 and is_seated(poses[1], body).mean() > 0.8


def test_a_share_outside_its_range_is_refused() -> None:
    with pytest.raises(SettingsError, match="hidden is 1.5"):
        ViewSettings(hidden=1.5)


def test_parts_have_two_labels_each_on_both_sides() -> None:
    body = ShapeSpace.load().body()
    labels = body_labels(body)
    assert set(labels // 2) == set(body.part)
    for name in ("root", "cervical"):
        joint = skeleton.JOINT_NAMES.index(name)
        assert (body.vertices[labels == 2 * joint, 0] <= 0).all() and (
            body.vertices[labels == 2 * joint + 1, 0] > 0
        ).all()
    joint = skeleton.JOINT_NAMES.index("left_elbow")
    near, far = (np.linalg.norm(body.vertices[labels == 2 * joint + k] - body.joints[joint], axis=1) for k in (0, 1))
    assert near.max() <= far.min()


@pytest.fixture(scope="module")
def trained() -> JointRegressor:
    settings = replace(
        SMALL,
        images=500,
        trees=2,
        depth=10,
        smallest_leaf=15,
        questions=40,
        node_samples=1000,
        views=replace(PLAIN, turned=0.0),
    )
    return train_regressor(a_few_poses(), settings, seed=1)


@pytest.mark.parametrize("yaw", [-20.0, 0.0, 25.0])
def test_a_small_forest_finds_head_and_hips_in_a_view_that_it_has_not_seen(trained: JointRegressor, yaw: float) -> None:
    body = load_body("slim_male")
    pose = canonical.place(a_few_poses()[11], np.zeros(4), np.array([0.2, -0.1, -2.6]), np.deg2rad(yaw))
    estimate = trained.estimate(body_cloud(body, pose), 300)
    errors = np.linalg.norm(estimate.points - body.joint_positions(pose), axis=1)
    for name in ("head", "neck", "left_hip", "right_hip", "left_shoulder", "right_shoulder"):
        assert errors[skeleton.REPORTED.index(name)] < 0.1, name
    assert (estimate.confidence <= 1).all()
    sure = estimate.confidence[[skeleton.REPORTED.index(name) for name in ("head", "left_hand", "right_hand")]]
    assert sure[0] > 2 * sure[1:].max()  # hands are small and go anywhere
    hips = [estimate.points[skeleton.REPORTED.index(f"{side}_hip")] for side in ("left", "right")]
    assert hips[0][0] > hips[1][0]


def test_another_camera_sees_the_same_joints(trained: JointRegressor) -> None:
    body = load_body("neutral")
    pose = canonical.place(a_few_poses()[5], np.zeros(4), np.array([0.0, 0.0, -2.5]), 0.0)
    cloud = body_cloud(body, pose)
    coarse = Camera(CAMERA.fx / 2, CAMERA.fy / 2, CAMERA.cx / 2, CAMERA.cy / 2, CAMERA.width // 2, CAMERA.height // 2)
    half = Cloud.from_depth(cloud.depth[::2, ::2], coarse, LEVEL)
    fine, rough = trained.estimate(cloud, 300), trained.estimate(half, 300)
    assert np.linalg.norm(fine.points - rough.points, axis=1)[[0, 3, 12, 16]].max() < 0.04


def test_a_forest_does_not_depend_on_the_number_of_workers() -> None:
    alone, together = (train_regressor(a_few_poses(), SMALL, seed=4, workers=workers) for workers in (1, 2))
    assert len(alone.roots) == SMALL.trees and len(alone.thresholds) > 10
    for name, array in alone.arrays().items():
        assert np.array_equal(array, together.arrays()[name]), name
    other = train_regressor(a_few_poses(), SMALL, seed=5)
    assert not np.array_equal(alone.leaf_offsets[:5], other.leaf_offsets[:5])


def samples_of(data: TrainingImages) -> forest_training.Samples:
    return forest_training.Samples(
        data.depth, data.starts, data.shapes, data.windows, FOCAL, data.sample_image, data.sample_u, data.sample_v
    )


GROWTH = forest_training.Growth(8, 20, 24, 12, 100, 64)


def plain_tree(samples: forest_training.Samples, labels: np.ndarray, seed: int) -> list[tuple[int, list[int]]]:
    """Path and samples of each leaf, grown node by node with the kernel's splits alone."""
    leaves, pending = [], [(np.arange(len(labels), dtype=np.int32), 1)]
    while pending:
        rows, path = pending.pop()
        state = np.array([seed ^ (path * 0xD1342543DE82EF95) % 2**64], dtype=np.uint64)
        sides = []
        if path.bit_length() <= GROWTH.deepest and len(rows) >= 2 * GROWTH.smallest_leaf:
            judges = forest_training.judges_of(rows, GROWTH.node_samples, state)
            count = min(max(len(judges) // 5, forest_training.FEWEST_QUESTIONS), GROWTH.questions)
            questions = forest_training.random_questions(count, state)
            best, threshold, _ = forest_training.best_split(samples, labels, judges, questions, 12, 64)
            answer = np.empty(len(rows), dtype=np.float32)
            forest_training.answers(samples, rows, questions[:, best], answer)
            sides = [rows[answer < np.float32(threshold)], rows[answer >= np.float32(threshold)]]
            if best < 0 or min(map(len, sides)) < GROWTH.smallest_leaf // 2:
                sides = []
        if sides:
            pending += [(sides[1], 2 * path + 1), (sides[0], 2 * path)]
        else:
            leaves.append((path, rows.tolist()))
    return leaves


@pytest.mark.parametrize("top", [0, 2, 6, 9])
def test_a_tree_grown_in_parts_and_threads_is_the_one_grown_node_by_node(
    top: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("database_builder.growing.TOP", top)
    data = drawn(PLAIN)
    ((tree, rows),) = grow_trees(samples_of(data), data.labels, GROWTH, [77], 2, lambda done, total: None)
    expected = plain_tree(samples_of(data), data.labels, 77)
    assert [path for path, _ in expected] == tree.paths.tolist()
    assert [rows[a:b].tolist() for a, b in pairwise(tree.starts)] == [leaf for _, leaf in expected]
    assert len(expected) > 30
    for leaf, path in enumerate(tree.paths.tolist()):  # the children lead where the paths say
        node = 0
        for turn in f"{path:b}"[1:]:
            assert node >= 0
            node = tree.children[node, int(turn)]
        assert node == -1 - leaf


def test_leaves_hold_the_mean_offset_of_their_samples_and_how_sure_it_is() -> None:
    data = drawn(replace(PLAIN, cut=0.6))
    rng = np.random.default_rng(0)
    rows, starts = rng.permutation(len(data.labels))[:200], [0, 40, 41, 130, 200]
    mean, variance, share, person = leaf_votes(data, rows, starts)
    assert (person == 1).all()
    for leaf, (a, b) in enumerate(pairwise(starts)):
        shown = data.in_view[data.sample_image[rows[a:b]]]
        assert share[leaf] == pytest.approx(shown.mean(axis=0))
        for joint in range(20):  # only the samples that show a joint are asked where they are enough
            asked = shown[:, joint] if shown[:, joint].sum() >= 5 else np.ones(b - a, dtype=bool)
            votes = data.offsets(rows[a:b])[asked, joint].astype(np.float64)
            assert mean[leaf, joint] == pytest.approx(votes.mean(axis=0), abs=1e-4)
            assert variance[leaf, joint] == pytest.approx(votes.var(axis=0).sum(), abs=1e-4)


def test_a_forest_holds_what_the_leaves_of_its_trees_know(trained: JointRegressor) -> None:
    assert np.abs(trained.leaf_offsets.astype(int)).max() > 80 and trained.leaf_sureness.max() > 100
    reached = np.sort(np.concatenate([trained.children.ravel(), trained.roots]))
    assert np.array_equal(reached, np.arange(-len(trained.leaf_offsets), len(trained.offsets)))


def test_a_calibrated_forest_reports_joints_below_the_image_and_its_accuracy() -> None:
    views = replace(PLAIN, turned=0.0, cut=0.5)
    settings = replace(SMALL, images=300, pixels=80, depth=10, smallest_leaf=15, questions=40, views=views)
    plain = train_regressor(a_few_poses(), settings, seed=2)
    forest_ = train_regressor(a_few_poses(), replace(settings, calibration=150), seed=2)
    assert np.array_equal(plain.leaf_offsets, forest_.leaf_offsets)
    assert (np.diff(forest_.calibration, axis=1) >= 0).all()
    body = load_body("neutral")
    shown, hidden, sure, right = [], [], [], []
    for row in range(0, 40, 4):
        pose = canonical.place(a_few_poses()[row], np.zeros(4), np.array([0.0, -0.55, -1.7]), 0.1)
        estimate = forest_.estimate(body_cloud(body, pose), 300)
        joints = body.joint_positions(pose)
        below = CAMERA.project(joints @ LEVEL)[:, 1] > 255
        hidden += list(estimate.in_view[below])
        shown += list(estimate.in_view[:4])
        sure.append(estimate.reliability[:4].mean())
        right.append((np.linalg.norm(estimate.points - joints, axis=1)[:4] < 0.1).mean())
    assert len(hidden) > 30
    assert np.mean(hidden) < 0.3 < 0.8 < np.mean(shown)
    assert np.mean(sure) == pytest.approx(np.mean(right), abs=0.25)


def test_what_was_trained_before_a_failure_is_used_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing ends in the middle, then calibration fails: neither images nor trees are made twice."""
    monkeypatch.setattr(parts, "DRAWN_TOGETHER", 20)
    made: list[str] = []
    draw, grow = parts.draw_images, parts.grow_trees

    def drawing(*arguments: Any) -> TrainingImages:
        made.append("images")
        if made == ["images", "images"] and len(list(tmp_path.iterdir())) == 1:
            raise KeyboardInterrupt
        return draw(*arguments)

    def growing(*arguments: Any) -> Any:
        made.append("trees")
        return grow(*arguments)

    def broken(*arguments: Any) -> JointRegressor:
        raise ValueError("no pixel")

    monkeypatch.setattr(parts, "draw_images", drawing)
    monkeypatch.setattr(parts, "grow_trees", growing)
    with pytest.raises(KeyboardInterrupt):
        train_regressor(a_few_poses(), SMALL, seed=4, kept=tmp_path)
    with monkeypatch.context() as failing:
        failing.setattr(parts, "calibrated", broken)
        with pytest.raises(ValueError, match="no pixel"):
            train_regressor(a_few_poses(), SMALL, seed=4, kept=tmp_path)
    trained = train_regressor(a_few_poses(), SMALL, seed=4, kept=tmp_path)
    assert made == ["images"] * 4 + ["trees"]  # three parts, of which the second was begun twice
    plain = train_regressor(a_few_poses(), SMALL, seed=4)
    assert all(np.array_equal(array, trained.arrays()[name]) for name, array in plain.arrays().items())
    train_regressor(a_few_poses(), SMALL, seed=5, kept=tmp_path)
    assert made[9:] == ["images"] * 3 + ["trees"]  # of another seed


def test_training_goes_on_where_nothing_can_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: Any, **options: Any) -> None:
        raise OutputError("cannot write: No space left on device")

    monkeypatch.setattr("database_builder.kept.save_archive", full)
    assert len(train_regressor(a_few_poses(), SMALL, kept=tmp_path).roots) == 2
    assert not list(tmp_path.iterdir())


def test_images_drawn_in_parts_are_put_together_within_their_own_memory() -> None:
    def part(pixels: int) -> TrainingImages:
        whole = {"starts": np.array([0, 5]), "sample_image": np.array([0, 1, 1], np.int32)}
        rows = {item.name: np.ones(3, np.uint8) for item in fields(TrainingImages)}
        return TrainingImages(**{**rows, **whole, "depth": np.full(pixels, 7, np.uint16)})

    sizes = [1_000_000 + number for number in range(8)]
    tracemalloc.start()
    try:
        joined = parts.gathered(map(part, sizes))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    begins = np.cumsum([0, *sizes[:-1]])
    np.testing.assert_array_equal(joined.starts, np.concatenate([[begin, begin + 5] for begin in begins]))
    np.testing.assert_array_equal(
        joined.sample_image, np.concatenate([[2 * k, 2 * k + 1, 2 * k + 1] for k in range(8)])
    )
    assert joined.sample_image.dtype == np.int32 and (joined.depth == 7).all() and len(joined.depth) == sum(sizes)
    assert peak < joined.depth.nbytes + 3 * 2 * max(sizes)  # three parts besides, in bytes


@pytest.mark.parametrize("values", [{"images": 0}, {"trees": 0}, {"bins": 1}])
def test_impossible_training_settings_are_refused(values: dict[str, int]) -> None:
    with pytest.raises(SettingsError, match="parts"):
        RegressorSettings(**values)


def test_leaves_are_rounded_by_less_than_their_samples_tell() -> None:
    rng = np.random.default_rng(0)
    mean, variance = rng.uniform(-1.2, 1.2, (300, 20, 3)), np.exp(rng.uniform(-8.0, 1.0, (300, 20)))
    variance[0] = np.inf
    spread = np.sqrt(np.minimum(variance, 1.0))
    rounded = 0.01 * parts.coarse_offsets(mean, variance)
    assert (np.abs(rounded - mean) <= np.maximum(0.25 * spread, 0.005)[..., None] + 1e-9).mean() > 0.99  # else clipped
    assert np.abs(rounded - mean).max() < 0.35
    sure, exact = parts.coarse_sureness(variance), sureness(variance)
    assert (np.abs(sure.astype(int) - exact) <= np.maximum(exact // 15, 0.5)).all() and (sure[1:] > 0).all()
    assert len(np.unique(sure)) < 0.5 * len(np.unique(exact))


def test_a_stored_forest_is_the_one_that_was_trained(trained: JointRegressor) -> None:
    stored = trained.stored()
    assert stored["offsets"].dtype == np.float16 and "children" not in stored
    read = JointRegressor.of_stored(stored)
    for name, array in trained.arrays().items():
        assert np.array_equal(array, read.arrays()[name]) and array.dtype == read.arrays()[name].dtype, name
    with pytest.raises(DatabaseError, match="holds"):
        JointRegressor.of_stored({"roots": trained.roots})
