"""Database builder end to end: mocap in, one file out; bad mocap and bad outputs."""

import errno
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from database_builder import build
from database_builder.build_report import database_text
from database_builder.sampling import farthest_first, pose_distance
from tests.database_helpers import moving_clip, neutral, write_bvh
from toolkit.body import skeleton
from toolkit.database.canonical import canonicalise, mirrored
from toolkit.database.database import PoseDatabase
from toolkit.io import files
from toolkit.io.errors import MocapError, OutputError, PlausibilityWarning, UsageError
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SEATED_MOTIONS
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from training.subjects import is_seated

CLIPS = [moving_clip("a", 1), moving_clip("b", 2)]


def build_database(
    sources: Sequence[Path | PoseClip] | None, output: Path, *, threshold: float = build.SAMPLING_THRESHOLD,
    max_poses: int | None = None, mirror: bool = False, seated: bool = False, **options: Any,
) -> build.BuildReport:  # fmt: skip
    """Build without mirror images and seated people unless a test sets them."""
    sampling = build.Sampling(threshold, max_poses, mirror, seated)
    return build.build_database(sources, output, sampling, **options)


@pytest.fixture
def mocap(tmp_path: Path) -> Path:
    folder = tmp_path / "mocap"
    (folder / "deep").mkdir(parents=True)
    write_bvh(folder / "walk.bvh", 1)
    write_bvh(folder / "deep" / "jump.bvh", 2)
    return folder


def test_a_database_of_clips_holds_the_plain_selection_of_their_canonical_poses(tmp_path: Path) -> None:
    report = build_database(CLIPS, tmp_path / "poses.npz", threshold=0.02)
    read = PoseDatabase.load(tmp_path / "poses.npz")
    poses = canonicalise(np.concatenate([clip.poses for clip in CLIPS]))[0].astype(np.float32)
    joints = neutral().joint_positions(poses).astype(np.float32)
    chosen = farthest_first(joints, 0.02)
    assert 5 < len(chosen) < len(poses) == report.poses_read
    np.testing.assert_array_equal(read.poses, poses[chosen].astype(np.float16))
    np.testing.assert_allclose(read.joints, joints[chosen], atol=2e-3)
    np.testing.assert_array_equal(60 * read.pose_source + read.pose_frame, chosen)
    assert read.sources == ("a", "b") and not read.mirrored.any() and read.threshold == 0.02
    assert list(tmp_path.iterdir()) == [tmp_path / "poses.npz"]


def test_people_who_sit_are_added_to_any_mocap_unless_they_are_left_out(tmp_path: Path) -> None:
    with_seated, without = (
        build_database(CLIPS, tmp_path / "poses.npz", threshold=0.03, seated=seated).database
        for seated in (True, False)
    )
    assert set(without.sources) < set(with_seated.sources) and without.notes["seated"] is False
    assert {name.rstrip("_1234") for name in with_seated.sources} == {"a", "b", *SEATED_MOTIONS}
    assert is_seated(with_seated.poses, neutral()).sum() > 30 + 5 * is_seated(without.poses, neutral()).sum()


def test_files_are_read_in_sorted_order_and_named_with_their_hashes(mocap: Path, tmp_path: Path) -> None:
    report = build_database([mocap], tmp_path / "poses.npz", threshold=0.005)
    assert report.database.sources == ("deep/jump.bvh", "walk.bvh")
    assert all(len(digest) == 64 for digest in report.database.hashes)
    first = retarget(read_clip(mocap / "deep" / "jump.bvh"), neutral()).poses[0]
    np.testing.assert_array_equal(report.database.poses[0], canonicalise(first)[0].astype(np.float16))
    assert (report.database.pose_source[0], report.database.pose_frame[0]) == (0, 0)


def test_mirroring_adds_the_mirror_image_of_every_pose(tmp_path: Path) -> None:
    report = build_database(CLIPS, tmp_path / "poses.npz", threshold=0.015, mirror=True)
    database = report.database
    assert report.poses_read == 240 and 0 < database.mirrored.sum() < len(database)
    for row in np.flatnonzero(database.mirrored)[:5]:
        frame = CLIPS[database.pose_source[row]].poses[database.pose_frame[row]]
        np.testing.assert_allclose(database.poses[row], mirrored(canonicalise(frame)[0]), atol=1e-3)


def test_the_bundled_motions_are_the_source_when_none_is_given(bundled_database: Path) -> None:
    database = PoseDatabase.load(bundled_database)
    assert len(database) > 100 and len(database.sources) > 10


def test_a_maximum_count_stops_the_selection(tmp_path: Path) -> None:
    database = build_database(CLIPS, tmp_path / "poses.npz", threshold=0.0, max_poses=17).database
    assert len(database) == 17
    pairs = pose_distance(database.joints[:, None], database.joints[None])
    assert pairs[~np.eye(17, dtype=bool)].min() > 0


