"""`depthmocap evaluate`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import MovedRecording
from toolkit.app.cli.terminal import say


def evaluate(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Run folders, or folders of them.", show_default=False)
    ],
    references: Annotated[
        list[Path] | None,
        typer.Option(
            "--reference", "-r", help="File, or folder matched by stem; each run's own recording without. Repeatable."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder for table.csv, table.json, accuracy.png and error.png."),
    ] = None,
    surface: Annotated[
        bool,
        typer.Option(
            "--surface/--no-surface",
            help="Look at the depth of one person's frames, too: overlap, extrema.",
        ),
    ] = True,
    recording: MovedRecording = None,
) -> None:
    """Compare tracks with the truth or another skeleton, and fitted bodies with the depth: one table for all runs."""
    from toolkit.app.cli.terminal import print_table, progress_bars
    from toolkit.evaluation.evaluate import evaluate_runs
    from toolkit.evaluation.score_report import FILES, write_evaluation
    from toolkit.io.files import check_output

    if output is not None:
        for name in FILES:
            check_output(output / name, references or ())
    with progress_bars() as bars:
        table = evaluate_runs(
            runs,
            references,
            surface=surface,
            recording=recording,
            progress=lambda name, done, total: bars("evaluating", done, total),
        )
    print_table(table.to_rich())
    if output is None:
        say("every figure, as files and plots: --output FOLDER", file=sys.stderr)
        return
    for path in write_evaluation(table, output):
        say(path)
