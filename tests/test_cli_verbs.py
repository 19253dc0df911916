"""Arguments that the thin verbs pass to the function that does the work."""

import os
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.run_helpers import run, write_run
from toolkit.app.cli import report as report_verb
from toolkit.body import skeleton
from toolkit.output.rendering import film
from toolkit.output.report import page


@pytest.fixture
def handed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[dict[str, Any]]]:
    """Replace a function of a module by a recorder; return its calls."""

    def watch(module: Any, name: str, result: Any) -> list[dict[str, Any]]:
        calls: list[dict[str, Any]] = []

        def called(*arguments: Any, **named: Any) -> Any:
            calls.append({"arguments": arguments, **named})
            return result

        monkeypatch.setattr(module, name, called)
        return calls

    return watch


def test_a_calibration_is_nothing_without_sensors(handed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    calls = handed(film, "render_run", Path("film.mp4"))
    assert run("render", "take", "-o", "film.mp4", "--calibration", "c.json") == 2
    assert not calls and "name them with --inertial" in capsys.readouterr().err


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
    report_verb.view(folder, browser=True)
    assert bool(calls) == written and shown == [(folder / "report.html").resolve().as_uri()]
