"""`depthmocap info`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.options import given
from toolkit.cli.track import HELP, READING, reading_of


def info(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", show_default=False)],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Picture of the people found.", show_default="NAME_info.png"),
    ] = None,
    segment: Annotated[str | None, typer.Option(help=HELP["segment"], show_default="auto")] = None,
    format_: Annotated[str | None, typer.Option("--format", help=HELP["format"], rich_help_panel=READING)] = None,
    intrinsics: Annotated[str | None, typer.Option(help=HELP["intrinsics"], rich_help_panel=READING)] = None,
    mirrored: Annotated[
        bool | None, typer.Option("--mirrored/--not-mirrored", help=HELP["mirrored"], rich_help_panel=READING)
    ] = None,
    radial: Annotated[bool | None, typer.Option("--radial", help=HELP["radial"], rich_help_panel=READING)] = None,
    depth_unit: Annotated[str | None, typer.Option(help=HELP["unit"], rich_help_panel=READING)] = None,
    size: Annotated[str | None, typer.Option(help=HELP["size"], rich_help_panel=READING)] = None,
    frame_rate: Annotated[float | None, typer.Option(help=HELP["rate"], rich_help_panel=READING)] = None,
    up: Annotated[str | None, typer.Option(help=HELP["up"], rich_help_panel=READING)] = None,
    background: Annotated[str | None, typer.Option(help=HELP["background"], rich_help_panel=READING)] = None,
    axes: Annotated[str | None, typer.Option(help=HELP["axes"], rich_help_panel=READING)] = None,
    rotate: Annotated[int | None, typer.Option(help=HELP["rotate"], rich_help_panel=READING)] = None,
    depth_track: Annotated[str | None, typer.Option("--track", help=HELP["track"], rich_help_panel=READING)] = None,
) -> None:
    """Look at the first seconds of a recording: camera, up, room, people, and which option would help."""
    from toolkit.files import check_output
    from toolkit.rendering.look import save_picture
    from toolkit.sensing.opening import open_recording
    from toolkit.sensing.people.describe import describe
    from toolkit.sensing.settings import SensingSettings

    target = check_output(output or Path(f"{recording.stem}_info.png"), [recording], sealed=[recording])
    opened = open_recording(
        recording,
        **reading_of(
            format=format_,
            intrinsics=intrinsics,
            mirrored=mirrored,
            radial=radial,
            depth_unit=depth_unit,
            size=size,
            frame_rate=frame_rate,
            up=up,
            background=background,
            axes=axes,
            rotate=rotate,
            track=depth_track,
        ),
    )
    look = describe(opened, SensingSettings(**given(segment=segment)))
    save_picture(look, target)
    print("\n".join(look.lines))
    print(f"picture: {target} (frame {look.frame})")
