"""The verb `depthmocap annotate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import Motions


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

    from toolkit.app.cli.terminal import print_table, progress_bars
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