def test_the_result_does_not_depend_on_the_number_of_processes(
    mocap: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("database_builder.build.MANY_FILES", 1)
    monkeypatch.setattr("database_builder.build.MANY_POSES", 1)
    one = build_database([mocap], tmp_path / "one.npz", threshold=0.005, workers=1).database
    two = build_database([mocap], tmp_path / "two.npz", threshold=0.005, workers=2).database
    for name in ("poses", "joints", "features", "offsets", "pose_source", "pose_frame"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_a_bad_file_is_named_skipped_and_counted(mocap: Path, tmp_path: Path) -> None:
    (mocap / "broken.bvh").write_text("HIERARCHY\nROOT hips\n{")
    (mocap / "empty.amc").write_text("")
    report = build_database([mocap], tmp_path / "poses.npz")
    assert [name for name, _ in report.skipped] == ["broken.bvh", "empty.amc"]
    assert report.database.sources == ("deep/jump.bvh", "walk.bvh")
    assert "skipped broken.bvh" in report.text()
    assert report.text().splitlines()[-2].startswith("2 of 4 sources skipped")
    assert [name for name, _ in PoseDatabase.load(report.path).notes["skipped"]] == ["broken.bvh", "empty.amc"]


def test_doubts_about_sources_are_one_warning_from_any_process(
    mocap: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("database_builder.build.MANY_FILES", 1)
    for file in mocap.rglob("*.bvh"):
        head, rows = file.read_text().split("Frame Time:")
        first, *frames = rows.strip().splitlines()
        file.write_text("\n".join([f"{head}Frame Time: {first}", *[frames[0]] * len(frames)]) + "\n")
    for workers in (1, 2):
        with pytest.warns(PlausibilityWarning, match="other warnings about sources") as shown:
            build_database([mocap], tmp_path / f"{workers}.npz", workers=workers)
        assert len(shown) == 1


def test_a_full_disk_is_one_sentence(mocap: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    on_disk = files.flush_to_disk

    def full(path: Path, flags: int) -> None:
        """Leave no room for the database."""
        if path.name.startswith(".poses-"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        on_disk(path, flags)

    with monkeypatch.context() as disk:
        disk.setattr(files, "flush_to_disk", full)
        with pytest.raises(OutputError, match="poses.npz: No space left on device; free some space") as said:
            build_database([mocap], tmp_path / "poses.npz")
    assert "\n" not in str(said.value) and not (tmp_path / "poses.npz").exists()
    build_database([mocap], tmp_path / "poses.npz")


def test_an_empty_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "nothing").mkdir()
    with pytest.raises(MocapError, match="no motion file"):
        build_database([tmp_path / "nothing"], tmp_path / "poses.npz")
    with pytest.raises(MocapError, match="check the path"):
        build_database([tmp_path / "missing"], tmp_path / "poses.npz")
    with pytest.raises(UsageError, match="no source"):
        build_database([], tmp_path / "poses.npz")


def test_an_output_that_cannot_be_written_is_an_error_before_work_starts(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write"):
        build_database(CLIPS, tmp_path / "file" / "poses.npz")
    for name in ("poses.json", "poses"):
        with pytest.raises(UsageError, match=r"one \.npz file"):
            build_database(CLIPS, tmp_path / name)


def test_the_report_says_what_the_database_covers(tmp_path: Path) -> None:
    database = build_database(CLIPS, tmp_path / "poses.npz").database
    text = database_text(database)
    for words in (f"poses      {len(database)}", "9.00 mm", "40 mm root mean square", "left_hand", "  a"):
        assert words in text


@pytest.mark.data("cmu-mocap", "hdm05")
def test_real_mocap_becomes_a_database_with_plausible_people(data_folder: Path, tmp_path: Path) -> None:
    folder = data_folder / "mocap"
    files = [
        folder / "cmu" / "02_01.bvh",
        folder / "cmu" / "49_02.bvh",
        folder / "hdm05" / "HDM_bd_depositFloorR_001_120.amc",
    ]
    database = build_database(files, tmp_path / "poses.npz", threshold=0.01, strict=True).database
    assert set(database.pose_source) == {0, 1, 2} and len(database) > 50
    low, high = skeleton.POSE_LIMITS.T
    assert (database.poses >= low - 1e-4).all() and (database.poses <= high + 1e-4).all()
    names = skeleton.REPORTED.index
    lateral = database.joints[:, names("left_shoulder"), 0] - database.joints[:, names("right_shoulder"), 0]
    assert (lateral > 0.1).mean() > 0.95


def test_a_database_does_not_replace_its_source(tmp_path: Path) -> None:
    write_bvh(tmp_path / "clip.npz", seed=0)
    with pytest.raises(UsageError, match="would be overwritten"):
        build_database([tmp_path / "clip.npz"], tmp_path / "clip.npz")
