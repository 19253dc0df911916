"""`depthmocap stabilise`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import MovedRecording
from toolkit.io.errors import UsageError


def stabilise(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Run folders of the hybrid tracker.", show_default=False)
    ],
    classes: Annotated[Path, typer.Option(help="Class file of `depthmocap learn --templates`.", show_default=False)],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Run folder; several runs go to OUTPUT/<name>.", show_default=False)
    ],
    threshold: Annotated[float, typer.Option(help="Largest cost of a template: fraction of differing features.")] = 0.1,
    segments: Annotated[
        Path | None, typer.Option(help="CSV of labelled stretches (start, end, label), instead of annotating.")
    ] = None,
    recording: MovedRecording = None,
    database: Annotated[
        Path | None, typer.Option("--database", "-d", help="New location of the pose database, if it was moved.")
    ] = None,
) -> None:
    """Fill in occluded limbs of a finished track by the motions that are recognised in it."""
    from rich.table import Table

    from toolkit.app.cli.terminal import print_table, progress_bars
    from toolkit.app.stabilise.workflow import output_folders, stabilise_run

    if (segments is not None or recording is not None) and len(runs) > 1:
        raise UsageError("--segments and --recording belong to one run; name one")
    table = Table("run", "labels", "gaps", "filled", "moved mm", "result")
    with progress_bars() as bars:
        for run, folder in output_folders(runs, output).items():
            done = stabilise_run(
                run, classes, folder, threshold=threshold, segments=segments,
                recording=recording, database=database, progress=bars,
            )  # fmt: skip
            table.add_row(
                run.name, str(len(done.segments)), str(len(done.gaps)),
                str(sum(gap.accepted for gap in done.gaps)), f"{1000 * done.moved:.1f}", str(folder),
            )  # fmt: skip
    print_table(table)
