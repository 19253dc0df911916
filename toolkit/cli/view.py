"""`depthmocap view`."""

from __future__ import annotations

from typing import Annotated

import typer

from toolkit.cli.options import Run


def view(
    run: Run,
    again: Annotated[bool, typer.Option("--again", help="Write the page anew, even if it is there.")] = False,
) -> None:
    """Open the report of a run in the browser; the page is written into the run folder first if it is not there."""
    import webbrowser

    from toolkit.cli.terminal import progress_bars, say
    from toolkit.report.page import write_report
    from toolkit.runs import person_runs
    from toolkit.track import TRACK_FILE

    page = run / "report.html"
    tracks = [folder / TRACK_FILE for folder in person_runs(run)]
    older = page.exists() and any(t.exists() and t.stat().st_mtime > page.stat().st_mtime for t in tracks)
    if again or older or not page.exists():
        with progress_bars() as bars:
            write_report([run], page, progress=bars)
    say(page)
    if not webbrowser.open(page.resolve().as_uri()):
        say("no browser could be opened; open the page yourself")
