import json
import os
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest

from tests.fake_tracker import write_recording
from toolkit.body import skeleton
from toolkit.io.errors import OutputError, RecordingError, TrackError, UsageError
from toolkit.io.files import sha256_of
from toolkit.tracks import EMPTY, TRACKED, FrameResult, RunInfo, Track, TrackWriter
from toolkit.tracks import track_writer as writer

STAGES, SOURCES = ("clean", "fit"), ("local", "database")


def result(i: int) -> FrameResult:
    rng = np.random.default_rng(i)
    return FrameResult(
        pose=rng.normal(size=skeleton.POSE_SIZE),
        joints=rng.normal(size=(20, 3)).astype(np.float32),
        confidence=rng.random(20).astype(np.float32),
        state=EMPTY if i == 2 else TRACKED,
        source=i % 2,
        stage_ms=np.array([1.0, i], dtype=np.float32),
        observed=rng.random(20) < 0.5,
    )


def info() -> RunInfo:
    turn = np.diag([1.0, -1.0, -1.0]).ravel().tolist()
    shape, sensing = [0.5, 1.0], {"median": True}
    mark = skeleton.fingerprint()
    return RunInfo("/r.npz", "ab", {"mirrored": True}, mark, shape, 1.1, "db.npz", turn, sensing, "0.1.0")


def test_a_track_read_back_equals_the_rows_that_were_appended(tmp_path: Path) -> None:
    writer = TrackWriter(tmp_path, STAGES, SOURCES)
    for i in range(5):
        writer.append(result(i), i / 30)
    writer.finish()
    track = Track.load(tmp_path)
    assert len(track) == 5
    assert track.stage_names == STAGES and track.source_names == SOURCES and track.joint_names == skeleton.REPORTED
    for i in range(5):
        for name in ("pose", "joints", "confidence", "state", "source", "stage_ms", "observed"):
            np.testing.assert_array_equal(getattr(track, name)[i], getattr(result(i), name))
    np.testing.assert_array_equal(track.timestamps, np.arange(5) / 30)
    assert track.joints.dtype == np.float32 and track.pose.dtype == np.float64 and track.state.dtype == np.uint8
    assert [p.name for p in tmp_path.iterdir()] == ["track.npz"]


def test_a_torn_last_record_is_dropped_on_resume(tmp_path: Path) -> None:
    writer = TrackWriter(tmp_path, STAGES, SOURCES)
    for i in range(3):
        writer.append(result(i), i)
    writer.abandon()
    partial = tmp_path / "track.partial"
    os.truncate(partial, partial.stat().st_size - 7)
    writer = TrackWriter(tmp_path, STAGES, SOURCES, resume=True)
    assert writer.rows == 2
    writer.append(result(9), 2)
    writer.finish()
    np.testing.assert_array_equal(Track.load(tmp_path).joints[2], result(9).joints)


def test_an_unfinished_track_is_not_overwritten_unless_asked(tmp_path: Path) -> None:
    writer = TrackWriter(tmp_path, STAGES, SOURCES)
    writer.append(result(0), 0)
    writer.abandon()
    with pytest.raises(UsageError, match="unfinished track of 1 frames"):
        TrackWriter(tmp_path, STAGES, SOURCES)
    with pytest.raises(TrackError, match="another tracker"):
        TrackWriter(tmp_path, ("other",), SOURCES, resume=True)


def test_an_interrupted_track_can_be_read_and_still_be_resumed(tmp_path: Path) -> None:
    writer = TrackWriter(tmp_path, STAGES, SOURCES)
    writer.append(result(0), 0)
    writer.finish(complete=False)
    assert len(Track.load(tmp_path)) == 1
    writer = TrackWriter(tmp_path, STAGES, SOURCES, resume=True)
    writer.append(result(1), 1)
    writer.finish()
    assert len(Track.load(tmp_path)) == 2


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> BinaryIO:
        return open("/dev/full", "w+b", buffering=0)

    monkeypatch.setattr(writer, "open_file", full)
    with pytest.raises(OutputError, match="No space left"):
        TrackWriter(tmp_path, STAGES, SOURCES)


def test_run_information_goes_there_and_back(tmp_path: Path) -> None:
    info().save(tmp_path)
    assert RunInfo.load(tmp_path) == info()
    np.testing.assert_array_equal(RunInfo.load(tmp_path).R_level_camera, np.diag([1, -1, -1]))
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(TrackError, match="lacks recording"):
        RunInfo.load(tmp_path)


