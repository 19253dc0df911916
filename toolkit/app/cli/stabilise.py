"""`depthmocap stabilise`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.groups import spread
from toolkit.io.errors import UsageError


@dataclass(frozen=True)
class InputPaths:
    """Where files of the run are now, as it is typed."""

    recording: Annotated[Path | None, typer.Option(help="Where the recording has been moved to.")] = None
    database: Annotated[
        Path | None, typer.Option("--database", "-d", help="Where the pose database has been moved to.")
    ] = None


@spread
def stabilise(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Run folders of the hybrid tracker.", show_default=False)
    ],
    classes: Annotated[Path, typer.Option(help="Class file of `depthmocap learn --templates`.", show_default=False)],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Run folder; several runs go to OUTPUT/<name>.", show_default=False)
    ],
    moved: InputPaths,
    rounds: Annotated[int, typer.Option(help="Most rounds of the loop.", min=1)] = 5,
    threshold: Annotated[float, typer.Option(help="Largest cost of a template: share of features that differ.")] = 0.1,
    segments: Annotated[
        Path | None, typer.Option(help="CSV of labelled stretches (start, end, label), instead of annotating.")
    ] = None,
    marks: Annotated[
        Path | None,
        typer.Option(
            help="YAML of entries of templates that hold: `class: [{feature: 26, value: 0, columns: [3, 9]}]`."
        ),
    ] = None,
) -> None:
    """Fill in what limbs did while they were hidden, by the motions that are recognised in the track itself."""
    from rich.table import Table

    from toolkit.app.cli.terminal import print_table, progress_bars
    from toolkit.app.stabilise.loop import StabiliseSettings
    from toolkit.app.stabilise.workflow import output_folders, stabilise_run

    if (segments is not None or moved.recording is not None) and len(runs) > 1:
        raise UsageError("--segments and --recording belong to one run; name one")
    settings = StabiliseSettings(rounds, threshold)
    table = Table("run", "rounds", "labels", "gaps", "filled", "moved mm", "result")
    with progress_bars() as bars:
        for run, folder in output_folders(runs, output).items():
            done = stabilise_run(
                run, classes, folder, settings=settings, segments=segments, marks=marks,
                recording=moved.recording, database=moved.database, progress=bars,
            )  # fmt: skip
            gaps = [gap for found in done for gap in found.gaps]
            table.add_row(
                run.name, str(len(done)), str(len(done[-1].segments)), str(len(gaps)),
                str(sum(gap.accepted for gap in gaps)), f"{1000 * sum(found.moved for found in done):.1f}", str(folder),
            )  # fmt: skip
    print_table(table)
