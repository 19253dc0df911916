"""`depthmocap annotate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.options import Output


def annotate(
    motions: Annotated[
        list[Path],
        typer.Argument(
            metavar="MOTION...", help="BVH and AMC files, run folders, folders of clips.", show_default=False
        ),
    ],
    output: Output,
    classes: Annotated[
        Path | None, typer.Option(help="Class file that an earlier call wrote, instead of examples.")
    ] = None,
    examples: Annotated[
        list[Path] | None,
        typer.Option(
            help="Cut clips to learn the classes from; a clip's class is its folder unless told otherwise. Repeatable."
        ),
    ] = None,
    pattern: Annotated[
        str | None, typer.Option(help="Regular expression for names of examples with a group (?P<label>...).")
    ] = None,
    labels: Annotated[Path | None, typer.Option(help="CSV file with the columns clip and label.")] = None,
    queries: Annotated[
        Path | None, typer.Option(help="Keyframe queries that `depthmocap learn` wrote, to narrow the search down.")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(help="True segments (CSV: start, end, label), or a folder with one file per motion.")
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(help="Largest cost: mean share of features that differ.", show_default="the classes' own, 0.13"),
    ] = None,
) -> None:
    """Cut motions into segments and label them: CSV, JSON, a picture and a page for each."""
    from rich.table import Table

    from toolkit.cli.terminal import print_table, progress_bars
    from toolkit.errors import UsageError
    from toolkit.retrieval.annotation.classes import load_classes, save_classes
    from toolkit.retrieval.keyframes.query_file import load_queries
    from toolkit.retrieval.workflow.annotate import annotate_motions, classes_from_clips
    from toolkit.retrieval.workflow.motions import find_motions, labels_of

    if (classes is None) == (examples is None):
        raise UsageError("annotate needs one of --classes and --examples; give exactly one")
    with progress_bars() as bars:
        if classes is not None:
            wanted = load_classes(classes)
        else:
            clips = labels_of(find_motions(examples or []), pattern, labels)
            wanted = classes_from_clips(clips, progress=bars)
            save_classes(output / "classes.npz", wanted)
        done = annotate_motions(
            motions, wanted, output, queries=load_queries(queries) if queries else (), truth=truth,
            threshold=threshold, progress=bars,
        )  # fmt: skip
    table = Table("motion", "segments", "F frames", "F segments", "report")
    for file in done:
        scores = [f"{file.scores[name].f:.2f}" if file.scores else "" for name in ("frames", "segments")]
        table.add_row(file.annotation.name, str(len(file.annotation.segments)), *scores, str(file.folder))
    print_table(table)
