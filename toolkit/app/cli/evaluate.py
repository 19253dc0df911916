"""The verb `depthmocap evaluate`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import MovedRecording
from toolkit.app.cli.terminal import print_lines, print_rows, print_table, progress_bars


def evaluate(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN...", help="Run folders, or folders that contain run folders.", show_default=False),
    ],
    references: Annotated[
        list[Path] | None,
        typer.Option(
            "--reference",
            "-r",
            help="Truth, skeleton or marker file (.trc, .c3d, .csv, .bvh, .mot), or folder matched by stem; default: "
            "each run's own recording. Repeatable.",
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
            help="Also compare the fitted body with the depth of single-person runs: overlap, extrema.",
        ),
    ] = True,
    recording: MovedRecording = None,
    markers: Annotated[
        str | None,
        typer.Option(
            "--markers", help="Marker set of a marker file: a name, or a YAML file with the format of configs/markers."
        ),
    ] = None,
    lag: Annotated[
        float | None,
        typer.Option(
            "--lag",
            help="Seconds to add to the clock of a marker file to get the clock of the track; default: estimated.",
        ),
    ] = None,
) -> None:
    """Compare tracks with true joints or another skeleton, and fitted bodies with the depth, in one table."""
    from toolkit.evaluation.evaluate import evaluate_runs
    from toolkit.evaluation.marker_files import is_marker_file
    from toolkit.evaluation.scores import FILES, write_evaluation
    from toolkit.io.files import check_output

    if references and any(map(is_marker_file, references)):
        _validate(runs, references, output, markers, lag)
        return
    if output is not None:
        for name in FILES:
            check_output(output / name, references or ())
    with progress_bars() as bars:
        table = evaluate_runs(
            runs, references, surface=surface, recording=recording,
            progress=lambda name, done, total: bars("evaluating", done, total),
        )  # fmt: skip
    print_table(table.to_rich())
    if output is None:
        print_lines("all figures as files and plots: --output FOLDER", file=sys.stderr)
        return
    for path in write_evaluation(table, output):
        print_lines(path)


def _validate(
    runs: list[Path], references: list[Path], output: Path | None, markers: str | None, lag: float | None
) -> None:
    """Compare one run with one marker file."""
    from toolkit.evaluation.marker_validation import validate
    from toolkit.io.errors import UsageError
    from toolkit.io.files import check_output
    from toolkit.output.report import validation as page
    from toolkit.tracks.runs import load_persons

    if len(runs) != 1 or len(references) != 1:
        raise UsageError(f"{len(runs)} runs and {len(references)} marker files; give one run and one marker file")
    if output is not None:
        for name in page.FILES:
            check_output(output / name, references)
    found = validate(load_persons(runs[0]), references[0], marker_set=markers, lag=lag)
    for line in page.summary(found):
        print_lines(line)
    for head, rows in ((page.JOINT_HEAD, page.joint_rows(found)), (page.ANGLE_HEAD, page.angle_rows(found))):
        if rows:
            print_rows(head, rows)
    if output is None:
        print_lines("page with curves: --output FOLDER", file=sys.stderr)
        return
    for path in page.write_validation(found, output):
        print_lines(path)
