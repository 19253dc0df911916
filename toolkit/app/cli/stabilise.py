"""The verb `depthmocap stabilise`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.groups import spread
from toolkit.io.errors import UsageError


@dataclass(frozen=True)
class InputPaths:
    """Options for moved files of the run."""

    recording: Annotated[Path | None, typer.Option(help="New location of the recording, if it was moved.")] = None
    database: Annotated[
        Path | None, typer.Option("--database", "-d", help="New location of the pose database, if it was moved.")
    ] = None


@spread
def stabilise(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Run folders of the hybrid tracker.", show_default=False)
    ],
    classes: Annotated[
        Path, typer.Option(help="Class file written by `depthmocap learn --templates`.", show_default=False)
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Run folder; several runs go to OUTPUT/<name>.", show_default=False)
    ],
    moved: InputPaths,
    rounds: Annotated[int, typer.Option(help="Maximum number of rounds.", min=1)] = 5,
    threshold: Annotated[
        float, typer.Option(help="Maximum cost of a template match: fraction of features that differ.")
    ] = 0.1,
    segments: Annotated[
        Path | None, typer.Option(help="CSV of labelled segments (start, end, label); replaces the annotation.")
    ] = None,
    marks: Annotated[
        Path | None,
        typer.Option(
            help="YAML of template entries that are enforced: `class: [{feature: 26, value: 0, columns: [3, 9]}]`."
        ),
    ] = None,
) -> None:
    """Reconstruct the motion of occluded limbs from the motion classes that are recognised in the track."""
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
