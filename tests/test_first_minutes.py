"""Messages of a first use of the program."""

import time
from pathlib import Path

import pytest

from tests.fake_tracker import write_recording
from tests.run_helpers import run
from tests.sensing_scenes import KINECT, scene
from toolkit.app import pipeline
from toolkit.app.cli import terminal
from toolkit.app.pipeline import TrackerRecipe
from toolkit.database import default
from toolkit.recordings.writer import save_recording
from toolkit.trackers.hybrid.tracker import HybridTracker


@pytest.fixture
def costly(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Record the costly calls in their order."""
    asked: list[str] = []

    def poses() -> str:
        asked.append("poses")
        return "poses.npz"

    def build(*arguments: object, **named: object) -> None:
        asked.append("tracker")
        raise SystemExit(7)

    monkeypatch.setattr(default, "default_database_path", poses)
    monkeypatch.setattr(TrackerRecipe, "build", build)
    monkeypatch.setattr(pipeline, "track_recordings", build)
    return asked


@pytest.mark.parametrize("more", [[], ["--workers", "2"]])
@pytest.mark.parametrize(("content", "says"), [(None, "there is no recording"), (b"nothing", "bad.npz")])
def test_a_recording_is_opened_before_anything_costs_time(
    tmp_path: Path,
    costly: list[str],
    capsys: pytest.CaptureFixture[str],
    content: bytes | None,
    says: str,
    more: list[str],
) -> None:
    bad = tmp_path / "bad.npz"
    if content is not None:
        bad.write_bytes(content)
    assert run("track", bad, "--output", tmp_path / "run", *more) == 1
    assert not costly and says in capsys.readouterr().err
    assert run("track", bad, tmp_path / "worse.npz", "--output", tmp_path / "runs", *more) == 1
    assert not costly and "none of the 2 recordings can be read" in capsys.readouterr().err


def test_one_of_several_that_cannot_be_read_is_named_before_the_others_are_tracked(
    tmp_path: Path, costly: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    good = write_recording(tmp_path / "good.npz")
    assert run("track", good, tmp_path / "bad.npz", "--output", tmp_path / "runs") == 7
    assert "bad.npz" in capsys.readouterr().err and costly == ["poses", "tracker"]


def test_a_log_gets_a_line_a_minute_and_nothing_of_what_takes_less(capsys: pytest.CaptureFixture[str]) -> None:
    with terminal.progress_bars() as bars:
        bars("building", 1, 3)
    assert capsys.readouterr().err == ""
    lines = terminal.LogLines(every=0.05)
    lines("building", 1, 3)
    time.sleep(0.2)
    lines.close()
    said = capsys.readouterr().err.splitlines()
    assert said and all(line.startswith("building: 1 of 3 after ") for line in said)


def test_two_people_are_refused_before_anyone_is_tracked_with_the_commands_to_type(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    frame, _ = scene(KINECT, ((-0.5, 2.4), (0.5, 3.4)))
    recording = tmp_path / "two.npz"
    save_recording(recording, depth=[frame] * 3, camera=KINECT, timestamps=[0.0, 0.1, 0.2], up_camera=(0, -1, 0))

    def tracked(*arguments: object, **named: object) -> None:
        raise AssertionError("the people are counted first")

    for name in ("follower", "learner"):
        monkeypatch.setattr(HybridTracker, name, tracked)
    assert run("track", recording, "--output", tmp_path / "run", "--online") == 1
    said = capsys.readouterr().err
    typed = f"depthmocap track {recording} --output {tmp_path / 'run'} --online"
    assert "2 people are in view" in said
    assert f"{typed} --people all" in said and f"{typed} --subject largest" in said
