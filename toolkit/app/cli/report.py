"""The verbs `depthmocap report` and `depthmocap view`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import MOST_FRAMES, FirstFrame, MovedRecording, Run
from toolkit.app.cli.terminal import print_lines


def report(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN...", help="Run folders, or folders that contain run folders.", show_default=False),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="The page.")] = Path("report.html"),
    references: Annotated[
        list[Path] | None,
        typer.Option("--reference", "-r", help="Reference of the errors; default: the recording of each run."),
    ] = None,
    recording: MovedRecording = None,
    start: FirstFrame = 0,
    end: Annotated[
        int | None,
        typer.Option("--to", help="First frame that is not shown.", max=MOST_FRAMES, show_default="3000 at most"),
    ] = None,
) -> None:
    """Write one offline page: film, 3-D view, errors, confidence, times and settings."""
    from toolkit.app.cli.terminal import progress_bars
    from toolkit.output.report.content import LONGEST
    from toolkit.output.report.page import write_report

    chosen = None if (start, end) == (0, None) else range(start, start + LONGEST if end is None else end)
    with progress_bars() as bars:
        page = write_report(
            runs, output, recording=recording, references=references or (), frames=chosen, progress=bars
        )
    print_lines(page)


def view(
    run: Run,
    browser: Annotated[bool, typer.Option("--browser", help="Open the run's report in the browser instead.")] = False,
    recording: MovedRecording = None,
) -> None:
    """Open a window on a run: measured points, bodies, skeletons and floor on a timeline."""
    if browser:
        _view_page(run, recording)
        return
    from toolkit.output.rendering.open3d_window import view_run

    view_run(run, recording)


def _view_page(run: Path, recording: Path | None) -> None:
    """Open the report of a run in the browser. Writes the page into the run folder if it is older than the track."""
    import webbrowser

    from toolkit.app.cli.terminal import progress_bars
    from toolkit.output.report.page import write_report
    from toolkit.tracks import TRACK_FILE
    from toolkit.tracks.runs import person_runs

    page = run / "report.html"
    tracks = [folder / TRACK_FILE for folder in person_runs(run)]
    older = page.exists() and any(t.exists() and t.stat().st_mtime > page.stat().st_mtime for t in tracks)
    if older or not page.exists():
        with progress_bars() as bars:
            write_report([run], page, recording=recording, progress=bars)
    print_lines(page)
    if not webbrowser.open(page.resolve().as_uri()):
        print_lines("no browser could be opened; open the page yourself")
