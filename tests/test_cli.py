import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from tests.fake_tracker import FakeFollower, FakeTracker, write_recording
from tests.run_helpers import run
from toolkit.app.cli.main import EXAMPLES, app
from toolkit.app.pipeline import TrackerRecipe
from toolkit.people.sighting import Sighting
from toolkit.tracking.clock import StageClock
from toolkit.tracks import FrameResult, Track

VERBS = "demo database simulate joints track evaluate render report index search learn annotate export bench".split()


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeTracker:
    """Replace the hybrid tracker by a fake; its arguments are in `asked`."""
    tracker = FakeTracker()
    tracker.asked = None  # type: ignore[attr-defined]

    def made(recipe: TrackerRecipe, guide: object = None) -> FakeTracker:
        tracker.asked = recipe  # type: ignore[attr-defined]
        return tracker

    monkeypatch.setattr(TrackerRecipe, "build", made)
    return tracker


ALL_HELP = """
import contextlib, io, sys
from toolkit.app.cli.main import EXAMPLES, main
for words in ([], *(verb.split() for verb in EXAMPLES)):
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(sys.stdout if not words else io.StringIO()):
        main([*words, '--help'])
print([m for m in ('numpy', 'scipy', 'numba', 'open3d', 'cv2', 'sklearn', 'matplotlib') if m in sys.modules])
"""


def test_help_names_every_verb_and_loads_nothing_that_takes_long() -> None:
    answer = subprocess.run([sys.executable, "-c", ALL_HELP], capture_output=True, text=True, check=True)
    assert all(f" {verb} " in answer.stdout for verb in VERBS)
    assert answer.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    "arguments",
    [
        ["fly"],
        ["track"],
        ["track", "a.npz", "--database", "d.npz"],
        ["track", "a.npz", "--database", "d.npz", "--output", "o", "--no-such-option"],
        ["track", "a.npz", "--database", "d.npz", "--output", "o", "--set", "nothing"],
        ["track", "a.npz", "--database", "d.npz", "--output", "o", "--set", "sensing.nothing=1"],
        ["track", "a.npz", "--database", "d.npz", "--output", "o", "--config", "no_such_settings"],
        ["track", "a.npz", "--database", "d.npz", "--output", "o", "--up", "1,2"],
        ["track", "a.npz", "--database", "d.npz", "--output", "o", "--size", "wide"],
        ["track", "a.npz", "--database", "d.npz", "--output", "o", "--size", "nan,3"],
        ["simulate", "a.bvh", "--output", "o.npz", "--seed", "-1"],
        ["simulate", "a.bvh", "--output", "o.npz", "--frame-rate", "1e9"],
        ["simulate", "a.bvh", "--output", "o.npz", "--height", "high"],
        ["simulate", "a.bvh", "--output", "o.npz", "--cut", "0.45", "--tilt", "5"],
        ["bench", "no_such_benchmark"],
        ["evaluate"],
        ["export", "run"],
    ],
)
def test_wrong_use_is_exit_code_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*arguments) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_track_writes_a_run_and_prints_its_path(
    tmp_path: Path, fake: FakeTracker, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = write_recording(tmp_path / "take.npz")
    main_arguments = ["track", recording, "--database", "d.npz", "--output", tmp_path / "run"]
    assert run(*main_arguments, "--set", "extrema=10", "--segment", "person") == 0
    assert "12 frames" in capsys.readouterr().out
    assert len(Track.load(tmp_path / "run")) == 12
    asked = TrackerRecipe("hybrid", {"sensing.segment": "person", "extrema": 10}, Path("d.npz"))
    assert fake.asked == asked  # type: ignore[attr-defined]


def test_ctrl_c_is_exit_code_1_and_names_the_command_that_resumes(
    tmp_path: Path, fake: FakeTracker, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, output = write_recording(tmp_path / "take.npz"), tmp_path / "run"
    step = FakeFollower.step

    def interrupted(self: FakeFollower, sighting: Sighting, timestamp: float, clock: StageClock) -> FrameResult:
        if timestamp == 7 / 30:
            os.kill(os.getpid(), signal.SIGINT)
        return step(self, sighting, timestamp, clock)

    monkeypatch.setattr(FakeFollower, "step", interrupted)
    command = ["track", recording, "--database", "d", "--output", output]
    assert run(*command) == 1
    assert "8 of 12 frames" in (said := capsys.readouterr().out) and "--resume" in said
    monkeypatch.setattr(FakeFollower, "step", step)
    assert run(*command) == 2  # an unfinished track is not overwritten
    assert run(*command, "--resume") == 0 and len(Track.load(output)) == 12


def test_evaluate_prints_one_table_and_writes_files(
    tmp_path: Path, fake: FakeTracker, capsys: pytest.CaptureFixture[str]
) -> None:
    recordings = [write_recording(tmp_path / f"{name}.npz") for name in ("one", "two")]
    assert run("track", *recordings, "--database", "d", "--output", tmp_path / "runs") == 0
    capsys.readouterr()
    assert run("evaluate", tmp_path / "runs", "--no-surface", "--output", tmp_path / "eval") == 0
    printed = capsys.readouterr().out
    assert "one" in printed and "mean of 2" in printed
    assert sorted(p.name for p in (tmp_path / "eval").iterdir()) == ["table.csv", "table.json"]


def commands() -> Iterator[tuple[str, Any]]:
    """Return each command with its verb, those of groups as `group command`."""
    root = typer.main.get_command(app)
    for name, command in root.commands.items():  # type: ignore[attr-defined]
        if hasattr(command, "commands"):
            yield from ((f"{name} {below}", found) for below, found in command.commands.items())
        else:
            yield name, command


def test_every_help_screen_ends_with_examples_that_can_be_typed() -> None:
    known = dict(commands())
    assert {verb.split()[0] for verb in EXAMPLES} >= set(VERBS)
    for verb, lines in EXAMPLES.items():
        command = known[verb]
        for line in lines:
            assert line in (command.epilog or "")
            words = shlex.split(line)
            start = 1 + len(verb.split())
            assert words[:start] == ["depthmocap", *verb.split()]
            command.make_context(verb, words[start:])  # raises for an unknown option or argument


def test_a_finished_run_is_replaced_only_with_overwrite(
    tmp_path: Path, fake: FakeTracker, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = write_recording(tmp_path / "take.npz")
    command = ["track", recording, "--database", "d", "--output", tmp_path / "run"]
    assert run(*command) == 0
    assert f"depthmocap report {tmp_path / 'run'}" in capsys.readouterr().err
    before = (tmp_path / "run" / "track.npz").stat().st_mtime_ns
    assert run(*command) == 2
    assert "add --overwrite" in capsys.readouterr().err
    assert (tmp_path / "run" / "track.npz").stat().st_mtime_ns == before
    assert run(*command, "--overwrite") == 0
