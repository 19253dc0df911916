"""Options that several verbs share."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from toolkit.io.errors import UsageError

MOST_FRAMES = 1_000_000_000
"""What the number of a frame may be: a year at 30 a second."""

Run = Annotated[
    Path, typer.Argument(metavar="RUN", help="Run folder that `depthmocap track` wrote.", show_default=False)
]
Output = Annotated[Path, typer.Option("--output", "-o", help="What is written.", show_default=False)]
MovedRecording = Annotated[Path | None, typer.Option(help="Where the recording has been moved to.")]
FirstFrame = Annotated[int, typer.Option("--from", help="First frame.", max=MOST_FRAMES)]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0)]
SettingOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="A setting by its dotted name, such as sensing.segment=person."),
]
Pattern = Annotated[
    str | None,
    typer.Option(help="Regular expression for clip names: groups (?P<label>...), perhaps (?P<person>...)."),
]
LabelTable = Annotated[Path | None, typer.Option(help="CSV file with the columns clip, label, perhaps person.")]
Motions = Annotated[
    list[Path],
    typer.Argument(
        metavar="MOTION...", help="BVH, AMC and AMASS files, run folders, folders of clips.", show_default=False
    ),
]


def numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """`count` numbers separated by commas.

    Raises
    ------
    UsageError
        There are more, fewer, or something else.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise UsageError(f"{option} is {text!r}; give {count} numbers separated by commas")
    return values


def given(**options: Any) -> dict[str, Any]:
    """The options that were given: those that are not None."""
    return {name: value for name, value in options.items() if value is not None}
