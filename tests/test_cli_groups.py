"""A dataclass in a verb's signature is a group of options on the command line."""

from dataclasses import dataclass
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from toolkit.app.cli.groups import spread


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
