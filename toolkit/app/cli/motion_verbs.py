"""The verbs that recognise motions: `depthmocap annotate` and `stabilise`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import Motions, MovedRecording
from toolkit.app.cli.terminal import print_table, progress_bars
from toolkit.io.errors import UsageError


def annotate(
    motions: Motions,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the reports.", show_default=False)],
    classes: Annotated[
        Path, typer.Option(help="Motion model or template classes written by `depthmocap learn`.", show_default=False)
    ],
    queries: Annotated[
        Path | None, typer.Option(help="Keyframe queries written by `depthmocap learn`; restrict the template search.")
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(help="True segments (CSV with start, end, label), or a folder with one file per motion."),
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(
            help="Maximum cost of a template match: fraction of features that differ.", show_default="its own, 0.13"
        ),
    ] = None,
    as_published: Annotated[
        bool, typer.Option("--as-published", help="Use the decision rules of the thesis with a maximum cost of 0.13.")
    ] = False,
) -> None:
    """Segment and label motions: CSV, a picture and a page for each."""
    from rich.table import Table

    from toolkit.retrieval.keyframes.query import load_queries
    from toolkit.retrieval.workflow.annotate import annotate_motions, load_wanted

    with progress_bars() as bars:
        done = annotate_motions(
            motions, load_wanted(classes), output, queries=load_queries(queries) if queries else (), truth=truth,
            threshold=threshold, as_published=as_published, progress=bars,
        )  # fmt: skip
    table = Table("motion", "segments", "F frames", "F segments", "report")
    for file in done:
        scores = [f"{file.scores[name].f:.2f}" if file.scores else "" for name in ("frames", "segments")]
        table.add_row(file.annotation.name, str(len(file.annotation.segments)), *scores, str(file.folder))
    print_table(table)


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
