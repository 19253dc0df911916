"""Options of several verbs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from toolkit.io.errors import UsageError

MOST_FRAMES = 1_000_000_000
"""Maximum frame number (one year at 30 Hz)."""

Run = Annotated[
    Path, typer.Argument(metavar="RUN", help="Run folder written by `depthmocap track`.", show_default=False)
]
Output = Annotated[Path, typer.Option("--output", "-o", help="What is written.", show_default=False)]
MovedRecording = Annotated[Path | None, typer.Option(help="New location of the recording, if it was moved.")]
FirstFrame = Annotated[int, typer.Option("--from", help="First frame.", max=MOST_FRAMES)]
Seed = Annotated[int, typer.Option(help="Random seed.", min=0)]
SettingOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Setting by its dotted name, for example sensing.segment=person."),
]
LabelTable = Annotated[Path | None, typer.Option(help="CSV file with the columns clip, label and optionally person.")]
Motions = Annotated[
    list[Path],
    typer.Argument(
        metavar="MOTION...", help="BVH, AMC and AMASS files, run folders, or folders of clips.", show_default=False
    ),
]


def numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """Return `count` numbers separated by commas.

    Raises
    ------
    UsageError
        The text has another number of values, or a value is no number.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise UsageError(f"{option} is {text!r}; give {count} numbers separated by commas")
    return values


def given(**options: Any) -> dict[str, Any]:
    """Return the options that were given, which are those that are not None."""
    return {name: value for name, value in options.items() if value is not None}
