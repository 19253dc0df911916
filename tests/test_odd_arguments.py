"""Arguments and files of the wrong kind: accepted if the meaning is clear, else one sentence."""

import gc
import os
import subprocess
import sys
import threading
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import depthmocap
from tests.file_formats import FORMATS
from tests.run_helpers import write_run
from tests.sensing_scenes import KINECT, person_alone
from toolkit.body import skeleton
from toolkit.evaluation.evaluate import evaluate_tracks
from toolkit.io.errors import DepthMocapError, RecordingError, UsageError
from toolkit.io.files import save_text
from toolkit.io.yaml_reader import parse_yaml
from toolkit.recordings.opening import recording_of
from toolkit.tracks.runs import Person

NUMBERS = (KINECT.fx, KINECT.fy, KINECT.cx, KINECT.cy)
MATRIX = [[NUMBERS[0], 0, NUMBERS[2]], [0, NUMBERS[1], NUMBERS[3]], [0, 0, 1]]


@pytest.mark.parametrize(
    "intrinsics", [MATRIX, np.array(MATRIX), dict(zip(("fx", "fy", "cx", "cy"), NUMBERS, strict=True)), list(NUMBERS)]
)
def test_intrinsics_may_be_a_matrix_a_mapping_or_a_list(intrinsics: Any) -> None:
    recording = recording_of([person_alone(KINECT)] * 2, intrinsics=intrinsics, frame_rate="25")
    assert recording.camera == KINECT and recording.timestamps[1] == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("depth", "options", "says"),
    [
        ((frame for frame in [person_alone(KINECT)]), {}, "depth is a generator; give an array or a list"),
        ("take", {}, "depth is a str"),
        ([np.zeros((4, 5)), np.zeros((5, 4))], {}, "several sizes"),
        ([np.zeros((4, 5))], {"frame_rate": "fast"}, "--frame-rate is 'fast'; give frames a second"),
        ([np.zeros((4, 5))], {"intrinsics": {"fx": 1}}, "intrinsics have no fy, cx, cy"),
        ([np.zeros((4, 5))], {"intrinsics": np.eye(4)}, "give 4 numbers"),
    ],
)
def test_arguments_of_another_kind_are_named(depth: Any, options: dict[str, Any], says: str) -> None:
    with pytest.raises(DepthMocapError, match=says):
        recording_of(depth, **{"intrinsics": (5.0, 5.0, 2.0, 2.0), **options})


def test_a_truth_in_millimetres_is_refused() -> None:
    with pytest.raises(UsageError, match="the truth is 2900 m away in the median; give metres"):
        evaluate_tracks([], np.full((3, 20, 3), 2900.0))


def test_the_arrays_of_a_track_cannot_change_the_track(tmp_path: Path) -> None:
    write_run(tmp_path, np.zeros((3, skeleton.POSE_SIZE)))
    (track,) = depthmocap.Track.load(tmp_path)
    names = ("joints", "confidence", "observed", "state", "pose", "timestamps")
    before = {name: getattr(track, name).copy() for name in names}
    for name in names:
        with suppress(ValueError):  # read-only, or a copy
            getattr(track, name)[:] = before[name][::-1][:1]
        np.testing.assert_array_equal(getattr(track, name), before[name])


def test_an_export_without_a_file_is_named() -> None:
    track = depthmocap.Track(Person.__new__(Person))
    with pytest.raises(UsageError, match="path is None; give the name of a file"):
        track.export(None)  # type: ignore[arg-type]


def test_a_key_that_stands_twice_is_refused() -> None:
    assert parse_yaml("a: 1\nb: 2", "x.yaml", RecordingError, "mend it") == {"a": 1, "b": 2}
    with pytest.raises(RecordingError, match="the key 'a' stands twice"):
        parse_yaml("a: 1\nb: 2\na: 3", "x.yaml", RecordingError, "mend it")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the mask is read from the system there")
def test_the_mask_of_new_files_is_kept_and_never_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = os.umask(0o027)
    try:
        monkeypatch.setattr(os, "umask", lambda mask: pytest.fail("the mask of all threads was changed"))
        worker = threading.Thread(target=save_text, args=(tmp_path / "a.txt", "text"))
        worker.start()
        worker.join()
        assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o640
    finally:
        monkeypatch.undo()
        os.umask(before)


@pytest.mark.parametrize("threads", ["0", "-1"])
def test_a_number_of_threads_that_cannot_be_is_named(threads: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "depthmocap", "info", "take.npz"],
        env={**os.environ, "NUMBA_NUM_THREADS": threads}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == f"depthmocap: NUMBA_NUM_THREADS is '{threads}'; give a positive number, or leave it unset\n"


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_that_was_read_is_closed(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path, unraisable = FORMATS[name].make(tmp_path), list[Any]()
    gc.collect()  # of other tests
    monkeypatch.setattr(sys, "unraisablehook", unraisable.append)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ResourceWarning)
        FORMATS[name].read(path)
        gc.collect()
    assert [each.exc_value for each in unraisable] == []
