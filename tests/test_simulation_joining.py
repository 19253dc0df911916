"""Concatenation of motions."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.simulation.joining import JOIN, joined


def part(seed: int, frames: int) -> np.ndarray:
    """Return a clip (frames, P) that moves ahead and turns."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, frames)[:, None]
    poses = 0.2 * rng.normal(size=(1, skeleton.POSE_SIZE)) + share * 0.2 * rng.normal(size=(1, skeleton.POSE_SIZE))
    poses[:, :3] = [2.0, 0.9, -1.0] + share * rng.normal(size=3)
    poses[:, skeleton.ROOT_ROTATION] = share * [0.0, 1.0, 0.0] + [0.0, rng.uniform(-2.0, 2.0), 0.0]
    return poses


PARTS = [part(0, 20), part(1, 15), part(2, 30)]


def test_parts_keep_their_movement_and_go_on_where_the_one_before_ended() -> None:
    poses, starts = joined(PARTS)
    assert len(poses) == 20 + 15 + 30 + 2 * JOIN
    assert starts == [0, 20 + JOIN, 35 + 2 * JOIN]
    for start, own in zip(starts, PARTS, strict=True):
        here = poses[start : start + len(own)]
        np.testing.assert_allclose(here[:, 6:], own[:, 6:], err_msg="joints bend as they did")
        np.testing.assert_allclose(here[:, 1], own[:, 1], err_msg="heights are kept")
        turn = Rotation.from_rotvec(here[0, 3:6]) * Rotation.from_rotvec(own[0, 3:6]).inv()
        np.testing.assert_allclose(here[:, :3] - here[0, :3], turn.apply(own[:, :3] - own[0, :3]), atol=1e-9)
        if start:
            np.testing.assert_allclose(here[0, [0, 2]], poses[start - JOIN - 1, [0, 2]], err_msg="without a step")
            np.testing.assert_allclose(here[0, 3:6], poses[start - JOIN - 1, 3:6], atol=1e-9, err_msg="nor a turn")


def test_a_join_eases_from_pose_to_pose() -> None:
    poses, _ = joined(PARTS[:2])
    steps = np.abs(np.diff(poses[19 : 21 + JOIN, 6:], axis=0)).max(axis=1)
    assert steps.argmax() in (JOIN // 2 - 1, JOIN // 2, JOIN // 2 + 1) and steps[[0, -1]].max() < 0.3 * steps.max()
    before, after = poses[19, 6:], poses[20 + JOIN, 6:]
    share = (poses[20 : 20 + JOIN, 6:] - before) / (after - before)
    np.testing.assert_allclose(share + share[::-1], 1.0, atol=1e-6)
