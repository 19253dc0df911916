"""What the thin verbs hand on: the words of a command as arguments of the function that does the work."""

from __future__ import annotations

import os
import webbrowser
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from database_builder import build as builder
from tests.run_helpers import run, write_run
from toolkit.app.cli import report as report_verb
from toolkit.app.pipeline import store_joints
from toolkit.app.stabilise import workflow
from toolkit.body import skeleton
from toolkit.evaluation import evaluate
from toolkit.output.export import run as export
from toolkit.output.rendering import film
from toolkit.output.report import page
from toolkit.output.report.content import LONGEST
from toolkit.recordings import opening


@pytest.fixture
def handed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[dict[str, Any]]]:
    """Puts a recorder in the place of a function of a module; what it was called with, call by call."""

    def watch(module: Any, name: str, result: Any) -> list[dict[str, Any]]:
        calls: list[dict[str, Any]] = []

        def called(*arguments: Any, **named: Any) -> Any:
            calls.append({"arguments": arguments, **named})
            return result

        monkeypatch.setattr(module, name, called)
        return calls

    return watch


def test_render_takes_a_stretch_panels_and_a_rate(handed: Any) -> None:
    calls = handed(film, "render_run", Path("film.mp4"))
    assert run("render", "take", "-o", "film.mp4", "--from", 3, "--to", 9, "--panels", "depth,plan", "--rate", 12) == 0
    assert run("render", "take", "-o", "film.mp4") == 0
    told, plain = calls
    assert told["arguments"] == (Path("take"), Path("film.mp4")) and told["frames"] == slice(3, 9)
    assert told["settings"].panels == ("depth", "plan") and told["rate"] == 12.0
    assert plain["frames"] is None and plain["settings"] is None and plain["axes"] is None


def test_a_calibration_is_nothing_without_sensors(handed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    calls = handed(film, "render_run", Path("film.mp4"))
    assert run("render", "take", "-o", "film.mp4", "--calibration", "c.json") == 2
    assert not calls and "name them with --inertial" in capsys.readouterr().err


def test_a_report_begins_where_it_is_told_and_is_never_longer_than_a_page_takes(handed: Any) -> None:
    calls = handed(page, "write_report", Path("a.html"))
    for more in ([], ["--from", 40], ["--from", 40, "--to", 50]):
        assert run("report", "one", "two", "-o", "a.html", "--reference", "truth.npz", *more) == 0
    assert [call["frames"] for call in calls] == [None, range(40, 40 + LONGEST), range(40, 50)]
    assert calls[0]["arguments"] == ([Path("one"), Path("two")], Path("a.html"))
    assert calls[0]["references"] == [Path("truth.npz")]


@pytest.mark.parametrize(("age", "written"), [(None, True), (-10.0, True), (10.0, False)])
def test_a_page_is_shown_as_it_is_unless_the_track_is_newer(
    tmp_path: Path, handed: Any, monkeypatch: pytest.MonkeyPatch, age: float | None, written: bool
) -> None:
    folder = write_run(tmp_path / "run", np.zeros((2, skeleton.POSE_SIZE)))
    if age is not None:
        (folder / "report.html").write_text("")
        time = (folder / "track.npz").stat().st_mtime + age
        os.utime(folder / "report.html", (time, time))
    shown: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: shown.append(address) or True)
    calls = handed(page, "write_report", folder / "report.html")
    report_verb.view(folder)
    assert bool(calls) == written and shown == [(folder / "report.html").resolve().as_uri()]


def test_evaluate_keeps_its_references_and_says_how_figures_become_files(
    tmp_path: Path, handed: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = handed(evaluate, "evaluate_runs", evaluate.EvaluationTable([]))
    reference = tmp_path / "table.csv"
    reference.write_text("")
    assert run("evaluate", "run", "--reference", reference, "--output", tmp_path) == 2 and not calls
    assert run("evaluate", "run", "--reference", reference, "--no-surface") == 0
    assert calls[0]["surface"] is False and calls[0]["arguments"] == ([Path("run")], [reference])
    assert "--output FOLDER" in capsys.readouterr().err


def test_export_hands_on_what_the_file_shall_be(handed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    calls = handed(export, "export_run", (Path("a_person_01.trc"), Path("a_person_02.trc")))
    assert run("export", "run", "-o", "a.trc", "--origin", "camera", "--as-tracked") == 0
    assert calls[0]["origin"] == "camera" and calls[0]["as_tracked"] is True and calls[0]["format"] is None
    assert capsys.readouterr().out.splitlines() == ["a_person_01.trc", "a_person_02.trc"]


def test_a_database_is_built_as_it_is_typed(handed: Any) -> None:
    calls = handed(builder, "build_database", SimpleNamespace(text=lambda: "built"))
    assert run("database", "build", "-o", "p.npz") == 0
    assert run("database", "build", "mocap", "--max-poses", 7, "--no-mirror", "--no-seated", "--no-parts") == 0
    plain, told = calls
    assert plain["arguments"][:2] == (None, Path("p.npz")) and plain["parts"] is not None
    assert plain["arguments"][2] == builder.Sampling(builder.THRESHOLD, None, True, True)
    assert told["arguments"][0] == [Path("mocap")] and told["parts"] is None
    assert told["arguments"][2] == builder.Sampling(builder.THRESHOLD, 7, False, False)


def test_a_scan_has_as_many_angles_as_views(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("body", "scan", "front.npz", "back.npz", "-o", tmp_path / "me.npz", "--yaw", "0,90,180") == 2
    assert "give 2 numbers" in capsys.readouterr().err
    assert run("body", "scan", tmp_path / "front.npz", "-o", tmp_path / "front.npz") == 2


def test_joints_are_counted_in_the_frames_that_hold_any(
    tmp_path: Path, handed: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Stored(list[int]):
        """Numbers of joints by frame."""

        def joints_2d(self, i: int) -> tuple[str, ...]:
            return ("joints",) * self[i]

    monkeypatch.setattr(opening, "open_recording", lambda path, **options: options)
    calls = handed(store_joints, "store_joints", Stored([0, 1, 0, 2, 0]))
    assert run("joints", "take.npz", "-o", "out.npz", "--people", "all", "--intrinsics", "1,2,3,4") == 0
    assert calls[0]["people"] is None and calls[0]["arguments"][0] == {"intrinsics": (1.0, 2.0, 3.0, 4.0)}
    assert "joints in 2 of 5 frames: out.npz" in capsys.readouterr().out


def test_labels_of_one_run_are_not_those_of_several(handed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    calls = handed(workflow, "stabilise_run", [])
    words = ("stabilise", "one", "two", "--classes", "c.npz", "-o", "out")
    for more in (("--segments", "s.csv"), ("--recording", "take.npz")):
        assert run(*words, *more) == 2 and not calls
        assert "belong to one run" in capsys.readouterr().err
