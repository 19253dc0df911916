import logging
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.fake_tracker import FakeFollower, FakeTracker, write_recording
from toolkit.app.pipeline import track_recording
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.io.errors import OutputError, RecordingError, TrackError, UsageError
from toolkit.io.files import sha256_of
from toolkit.people.sighting import Sighting
from toolkit.recordings.opening import open_recording
from toolkit.tracking.clock import StageClock
from toolkit.tracks import FrameResult, RunInfo, Track

ROOT = Path(__file__).parents[1]


def child(recording: Path, run: Path, resume: str = "fresh") -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tests.fake_tracker", str(recording), str(run), resume]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT)


def read_until(process: subprocess.Popen[str], line: str) -> None:
    assert process.stdout is not None
    for read in process.stdout:
        if read.strip() == line:
            return
    raise AssertionError(f"{line!r} was never printed: {process.stderr.read() if process.stderr else ''}")


def whole(recording: Path, run: Path) -> Track:
    track_recording(open_recording(recording), FakeTracker(), run)
    return Track.load(run)


def test_a_run_folder_holds_one_row_per_frame_and_what_made_it(tmp_path: Path) -> None:
    recording, run = write_recording(tmp_path / "take.npz"), tmp_path / "run"
    seen: list[tuple[str, int, int]] = []
    summary = track_recording(
        open_recording(recording), FakeTracker(), run, progress=lambda name, *what: seen.append(what)
    )
    assert len(Track.load(run)) == summary.frames == 12 and not summary.interrupted
    assert summary.stage_ms == {"prepare": 1.0, "fit": 2.0}
    assert sorted(p.name for p in run.iterdir()) == ["config.yaml", "log.txt", "run.json", "track.npz"]
    info = RunInfo.load(run)
    assert info.recording == str(recording) and info.recording_sha256 == sha256_of(recording)
    assert info.shape == [0.5] and info.scale == 13.0  # as fitted at the end
    assert "weight: 0.5" in (run / "config.yaml").read_text() and "12 of 12 frames" in (run / "log.txt").read_text()
    assert seen[-1] == ("tracking", 12, 12)


