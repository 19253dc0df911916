"""What somebody meets who tries the program for the first time."""

from __future__ import annotations

import shlex
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.fake_tracker import write_recording
from tests.run_helpers import run
from tests.sensing_scenes import KINECT
from toolkit.app import pipeline
from toolkit.app.cli import terminal
from toolkit.app.pipeline import TrackerRecipe
from toolkit.database import default
from toolkit.people.description import largest_surface
from toolkit.people.sighting import Sighting


@pytest.fixture
def costly(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What costs time, in the order in which it was asked for."""
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


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An environment of Python in a folder with a space, the program in it, of which the shell knows nothing."""
    place = tmp_path / "my env" / "bin"
    place.mkdir(parents=True)
    name = "depthmocap.exe" if sys.platform == "win32" else "depthmocap"
    (place / name).write_text(f"#!{sys.executable}\nimport sys\nprint(sys.argv[1:])\n")
    (place / name).chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(place / "python"))
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    return place


@pytest.mark.skipif(sys.platform == "win32", reason="a POSIX shell takes the line")
@pytest.mark.parametrize("inside", [True, False])
def test_a_line_of_what_is_next_works_as_it_is_pasted(
    installed: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], inside: bool
) -> None:
    (installed / "elsewhere").mkdir()
    monkeypatch.chdir(installed.parents[1] if inside else installed / "elsewhere")
    terminal.next_commands({("report", "my run", "--output", "report.html"): "one page"})
    line = capsys.readouterr().err.splitlines()[1]
    done = subprocess.run(line, shell=True, capture_output=True, text=True, check=True)
    assert done.stdout == "['report', 'my run', '--output', 'report.html']\n"
    assert shlex.split(line)[0].startswith("my env" if inside else "/")


def test_the_program_has_its_name_where_the_shell_finds_it_and_its_module_where_there_is_no_script(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(installed))
    assert terminal.program() == ("depthmocap",)
    for script in installed.iterdir():
        script.unlink()
    assert terminal.program()[1:] == ("-m", "depthmocap")


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


def test_a_speck_says_neither_where_somebody_is_nor_that_the_image_cuts_them_off() -> None:
    from toolkit.people.description import person_text
    from toolkit.people.view import CoarseCamera
    from toolkit.sensing.sensing_settings import SensingSettings

    depth = np.zeros(KINECT.shape, dtype=np.float32)
    depth[40:200, 140:190] = 2.5
    depth[0:2, 0:12] = 3.0
    assert not largest_surface(depth)[:30].any() and largest_surface(depth)[40:200, 140:190].all()
    lens = CoarseCamera(KINECT, np.array([0.0, -1.0, 0.0]), SensingSettings())
    assert person_text(Sighting(1, depth, None, KINECT), lens) == "1 at 2.5 m, whole"


def test_smoothing_without_scipys_import_is_scipys() -> None:
    from scipy.ndimage import gaussian_filter1d

    from toolkit.motion.contact import smoothed

    for count in (2, 5, 70):
        values = np.random.default_rng(0).normal(size=(count, 2, 3))
        expected = gaussian_filter1d(values, 0.045 * 30, axis=0)
        np.testing.assert_allclose(smoothed(values, np.arange(count) / 30, 0.045), expected, atol=1e-12)


@pytest.mark.parametrize(("confidence", "says"), [(0.03, True), (0.5, False)])
def test_a_summary_says_where_the_tracker_is_hardly_sure(tmp_path: Path, confidence: float, says: bool) -> None:
    from toolkit.app.pipeline.run_summary import summarised
    from toolkit.tracks import EMPTY, TRACKED, Track

    count = 9
    track = Track(
        joints=np.zeros((count, 20, 3), np.float32), pose=np.zeros((count, 43)),
        confidence=np.full((count, 20), confidence, np.float32), state=np.array([TRACKED] * 3 + [EMPTY] * 6, np.uint8),
        source=np.zeros(count, np.uint8), timestamps=np.arange(count) / 30,
        stage_ms=np.array([[1, 9], [1, 0], [9, 1], *[[0, 0]] * 5, [2, 2]], np.float32), stage_names=("one", "two"),
        observed=np.ones((count, 20), dtype=bool), source_names=("local",),
    )  # fmt: skip
    text = summarised("take", tmp_path, [track], count, stature=1.744).text()
    assert f"confidence {confidence:.2f}, 1.74 m tall, 7.0 ms a frame (one 1.5, two 1.5)" in text
    assert ("hardly sure" in text and "depthmocap render" in text and "--intrinsics" in text) == says
