"""Sequences of clips joined at the poses, which benchmarks of annotation and stabilising share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from toolkit import skeleton
from toolkit.testing.labelled import ACTORS, JOIN, SEQUENCES, class_clips, joined, label_of
from toolkit.testing.suite import RATE


def part(seed: int, frames: int) -> np.ndarray:
    """A clip (frames, P) that goes somewhere, turning."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, frames)[:, None]
    poses = 0.2 * rng.normal(size=(1, skeleton.POSE_SIZE)) + share * 0.2 * rng.normal(size=(1, skeleton.POSE_SIZE))
    poses[:, :3] = [2.0, 0.9, -1.0] + share * rng.normal(size=3)
    poses[:, skeleton.ROOT_ROTATION] = share * [0.0, 1.0, 0.0] + [0.0, rng.uniform(-2.0, 2.0), 0.0]
    return poses


PARTS = [(part(0, 20), "kick"), (part(1, 15), None), (part(2, 30), "hop")]


def test_parts_keep_their_movement_and_go_on_where_the_one_before_ended() -> None:
    poses, segments = joined(PARTS)
    assert len(poses) == 20 + 15 + 30 + 2 * JOIN
    np.testing.assert_allclose([(s.start, s.end) for s in segments], np.array([(0, 20), (59, 89)]) / RATE)
    assert [s.label for s in segments] == ["kick", "hop"]
    for start, (own, _) in zip((0, 20 + JOIN, 35 + 2 * JOIN), PARTS, strict=True):
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


def test_one_part_is_itself() -> None:
    poses, (segment,) = joined(PARTS[:1])
    np.testing.assert_array_equal(poses, PARTS[0][0])
    assert (segment.start, segment.end, segment.label) == (0.0, 20 / RATE, "kick")


@pytest.mark.shared_data
@pytest.mark.parametrize("split", ["tune", "report"])
def test_no_clip_that_is_known_before_is_of_the_split_s_actor(split: str, shared_data: Path) -> None:
    known = class_clips(split)
    assert known and not any(f"_{ACTORS[split]}_" in path.name for path in known)
    wanted = {motion for sequence in SEQUENCES for motion, _ in sequence.motions}
    assert all(any(label.startswith(motion) for label in known.values()) for motion in wanted)
    assert label_of(Path("HDM_bk_kickLFront1Reps_001_120.amc")) == "kickLFront1Reps"
