"""The verb `depthmocap render`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import MOST_FRAMES, FirstFrame, MovedRecording, Run
from toolkit.app.cli.terminal import print_lines


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
    from toolkit.app.cli.terminal import progress_bars
    from toolkit.output.rendering.film import render_run, settings_for

    settings = replace(settings_for(output), engine=engine)
    if panels is not None:
        settings = replace(settings, panels=tuple(panels.split(",")))
    frames = None if (start, end) == (0, None) else slice(start, end)
    with progress_bars() as bars:
        written = render_run(
            run,
            output,
            recording=recording,
            settings=settings,
            frames=frames,
            rate=rate,
            progress=lambda done, total: bars("drawing", done, total),
        )
    print_lines(written)
