"""The verbs that show a run: `depthmocap render`, `report`, `view` and `export`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import MOST_FRAMES, FirstFrame, MovedRecording, Output, Run
from toolkit.app.cli.terminal import print_lines, progress_bars


def render(
    run: Run,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            help="Film (.mp4, .webm or .avi), contact sheet (.png) or folder of pictures.",
            show_default=False,
        ),
    ],
    recording: MovedRecording = None,
    rate: Annotated[float | None, typer.Option(help="Frames per second.", show_default="the recording's")] = None,
    start: FirstFrame = 0,
    end: Annotated[
        int | None, typer.Option("--to", help="First frame that is not drawn.", max=MOST_FRAMES, show_default="all")
    ] = None,
    panels: Annotated[
        str | None,
        typer.Option(help="Panels separated by commas: depth, body, side, plan.", show_default="depth,body,side"),
    ] = None,
    engine: Annotated[
        str, typer.Option(help="toolkit, or open3d: bodies on white paper with soft shadows, for publications.")
    ] = "toolkit",
) -> None:
    """Draw a track beside its depth: mesh, skeleton and extrema in camera, side and plan views."""
    from toolkit.output.rendering.film import render_run, settings_for

    settings = replace(settings_for(output), engine=engine)
    if panels is not None:
        settings = replace(settings, panels=tuple(panels.split(",")))
    frames = None if (start, end) == (0, None) else slice(start, end)
    with progress_bars() as bars:
        written = render_run(
            run, output, recording=recording, settings=settings, frames=frames, rate=rate,
            progress=partial(bars, "drawing"),
        )  # fmt: skip
    print_lines(written)


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


def export(
    run: Run,
    output: Output,
    rig: Annotated[
        str | None,
        typer.Option(help="Joint names of .glb and .bvh: mixamo, cmu or classic.", show_default="the body's own"),
    ] = None,
    format: Annotated[
        str | None,
        typer.Option(
            help="k4abt (.json of the Azure Kinect SDK), amass (.npz), angles (.csv), gait (.json), body-index "
            "(folder: the person in each pixel), opensim (folder: scaled model, markers, angles).",
            show_default="by the suffix",
        ),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(
            help="floor (y up, ground at 0, origin below the person's first position) or camera.",
            show_default="floor; camera for the .json formats",
        ),
    ] = None,
    model: Annotated[
        str | None, typer.Option("--model", help="Model of OpenSim (.osim) that --format opensim scales to the person.")
    ] = None,
    unit: Annotated[str | None, typer.Option("--unit", help="Length unit of .bvh: cm or m.", show_default="cm")] = None,
    as_tracked: Annotated[
        bool,
        typer.Option(
            "--as-tracked",
            help="With origin floor: keep the jitter of motionless bodies and the sliding of feet in contact.",
        ),
    ] = False,
    recording: MovedRecording = None,
) -> None:
    """Write a track in a format of another program, chosen by the suffix of OUTPUT.

    .glb skinned and animated (Blender, Unity, browsers), .bvh (animation tools), .c3d (motion laboratories), .trc
    (OpenSim), .mot (OpenSim, with markers), .csv and .json. A format for one person gets one file per person.
    """
    from toolkit.output.export.run import export_run

    written = export_run(
        run, output, rig=rig, format=format, origin=origin, recording=recording, as_tracked=as_tracked, model=model,
        unit=unit,
    )  # fmt: skip
    for path in written:
        print_lines(path)
