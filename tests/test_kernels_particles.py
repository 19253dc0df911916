"""Cost of particles against ray casting; resampling; inverse kinematics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.poses import upper_body_depth
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.fitting.placed import Placer, balls_of
from toolkit.kernels.fit import aiming, particles
from toolkit.sensing.camera import Camera
from toolkit.trackers.lopez2011.costs import ParticleFrame, costs_of
from toolkit.trackers.lopez2011.upper import UpperBodies, UpperBody

LEVEL = np.diag([1.0, -1.0, -1.0])
SMALL = Camera(142.8, 142.8, 79.5, 59.5, 160, 120)


@pytest.fixture(scope="module")
def upper() -> UpperBody:
    return UpperBodies(LEVEL).of(load_body())


def some_pose(rng: np.random.Generator) -> np.ndarray:
    low, high = skeleton.POSE_LIMITS[6:].T
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[:3] = [0.0, -0.35, -1.5]
    pose[6:] = np.clip(rng.normal(0.0, 0.3, len(low)), low, high)
    return pose


def plain_cost(drawn: np.ndarray, seen: np.ndarray, window: tuple[slice, slice]) -> float:
    """Return Eq. 3's first two terms from whole images, with weights 40 and 20 and a cap of 0.1 m."""
    drawn, seen = drawn[window], seen[window]
    measured, there, known = seen > 0, drawn > 0, ~np.isnan(seen)
    squares = np.minimum((drawn - seen) ** 2, 0.01) / 0.01
    c_d = np.where(measured & there, squares, np.where(measured, 1.0, 0.0))
    c_f = (measured != there) & known
    return float((40.0 * c_d + 20.0 * c_f).sum() / measured.sum())


def plain_picture(upper: UpperBody, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the drawn trunk with the arms as balls cast by rays, and the centres of all balls."""
    body, balls = upper.body, balls_of(upper.body)
    arms = [name for arm in skeleton.ARMS for name in arm[1:]]
    depth = upper_body_depth(body, pose, SMALL, LEVEL, [*skeleton.LEGS, *arms])
    placed = Placer(body, SMALL, LEVEL).place(body, pose)
    centres = placed.origins[balls.joint] + np.einsum("bij,bj->bi", placed.rotations[balls.joint], balls.offset)
    v, u = np.indices(depth.shape)
    rays = np.stack([(u - SMALL.cx) / SMALL.fx, (v - SMALL.cy) / SMALL.fy, np.ones(depth.shape)], axis=2)
    a, nearest = (rays**2).sum(axis=2), np.where(depth > 0, depth, np.inf)
    for row in np.flatnonzero(np.isin(balls.joint, [skeleton.JOINT_NAMES.index(name) for name in arms])):
        b = rays @ centres[row]
        within = b**2 - a * (centres[row] @ centres[row] - balls.radius[row] ** 2)
        nearest = np.where(within > 0, np.minimum(nearest, (b - np.sqrt(np.maximum(within, 0))) / a), nearest)
    return np.where(np.isinf(nearest), 0.0, nearest), centres


def test_a_particle_costs_what_its_picture_and_its_overlaps_cost(upper: UpperBody) -> None:
    rng, balls = np.random.default_rng(2), balls_of(upper.body)
    poses = np.array([some_pose(rng) for _ in range(4)])
    seen = upper_body_depth(upper.body, some_pose(rng), SMALL, LEVEL).astype(np.float64)
    seen[90:, :] = np.nan
    frame = ParticleFrame(seen, np.array(SMALL.intrinsics), np.empty((0, 3)))
    for pose, cost in zip(poses, costs_of(upper, poses, frame, np.array([10, 110, 20, 150])), strict=True):
        picture, centres = plain_picture(upper, pose)
        first, second = upper.contacts.pairs.T
        apart = np.linalg.norm(centres[first] - centres[second], axis=1) / (balls.radius[first] + balls.radius[second])
        overlap = 10.0 * (np.maximum(0.8 - apart, 0.0) ** 2).sum()
        expected = plain_cost(picture, seen, (slice(10, 110), slice(20, 150)))
        assert cost == pytest.approx(expected + overlap, rel=1e-3)  # float32 depth


@given(
    weights=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=40).filter(lambda w: sum(w) > 1e-3),
    shift=st.floats(0.0, 0.999),
    count=st.integers(1, 300),
)
@settings(max_examples=100, deadline=None)
def test_systematic_resampling_keeps_each_row_floor_or_ceil_times(
    weights: list[float], shift: float, count: int
) -> None:
    shares = np.array(weights) / sum(weights)
    chosen = np.empty(count, dtype=np.int64)
    particles.systematic(shares, shift, chosen)
    times = np.bincount(chosen, minlength=len(shares))
    assert (np.diff(chosen) >= 0).all() and times.sum() == count
    assert (times >= np.floor(count * shares - 1e-6)).all() and (times <= np.ceil(count * shares + 1e-6)).all()


@pytest.mark.parametrize("side", [0, 1])
def test_aimed_arms_have_their_hands_at_the_targets(upper: UpperBody, side: int) -> None:
    rng = np.random.default_rng(5)
    arm, before = upper.arms[side], np.array([some_pose(rng) for _ in range(30)])
    hands = np.empty((30, 3))
    aiming.place_hands(before, arm, hands)
    tip = upper.body.end_effector_positions(before)[:, side]
    assert np.linalg.norm(hands - tip, axis=1).max() < 0.06
    targets, wanted = hands + rng.normal(0.0, 0.1, hands.shape), rng.random(30) < 0.8
    poses, scores, found = before.copy(), np.empty(30), np.empty((30, 3))
    aiming.aim_arms(poses, arm, wanted, targets, rng.normal(0, 0.2, 30), aiming.Aim(0.03, 0.1, -8.0), scores)
    aiming.place_hands(poses, arm, found)
    taken = np.isfinite(scores)
    assert taken[wanted].mean() > 0.6 and not taken[~wanted].any()
    np.testing.assert_array_equal(poses[~taken], before[~taken])
    missed = np.linalg.norm(found - targets, axis=1)[taken]
    angles = [arm.shoulder_entry, arm.shoulder_entry + 1, arm.shoulder_entry + 2, arm.elbow_entry]
    moved = ((poses - before)[taken][:, angles] ** 2).sum(axis=1)
    np.testing.assert_allclose(scores[taken], -0.5 * (missed / 0.03) ** 2 - 0.05 * moved, atol=1e-9)
    untouched = np.setdiff1d(np.arange(skeleton.POSE_SIZE), angles)
    np.testing.assert_array_equal(poses[:, untouched], before[:, untouched])
