"""Local optimisation: terms, refinement, sparse distance, confidence, personal shape (Baak 2013, 5.4.1 and 5.4.4)."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.fitting_helpers import Fit
from tests.poses import entry, pose_at
from tests.support.plain_fitting import PlainPlacer
from toolkit.app.config import READER
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.placed import NormalSystem, Placer
from toolkit.fitting.priors import GaussianPrior
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import JointTerm
from toolkit.io.errors import SettingsError
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.cloud import Cloud
from toolkit.simulation.raycast import render_depth

CAMERA = Camera(190.0, 190.0, 87.5, 71.5, 176, 144)
HORIZONTAL = np.diag([1.0, -1.0, -1.0])
TILTED = level_rotation(np.array([0.05, -0.95, -0.25]))
SETTINGS = FittingSettings()


def standing(**angles: float) -> np.ndarray:
    """Return a person 2.7 m from the camera with the arms half raised and given other angles (radians)."""
    angles = {"left_shoulder_rz": -0.6, "right_shoulder_rz": 0.5, "left_elbow_ry": -0.5, "right_elbow_ry": 0.7} | angles
    return pose_at((0.05, -0.05, -2.7), **angles)


def cloud_of(body: Body, pose: np.ndarray, rotation: np.ndarray = HORIZONTAL) -> Cloud:
    return Cloud.from_depth(render_depth(body, pose, CAMERA, rotation), CAMERA, rotation)


def scene_of(body: Body, pose: np.ndarray, rotation: np.ndarray = HORIZONTAL, settings=SETTINGS) -> Scene:
    """Return the scene of a pose; the end effectors are the extrema."""
    cloud = cloud_of(body, pose, rotation)
    tips = body.end_effector_positions(pose)
    near = cKDTree(cloud.points).query(tips)[1]
    return Scene(cloud, cloud.points[near].astype(np.float64), settings.cloud_samples)


def joint_error(body: Body, pose: np.ndarray, truth: np.ndarray) -> float:
    """Return the mean distance of the reported joints, metres."""
    return float(np.linalg.norm(body.joint_positions(pose) - body.joint_positions(truth), axis=1).mean())


def perturbed(pose: np.ndarray, seed: int, angle: float = 0.1, shift: float = 0.03) -> np.ndarray:
    rng = np.random.default_rng(seed)
    out = pose + angle * rng.standard_normal(len(pose))
    out[:3] = pose[:3] + shift * rng.standard_normal(3)
    return np.clip(out, *skeleton.POSE_LIMITS.T)


@pytest.fixture(scope="module")
def body() -> Body:
    return load_body("neutral")


@pytest.fixture(scope="module")
def fit(body: Body) -> Fit:
    return Fit(body, CAMERA, HORIZONTAL, SETTINGS)


# Terms


def test_the_prior_is_the_gaussian_of_its_poses() -> None:
    rng = np.random.default_rng(0)
    poses = rng.normal(0.0, 0.2, (500, skeleton.POSE_SIZE)) + np.linspace(-0.3, 0.3, skeleton.POSE_SIZE)
    poses[:, 20] = 0.4  # never moves
    prior = GaussianPrior.of_poses(poses, 2.0)
    system = NormalSystem()
    system.matrix[:], system.vector[:] = 0.0, 0.0
    pose = rng.normal(size=skeleton.POSE_SIZE)
    prior.add(system, pose)
    covariance = np.cov(poses[:, 6:].T)
    mean = poses[:, 6:].mean(axis=0)

    def energy(angles: np.ndarray) -> float:
        spread = covariance + 0.1**2 * np.eye(len(covariance))
        return float((angles - mean) @ np.linalg.solve(spread, angles - mean))  # 1/2 weight = 1

    steps = 1e-5 * np.eye(len(mean))
    slope = [(energy(pose[6:] + step) - energy(pose[6:] - step)) / 2e-5 for step in steps]
    assert system.vector[6:] == pytest.approx(np.array(slope), rel=1e-5, abs=1e-5)
    assert system.matrix[6:, 6:] @ pose[6:] - system.vector[6:] == pytest.approx(system.matrix[6:, 6:] @ mean)
    assert not system.vector[:6].any() and not system.matrix[:6].any()
    assert np.isfinite(system.matrix).all()


@pytest.mark.parametrize("seed", range(2))
def test_joint_targets_have_the_gradient_of_their_robust_energy(body: Body, seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = perturbed(standing(), seed, 0.3)
    targets = body.joint_positions(pose) @ TILTED + rng.normal(0.0, 0.15, (20, 3))
    weights = rng.uniform(0.0, 2.0, 20)
    weights[5] = 0.0
    sigma = 0.3
    placed, system = Placer(body, CAMERA, TILTED).place(body, pose), NormalSystem()
    system.reset(placed.origins[0])
    JointTerm(targets, weights, sigma).add(system, placed, scene_of(body, pose, TILTED))
    system.assemble(placed)
    derived = [skeleton.REPORTED.index(name) for name in ("pelvis", "spine", "neck")]

    def energy(pose: np.ndarray) -> float:
        squared = ((body.joint_positions(pose) @ TILTED - targets) ** 2).sum(axis=1) / sigma**2
        parts = 0.5 * weights * sigma**2 * squared / (1.0 + squared)  # Geman-McClure
        return float(np.delete(parts, derived).sum())

    steps = 1e-6 * np.eye(len(pose))
    slope = np.array([(energy(pose + step) - energy(pose - step)) / 2e-6 for step in steps])
    assert system.vector == pytest.approx(slope, abs=1e-6)
    assert np.abs(slope).max() > 0.05


def test_a_body_is_placed_where_it_is_whatever_its_normals_are_taken_for(body: Body) -> None:
    placer = Placer(body, CAMERA, TILTED)
    other = load_body("child").normals
    given, own = placer.place(body, standing(), other), placer.place(body, standing())
    np.testing.assert_array_equal(given.vertices, own.vertices)
    assert not np.array_equal(given.normals, own.normals)
    np.testing.assert_array_equal(placer.place(body, standing(), body.normals).normals, own.normals)
    plain = PlainPlacer.like(placer).place(body, standing(), other)
    np.testing.assert_allclose(plain.normals, given.normals, atol=1e-9)


# Refinement


@pytest.mark.parametrize("rotation", [HORIZONTAL, TILTED], ids=["horizontal", "tilted"])
@pytest.mark.parametrize("seed", range(3))
def test_refining_a_disturbed_pose_brings_back_the_one_in_the_image(
    body: Body, seed: int, rotation: np.ndarray
) -> None:
    truth = perturbed(standing(), 100 + seed, 0.15)
    truth[:3] = rotation @ np.array([0.05, 0.05, 2.7])
    start = perturbed(truth, seed)
    fit = Fit(body, CAMERA, rotation, SETTINGS)
    before = start.copy()
    found = fit.refine(start, scene_of(body, truth, rotation), iterations=15)
    assert joint_error(body, start, truth) > 0.03
    assert joint_error(body, found, truth) < 0.01
    assert np.array_equal(start, before)


def test_joints_stay_within_their_limits_even_where_the_image_does_not(body: Body, fit: Fit) -> None:
    impossible = standing(left_elbow_ry=0.6, right_knee_rx=-0.5, cervical_rz=1.0)
    found = fit.refine(standing(left_elbow_ry=0.0, right_elbow_ry=0.7), scene_of(body, impossible), iterations=10)
    low, high = skeleton.POSE_LIMITS.T
    assert (found >= low - 1e-12).all() and (found <= high + 1e-12).all()
    assert found[entry("left_elbow_ry")] == pytest.approx(high[entry("left_elbow_ry")])
    assert found[entry("right_knee_rx")] == pytest.approx(low[entry("right_knee_rx")])


def test_estimated_joints_pull_an_arm_out_of_a_wrong_pose(body: Body, fit: Fit) -> None:
    truth = standing(left_shoulder_rz=0.9, left_elbow_ry=-0.3)
    wrong = standing(left_shoulder_rz=-1.3, left_elbow_ry=-0.3)
    scene = scene_of(body, truth)
    pull = JointTerm(body.joint_positions(truth) @ HORIZONTAL, np.full(20, 30.0), 0.3)
    drawn = fit.refine(wrong, scene, terms=[pull], iterations=20)
    alone = fit.refine(wrong, scene, iterations=20)
    wrist = skeleton.REPORTED.index("left_wrist")
    where = body.joint_positions(np.stack([truth, drawn, alone]))[:, wrist]
    assert np.linalg.norm(where[1] - where[0]) < 0.03
    assert np.linalg.norm(where[2] - where[0]) > 0.2


def test_a_prior_holds_what_the_image_does_not_show(body: Body) -> None:
    truth = standing()
    hidden = entry("left_wrist_ry")
    start = truth.copy()
    start[hidden] += 0.5
    mean = np.tile(truth, (2, 1))
    scene = Scene(Cloud.from_depth(np.zeros(CAMERA.shape, np.float32), CAMERA, HORIZONTAL), np.zeros((0, 3)), 0)
    pulled = Fit(body, CAMERA, HORIZONTAL, SETTINGS, [GaussianPrior.of_poses(mean, 1.0)])
    assert abs(pulled.refine(start, scene, iterations=30)[hidden] - truth[hidden]) < 0.01
    assert Fit(body, CAMERA, HORIZONTAL, SETTINGS).refine(start, scene) == pytest.approx(start)


def test_no_measured_point_belongs_to_a_link_that_is_out_of_view(body: Body) -> None:
    """Points that the shins then do not explain count against the pose; the shins do not move."""
    settings = replace(SETTINGS, contact_weight=0.0)
    fit, truth = Fit(body, CAMERA, HORIZONTAL, settings), standing(left_knee_rx=0.2, right_knee_rx=0.3)
    start = standing(left_knee_rx=0.6, right_knee_rx=0.7)
    scene, withheld = scene_of(body, truth), scene_of(body, truth)
    withheld.withheld = np.array([name.endswith(("knee", "ankle")) for name in skeleton.JOINT_NAMES])
    knees = [entry("left_knee_rx"), entry("right_knee_rx")]
    assert np.abs(fit.refine(start, scene)[knees] - truth[knees]).max() < 0.15
    assert fit.refine(start, withheld)[knees] == pytest.approx(start[knees], abs=1e-3)
    seen, unseen = fit.compare(truth, scene), fit.compare(truth, withheld)
    all_drawn, own_drawn = (
        one.scene.nearest_drawn(one.placed, one.scene.samples, settings.unexplained)[1] for one in (seen, unseen)
    )
    assert not withheld.withheld[body.part[own_drawn[own_drawn >= 0]]].any()
    assert withheld.withheld[body.part[all_drawn[all_drawn >= 0]]].any()
    assert unseen.distance > seen.distance + 0.01
    chosen = withheld.withheld[body.part[fit.placer.chosen]]
    assert np.isnan(unseen.gaps[chosen]).all() and not np.isnan(seen.gaps[chosen]).all()


# Distance and confidence


def test_the_true_pose_is_nearest_to_its_image(body: Body, fit: Fit) -> None:
    truth = standing()
    scene = scene_of(body, truth)
    right = fit.distance(truth, scene)
    assert right < 0.04
    rising = []
    for shift in (0.05, 0.15, 0.5):
        away = truth.copy()
        away[0] += shift
        rising.append(fit.distance(away, scene))
    assert [right, *rising] == sorted([right, *rising]) and rising[0] > right + 0.01
    for wrong in (standing(left_shoulder_rz=1.2), standing(left_knee_rx=1.5), perturbed(truth, 1, 0.4)):
        assert fit.distance(wrong, scene) > right + 0.01


def test_confidence_lies_in_its_range_and_is_low_for_hidden_joints(body: Body, fit: Fit) -> None:
    left, right = (skeleton.REPORTED.index(f"{side}_hand") for side in ("left", "right"))
    behind = standing(left_shoulder_rx=1.6, left_shoulder_ry=0.6, left_shoulder_rz=-1.3, left_elbow_ry=-1.6)
    hand = body.joint_positions(behind)[left]
    assert hand[2] < behind[2] - 0.05 and abs(hand[0] - behind[0]) < 0.2  # behind the back
    confidence = fit.confidence(behind, scene_of(body, behind))
    assert confidence.shape == (20,)
    assert ((confidence >= 0) & (confidence <= 1)).all()
    assert confidence[left] < confidence[right]


@pytest.mark.parametrize("samples", [0, SETTINGS.cloud_samples])
def test_extrema_on_what_a_person_touches_count_only_where_nothing_else_was_drawn(
    body: Body, fit: Fit, samples: int
) -> None:
    cloud, tips = cloud_of(body, standing()), body.end_effector_positions(standing())
    scenes = [Scene(cloud, tips + away, samples) for away in (0.0, 0.4)]
    lone, beside = (fit.distance(standing(), scene) for scene in scenes)
    if samples:
        assert beside == lone
        np.testing.assert_array_equal(*(fit.confidence(standing(), scene) for scene in scenes))
    else:
        assert beside > lone + 0.15


@pytest.mark.parametrize("points", [0, 1, 7])
def test_almost_empty_images_leave_everything_finite(body: Body, fit: Fit, points: int) -> None:
    depth = np.zeros(CAMERA.shape, dtype=np.float32)
    depth.ravel()[np.linspace(10000, 12000, points).astype(int)] = 2.6
    cloud = Cloud.from_depth(depth, CAMERA, HORIZONTAL)
    scene = Scene(cloud, cloud.points.astype(np.float64), SETTINGS.cloud_samples)
    found = fit.refine(standing(), scene)
    compared = fit.compare(found, scene)
    assert np.isfinite(found).all()
    assert np.abs(found - standing()).max() < np.pi
    if points:
        assert 0.0 < compared.distance <= 2 * SETTINGS.unexplained
    else:
        assert found == pytest.approx(standing())
        assert compared.distance == pytest.approx(SETTINGS.unexplained), "of every vertex that the camera should see"
        assert (fit.confidence(found, scene) < fit.confidence(standing(), scene_of(body, standing()))).all()


# Shape


@pytest.mark.parametrize("values", [{"iterations": 0}, {"neighbours": 0}, {"neighbours": 10}])
def test_settings_out_of_range_are_named(values: dict[str, object]) -> None:
    with pytest.raises(SettingsError, match=str(next(iter(values.values())))):
        READER.read(values, FittingSettings, "")
