"""`depthmocap view`."""

from __future__ import annotations

from toolkit.cli.options import Run


def view(run: Run) -> None:
    """Open the report of a run in the browser; the page is written into the run folder first, unless it is newer."""
    import webbrowser

    from toolkit.cli.terminal import progress_bars, say
    from toolkit.report.page import write_report
    from toolkit.runs import person_runs
    from toolkit.track import TRACK_FILE

    page = run / "report.html"
    tracks = [folder / TRACK_FILE for folder in person_runs(run)]
    older = page.exists() and any(t.exists() and t.stat().st_mtime > page.stat().st_mtime for t in tracks)
    if older or not page.exists():
        with progress_bars() as bars:
            write_report([run], page, progress=bars)
    say(page)
    if not webbrowser.open(page.resolve().as_uri()):
        say("no browser could be opened; open the page yourself")
