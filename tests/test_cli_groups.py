"""Options of a verb from a dataclass, and arguments that verbs pass on."""

import os
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from tests.run_helpers import write_run
from toolkit.app.cli import run_verbs as report_verb
from toolkit.app.cli.options import spread
from toolkit.body import skeleton
from toolkit.output.report import page


@dataclass(frozen=True)
class Where:
    distance: Annotated[float, typer.Option(help="Metres.", min=0.0)] = 3.0
    near: Annotated[bool, typer.Option("--near/--far")] = False


@dataclass(frozen=True)
class Who:
    name: Annotated[str, typer.Option("--name", "-n")]
    who: Annotated[list[str] | None, typer.Option()] = None


seen: list[tuple[object, ...]] = []


@spread
def look(
    place: Annotated[str, typer.Argument()], who: Who, seed: Annotated[int, typer.Option()] = 1, where: Where = Where()
) -> None:
    """Process a person."""
    seen.append((place, who, seed, where))


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        (["home", "-n", "Ann"], ("home", Who("Ann", None), 1, Where())),
        (
            ["home", "--name", "Ann", "--who", "a", "--who", "b", "--seed", "4", "--distance", "2", "--near"],
            ("home", Who("Ann", ["a", "b"]), 4, Where(2.0, True)),
        ),
    ],
)
def test_fields_are_options_and_the_verb_gets_the_group(typed: list[str], expected: tuple[object, ...]) -> None:
    app = typer.Typer()
    app.command()(look)
    seen.clear()
    result = CliRunner().invoke(app, typed)
    assert result.exit_code == 0, result.output
    assert seen == [expected]


@pytest.mark.parametrize("typed", [["home"], ["home", "-n", "Ann", "--distance", "-1"], ["home", "-n", "Ann", "--up"]])
def test_what_a_field_forbids_is_wrong_use(typed: list[str]) -> None:
    app = typer.Typer()
    app.command()(look)
    assert CliRunner().invoke(app, typed).exit_code == 2


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
