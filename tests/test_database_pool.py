"""Pose pool in bounded memory: nothing is thinned while all poses fit; thinned poses still cover all others."""

import numpy as np
import pytest

from database_builder import pool
from database_builder.pool import PosePool
from database_builder.reading import CanonicalPoses
from database_builder.sampling import farthest_first, pose_distance
from tests.database_helpers import neutral, random_poses

SIZES = (70, 1, 130, 99)


def sources(seed: int = 0) -> list[CanonicalPoses]:
    """Return sources of some length; the second half of each mirrors the first."""
    rng, found = np.random.default_rng(seed), []
    for k, size in enumerate(SIZES):
        poses = random_poses(rng, 2 * size).astype(np.float32)
        joints = neutral().joint_positions(poses).astype(np.float32)
        found.append(CanonicalPoses(f"clip {k}", f"digest {k}", poses, joints, size))
    return found


def filled(threshold: float, most: int | None) -> PosePool:
    made = PosePool(threshold, most)
    for one in sources():
        made.add(one)
    return made


def test_what_fits_is_selected_plainly() -> None:
    selected = filled(0.1, 40).select()
    joints = np.concatenate([one.joints for one in sources()])
    np.testing.assert_array_equal(selected.rows.joints, joints[farthest_first(joints, 0.1, 40)])
    assert selected.thinned == {}


@pytest.mark.parametrize("part", [50, 64, 600])
def test_each_row_has_its_origin(part: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "PART", part)
    made = filled(0.05, None)
    rows, given = made.select().rows, sources()
    assert made.poses_read == 2 * sum(SIZES) and made.names == [one.name for one in given]
    for pose, source, frame, mirrored in zip(rows.poses, rows.source, rows.frame, rows.mirrored, strict=True):
        np.testing.assert_array_equal(pose, given[source].poses[frame + mirrored * given[source].frames])


@pytest.mark.parametrize(("threshold", "most"), [(0.0, 30), (0.3, None), (0.3, 30)])
def test_thinned_parts_cover_all_poses_as_far_as_is_said(
    threshold: float, most: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pool, "PART", 90)
    selected = filled(threshold, most).select()
    joints, chosen = np.concatenate([one.joints for one in sources()]), selected.rows.joints
    nearest = np.array([pose_distance(chosen, one).min() for one in joints])
    last = pose_distance(chosen[:-1], chosen[-1]).min() if most else threshold
    assert nearest.max() <= selected.thinned["cover"] + max(last, threshold) + 1e-6
    assert len(chosen) < selected.thinned["poses"] < len(joints) and (most is None or len(chosen) <= most)


def test_a_part_keeps_as_many_poses_as_are_wanted_in_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "PART", 100)
    assert filled(0.0, 60).select().thinned["poses"] == 6 * 60
    assert filled(0.0, None).select().thinned["poses"] == 6 * 5