def test_a_killed_run_is_resumed_to_the_same_track(tmp_path: Path) -> None:
    recording, run = write_recording(tmp_path / "take.npz", frames=120), tmp_path / "run"
    process = child(recording, run)
    read_until(process, "tracking 80")
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    assert not (run / "track.npz").exists()
    with pytest.raises(TrackError, match="--resume"):
        Track.load(run)
    process = child(recording, run, "resume")
    output, error = process.communicate(timeout=60)
    assert output.splitlines()[-1].startswith("complete"), error
    first = next(int(line.split()[1]) for line in output.splitlines() if line.startswith("tracking"))
    assert 0 < first <= 81  # it did not start again
    expected = whole(recording, tmp_path / "whole")
    np.testing.assert_array_equal(Track.load(run).pose, expected.pose)
    np.testing.assert_array_equal(Track.load(run).timestamps, expected.timestamps)
    assert not list(run.glob("*partial")) and not list(run.glob("state*"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_puts_the_track_so_far_in_place_and_resume_completes_it(tmp_path: Path, number: int) -> None:
    recording, run = write_recording(tmp_path / "take.npz", frames=40), tmp_path / "run"
    process = child(recording, run)
    read_until(process, "tracking 10")
    os.kill(process.pid, number)
    output, error = process.communicate(timeout=60)
    assert output.splitlines()[-1] == "interrupted", error
    rows = len(Track.load(run))
    assert 10 <= rows < 40
    tracker = FakeTracker()
    assert track_recording(open_recording(recording), tracker, run, resume=True).frames == 40
    assert tracker.steps == 40 - rows  # what was found is not found again
    np.testing.assert_array_equal(Track.load(run).pose, whole(recording, tmp_path / "whole").pose)


def test_an_unfinished_run_is_neither_overwritten_nor_continued_with_something_else(tmp_path: Path) -> None:
    recording, run = write_recording(tmp_path / "take.npz"), tmp_path / "run"
    with pytest.raises(RecordingError, match="frame 5"):
        track_recording(open_recording(recording), FakeTracker(broken=5), run)
    partial = (run / "track.partial").read_bytes()
    with pytest.raises(UsageError, match="unfinished track of 5 frames"):
        track_recording(open_recording(recording), FakeTracker(), run)
    with pytest.raises(TrackError, match="other settings"):
        track_recording(open_recording(recording), FakeTracker(weight=0.4), run, resume=True)
    other = write_recording(tmp_path / "other.npz", frames=13)
    with pytest.raises(TrackError, match="another recording"):
        track_recording(open_recording(other), FakeTracker(), run, resume=True)
    elsewhere = FakeTracker()
    elsewhere.database = str(tmp_path / "two.npz")
    with pytest.raises(TrackError, match="another recording, database"):
        track_recording(open_recording(recording), elsewhere, run, resume=True)
    assert (run / "track.partial").read_bytes() == partial
    assert track_recording(open_recording(recording), FakeTracker(), run, resume=True).frames == 12


def test_a_finished_run_is_left_alone_by_resume_and_replaced_without(tmp_path: Path) -> None:
    recording, run, tracker = open_recording(write_recording(tmp_path / "take.npz")), tmp_path / "run", FakeTracker()
    track_recording(recording, tracker, run)
    steps = tracker.steps
    assert track_recording(recording, tracker, run, resume=True).frames == 12
    assert tracker.steps == steps
    track_recording(recording, tracker, run)
    assert tracker.steps > steps


def test_what_the_toolkit_logs_during_a_run_goes_to_its_log(tmp_path: Path) -> None:
    recording, run = write_recording(tmp_path / "take.npz"), tmp_path / "run"

    class Talking(FakeFollower):
        def step(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> FrameResult:
            logging.getLogger("toolkit.tracking").warning("lost at %.1f s", timestamp)
            return super().step(sighting, timestamp, clock)

    tracker = FakeTracker()
    tracker.follower = lambda camera, rotation, body=None: Talking(tracker, body)  # type: ignore[method-assign]
    track_recording(open_recording(recording), tracker, run)
    assert "WARNING lost at 0.1 s" in (run / "log.txt").read_text()


def test_a_run_folder_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    recording, run = write_recording(tmp_path / "take.npz"), tmp_path / "run"
    process = child(recording, run)
    try:
        read_until(process, "tracking 3")
        with pytest.raises(OutputError, match=f"is being written by process {process.pid} "):
            track_recording(open_recording(recording), FakeTracker(), run, resume=True)
    finally:
        process.kill()
        process.wait()
    assert track_recording(open_recording(recording), FakeTracker(), run, resume=True).frames == 12
    assert not (run / ".lock").exists()


@pytest.mark.parametrize("place", ["same", "inside", "around"])
def test_a_run_folder_is_kept_apart_from_its_recording(tmp_path: Path, place: str) -> None:
    recording = write_recording(tmp_path / "takes" / "take.npz")
    run = {"same": recording, "inside": recording / "run", "around": tmp_path / "takes"}[place]
    before = recording.read_bytes()
    with pytest.raises(UsageError, match="choose"):
        track_recording(open_recording(recording), FakeTracker(), run)
    assert recording.read_bytes() == before and [p.name for p in (tmp_path / "takes").iterdir()] == ["take.npz"]


def test_the_settings_that_a_run_was_made_from_are_not_replaced(tmp_path: Path) -> None:
    recording = write_recording(tmp_path / "take.npz")
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "config.yaml").write_text("# mine")
    with pytest.raises(UsageError, match="would be overwritten"):
        track_recording(
            open_recording(recording),
            FakeTracker(),
            tmp_path / "own",
            made_of=TrackerRecipe(tmp_path / "own" / "config.yaml"),
        )
    assert (tmp_path / "own" / "config.yaml").read_text() == "# mine"
