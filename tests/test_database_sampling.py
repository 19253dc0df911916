"""Farthest-first selection against the plain one; the pool of poses in bounded memory."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from database_builder import sampling
from database_builder.reading import CanonicalPoses
from database_builder.sampling import PosePool, farthest_first, pose_distance
from tests.database_helpers import neutral, random_poses
from toolkit.io.errors import DatabaseError, UsageError


def plain_selection(points: np.ndarray, threshold: float, max_count: int) -> np.ndarray:
    """Return a farthest-first selection by the definition, float32 throughout."""
    selected = [0]
    nearest = np.sum((points - points[0]) ** 2, axis=1)
    while len(selected) < max_count:
        candidate = int(nearest.argmax())
        if not nearest[candidate] > (20 * threshold) ** 2:
            break
        selected.append(candidate)
        nearest = np.minimum(nearest, np.sum((points - points[candidate]) ** 2, axis=1))
    return np.array(selected)


def walk_of_poses(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return points along smooth random curves, similar to frames of mocap, float32 (count, 60)."""
    steps = rng.normal(size=(count, 8)).cumsum(axis=0) @ rng.normal(size=(8, 60))
    return (0.01 * steps + 0.002 * rng.normal(size=(count, 60))).astype(np.float32)


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 300),
    grid=st.sampled_from([0.0, 0.05, 1.0]),
    copies=st.booleans(),
    scale=st.sampled_from([1e-22, 1e-19, 1.0, 1e6]),
    threshold=st.sampled_from([0.0, 0.003, 0.018, 0.3]),
    limit=st.integers(1, 300),
)
@settings(max_examples=150, deadline=None)
def test_the_selection_equals_plain_farthest_first_with_ties_and_duplicates(
    seed: int, count: int, grid: float, copies: bool, scale: float, threshold: float, limit: int
) -> None:
    rng = np.random.default_rng(seed)
    points = walk_of_poses(rng, count)
    if grid:
        points = (np.round(points / grid) * grid).astype(np.float32)
    if copies:
        points = points[rng.integers(0, count, count)]
    points = (points * np.float32(scale)).astype(np.float32)
    expected = plain_selection(points, threshold * scale, limit)
    np.testing.assert_array_equal(farthest_first(points, threshold * scale, limit), expected)


def test_the_selection_equals_plain_farthest_first_on_many_poses() -> None:
    points = walk_of_poses(np.random.default_rng(3), 6000)
    expected = plain_selection(points, 0.01, 6000)
    assert len(expected) > 500
    np.testing.assert_array_equal(farthest_first(points, 0.01), expected)


@pytest.mark.parametrize(
    ("joints", "threshold", "limit", "error", "words"),
    [
        (np.zeros((0, 20, 3)), 0.018, None, DatabaseError, "no pose"),
        (np.zeros((5, 19, 3)), 0.018, None, DatabaseError, "expected"),
        (np.full((5, 20, 3), np.nan), 0.018, None, DatabaseError, "not finite"),
        (np.zeros((5, 20, 3)), -1.0, None, UsageError, "threshold"),
        (np.zeros((5, 20, 3)), float("nan"), None, UsageError, "threshold"),
        (np.zeros((5, 20, 3)), 0.018, 0, UsageError, "at least 1"),
    ],
)
def test_bad_input_is_named(
    joints: np.ndarray, threshold: float, limit: int | None, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        farthest_first(joints, threshold, limit)


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
    selected, thinned = filled(0.1, 40).select()
    joints = np.concatenate([one.joints for one in sources()])
    np.testing.assert_array_equal(selected.joints, joints[farthest_first(joints, 0.1, 40)])
    assert thinned == {}


@pytest.mark.parametrize("part", [50, 64, 600])
def test_each_row_has_its_origin(part: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling, "PART", part)
    made = filled(0.05, None)
    rows, given = made.select()[0], sources()
    assert made.poses_read == 2 * sum(SIZES) and made.names == [one.name for one in given]
    for pose, source, frame, mirrored in zip(rows.poses, rows.source, rows.frame, rows.mirrored, strict=True):
        np.testing.assert_array_equal(pose, given[source].poses[frame + mirrored * given[source].frames])


@pytest.mark.parametrize(("threshold", "most"), [(0.0, 30), (0.3, None), (0.3, 30)])
def test_thinned_parts_cover_all_poses_as_far_as_is_said(
    threshold: float, most: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sampling, "PART", 90)
    selected, thinned = filled(threshold, most).select()
    joints, chosen = np.concatenate([one.joints for one in sources()]), selected.joints
    nearest = np.array([pose_distance(chosen, one).min() for one in joints])
    last = pose_distance(chosen[:-1], chosen[-1]).min() if most else threshold
    assert nearest.max() <= thinned["cover"] + max(last, threshold) + 1e-6
    assert len(chosen) < thinned["poses"] < len(joints) and (most is None or len(chosen) <= most)


def test_a_part_keeps_as_many_poses_as_are_wanted_in_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling, "PART", 100)
    assert filled(0.0, 60).select()[1]["poses"] == 6 * 60
    assert filled(0.0, None).select()[1]["poses"] == 6 * 5