def test_a_row_is_appended_to_what_is_there_which_stays_as_it_is(tmp_path: Path) -> None:
    writer = TrackWriter(tmp_path, STAGES, SOURCES)
    written = [(tmp_path / "track.partial").read_bytes()]
    for i in range(4):
        writer.append(result(i), i)
        written.append((tmp_path / "track.partial").read_bytes())
        assert written[-1].startswith(written[-2])
    assert len({len(after) - len(before) for before, after in pairwise(written[1:])}) == 1


def test_a_run_folder_that_is_moved_with_its_recording_finds_it_again_and_the_digest_decides(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    recording = write_recording(here / "take.npz")
    run = here / "runs" / "one"
    replace(info(), recording=str(recording), recording_sha256=sha256_of(recording), reader_options={}).save(run)
    assert RunInfo.load(run).open_recording().path == here / "runs" / "one" / ".." / ".." / "take.npz"
    here.rename(there)
    moved = RunInfo.load(there / "runs" / "one")
    assert len(moved.open_recording()) == 12
    (there / "take.npz").rename(tmp_path / "elsewhere.npz")
    with pytest.raises(RecordingError, match="is gone; .*--recording"):
        moved.open_recording()
    assert len(moved.open_recording(tmp_path / "elsewhere.npz")) == 12
    write_recording(there / "take.npz", frames=9)
    with pytest.raises(RecordingError, match="has changed"):
        moved.open_recording()
    here.mkdir()
    (tmp_path / "elsewhere.npz").rename(here / "take.npz")
    assert len(moved.open_recording()) == 12, "what lies beside the run is another one, what lay there before is right"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"recording": 3}, "recording is 3"),
        ({"scale": "tall"}, "scale is 'tall'; it must be a number"),
        ({"scale": -1.0}, "outside"),
        ({"scale": True}, "scale is True"),
        ({"shape": ["a"]}, "shape.0. is 'a'"),
        ({"shape": [1e9]}, "outside"),
        ({"level_rotation": [1.0, 0.0]}, "no rotation"),
        ({"level_rotation": [1.0, 0, 0, 0, 1, 0, 0, 1, 0]}, "no rotation"),
        ({"level_rotation": [1.0, 0, 0, 0, 1, 0, 0, 0, -1]}, "no rotation"),
        ({"body_fingerprint": "0123456789abcdef"}, "another body"),
        ({"version": "99.0"}, "version '99.0', this is .*; install"),
        ({"version": "soon"}, "version 'soon'"),
        ({"sensing": {"magic": 1}}, "unknown setting sensing.magic"),
        ({"reader_options": {"magic": 1}}, "unknown reader option"),
        ({"reader_options": []}, "reader_options is a list"),
    ],
)
def test_run_information_that_cannot_be_is_named(tmp_path: Path, changes: dict[str, object], words: str) -> None:
    info().save(tmp_path)
    values = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps({**values, **changes}))
    with pytest.raises(TrackError, match=words):
        RunInfo.load(tmp_path)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("pose_names", lambda a: a[::-1], "pose_names"),
        ("joint_names", lambda a: a[::-1], "joint_names"),
        ("state", lambda a: a + np.uint8(3), "outside 0 to 2"),
        ("source", lambda a: a + np.uint8(9), "outside"),
        ("confidence", lambda a: a + 2, "outside 0 to 1"),
        ("pose", lambda a: a.astype(str), "must be numbers"),
        ("pose", lambda a: np.full_like(a, np.nan), "not finite"),
        ("timestamps", lambda a: a[::-1].copy(), "run backwards"),
        ("stage_ms", lambda a: a[:1], "shape"),
    ],
)
def test_a_track_that_cannot_be_is_named(
    tmp_path: Path, name: str, change: Callable[[np.ndarray], np.ndarray], words: str
) -> None:
    writer = TrackWriter(tmp_path, ("clean", "fit"), ("local", "database"))
    for i in range(3):
        writer.append(result(i), 0.1 * i)
    writer.finish()
    with np.load(tmp_path / "track.npz") as stored:
        arrays = {key: stored[key] for key in stored.files if key != "checksum"}
    np.savez(tmp_path / "track.npz", **{**arrays, name: change(arrays[name])})
    with pytest.raises(TrackError, match=words):
        Track.load(tmp_path)
