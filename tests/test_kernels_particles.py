"""Cost of particles against separately drawn images and ray casting; resampling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.kernels.fit import aiming, particles
from toolkit.kernels.fit.particles import Tile
from toolkit.sensing.camera import Camera
from toolkit.simulation.raycast import cast
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


def tile_of(seen: np.ndarray, window: tuple[int, int, int, int] = (10, 110, 20, 150)) -> Tile:
    part = seen[window[0] : window[1], window[2] : window[3]]
    return Tile(
        seen.astype(np.float32),
        np.array(SMALL.intrinsics),
        np.array(window),
        max(int((part > 0).sum()), 1),
        0.1,
        40.0,
        20.0,
    )


def plain_cost(drawn: np.ndarray, tile: Tile) -> float:
    """Return Eq. 3's first two terms from whole images."""
    v0, v1, u0, u1 = tile.window
    drawn, seen = drawn[v0:v1, u0:u1], tile.seen[v0:v1, u0:u1].astype(np.float64)
    measured, there, known = seen > 0, drawn > 0, ~np.isnan(seen)
    squares = np.minimum((drawn - seen) ** 2, tile.cap**2) / tile.cap**2
    c_d = np.where(measured & there, squares, np.where(measured, 1.0, 0.0))
    c_f = (measured != there) & known
    return float((tile.depth * c_d + tile.silhouette * c_f).sum() / tile.pixels)


def drawn_balls(balls: np.ndarray, radii: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return balls cast one after the other over an image, each by all rays."""
    v, u = np.indices(depth.shape)
    rays = np.stack([(u - SMALL.cx) / SMALL.fx, (v - SMALL.cy) / SMALL.fy, np.ones(depth.shape)], axis=2)
    a, nearest = (rays**2).sum(axis=2), np.where(depth > 0, depth, np.inf)
    for ball, radius in zip(balls, radii, strict=True):
        b = rays @ ball
        within = b**2 - a * (ball @ ball - radius**2)
        if ball[2] - radius > particles.NEAREST:
            nearest = np.where(within > 0, np.minimum(nearest, (b - np.sqrt(np.maximum(within, 0))) / a), nearest)
    return np.where(np.isinf(nearest), 0.0, nearest)


def test_a_drawn_rig_is_the_mesh_as_rays_see_it(upper: UpperBody) -> None:
    pose = some_pose(np.random.default_rng(1))
    depth = np.empty(SMALL.shape)
    particles.draw(pose, upper.whole, np.array(SMALL.intrinsics), depth)
    body = upper.body
    drawn = ~np.isin(
        body.part,
        [skeleton.JOINT_NAMES.index(n) for n in skeleton.JOINT_NAMES if "hip" in n or "knee" in n or "ankle" in n],
    )
    faces = body.faces[drawn[body.faces].all(axis=1)]
    hits = cast(body.vertex_positions(pose) @ LEVEL, faces, SMALL).depth.reshape(SMALL.shape)
    both = (depth > 0) & (hits > 0)
    assert both.sum() > 2000 and ((depth > 0) == (hits > 0)).mean() > 0.995
    # faces seen from behind, at the cut through the hips, are drawn by rays only
    assert np.quantile(np.abs(depth - hits)[both], 0.999) < 1e-4


def test_arms_over_a_base_cost_as_much_as_the_whole_drawn_image(upper: UpperBody) -> None:
    rng = np.random.default_rng(2)
    poses = np.array([some_pose(rng) for _ in range(4)])
    seen = np.empty(SMALL.shape)
    particles.draw(some_pose(rng), upper.whole, np.array(SMALL.intrinsics), seen)
    seen[90:, :] = np.nan
    tile = tile_of(seen)
    bases, base_of = np.empty((2, *SMALL.shape)), np.array([0, 1, 1, 0])
    particles.draw_bases(poses[:2], upper.trunk, tile, bases)
    balls = np.empty((4, len(upper.trunk.radii), 3))
    particles.place_balls(poses, upper.trunk, balls)
    rows = np.concatenate(upper.of_arm)
    balls, radii = np.ascontiguousarray(balls[:, rows]), upper.trunk.radii[rows]
    balls[3, 0] = [0.0, 0.0, 0.01]  # at the camera: not drawn
    costs = np.empty(4)
    particles.overlay_costs(balls, radii, base_of, bases, tile, costs)
    for n in range(4):
        assert costs[n] == pytest.approx(plain_cost(drawn_balls(balls[n], radii, bases[base_of[n]]), tile), abs=1e-6)


def test_the_cost_of_a_trunk_is_that_of_its_picture(upper: UpperBody) -> None:
    rng = np.random.default_rng(4)
    seen, drawn = np.empty(SMALL.shape), np.empty(SMALL.shape)
    particles.draw(some_pose(rng), upper.whole, np.array(SMALL.intrinsics), seen)
    tile, pose, costs = tile_of(seen), some_pose(rng), np.empty(1)
    particles.trunk_costs(pose[None], upper.whole, tile, costs)
    particles.draw(pose, upper.whole, tile.intrinsics, drawn)
    assert costs[0] == pytest.approx(plain_cost(drawn, tile), abs=1e-6)


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
