"""`depthmocap render`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.options import Run


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
    recording: Annotated[Path | None, typer.Option(help="Where the recording has been moved to.")] = None,
    rate: Annotated[float | None, typer.Option(help="Frames per second.", show_default="the recording's")] = None,
    start: Annotated[int, typer.Option("--from", help="First frame.")] = 0,
    end: Annotated[int | None, typer.Option("--to", help="Frame after the last.", show_default="all")] = None,
) -> None:
    """Draw a track beside its depth: mesh, skeleton and extrema, from the camera and from the side."""
    from toolkit.cli.terminal import progress_bars
    from toolkit.rendering.film import render_run
    from toolkit.track import Track

    frames = None if (start, end) == (0, None) else range(start, len(Track.load(run)) if end is None else end)
    with progress_bars() as bars:
        written = render_run(
            run,
            output,
            recording=recording,
            frames=frames,
            rate=rate,
            progress=lambda done, total: bars("drawing", done, total),
        )
    print(written)
