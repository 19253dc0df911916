"""`depthmocap joints`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.options import Output, given
from toolkit.cli.track import HELP, JointsOption, JointsSizeOption, joint_choice, people_of, reading_of


def joints(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", show_default=False)],
    output: Output,
    joints: JointsOption = None,
    joints_size: JointsSizeOption = None,
    people: Annotated[str, typer.Option(metavar="all|N", help="Whose joints are looked for.")] = "1",
    segment: Annotated[str | None, typer.Option(help=HELP["segment"], show_default="auto")] = None,
    format_: Annotated[str | None, typer.Option("--format", help=HELP["format"])] = None,
    intrinsics: Annotated[str | None, typer.Option(help=HELP["intrinsics"])] = None,
    mirrored: Annotated[bool | None, typer.Option("--mirrored/--not-mirrored", help=HELP["mirrored"])] = None,
    depth_unit: Annotated[str | None, typer.Option(help=HELP["unit"])] = None,
    frame_rate: Annotated[float | None, typer.Option(help=HELP["rate"])] = None,
    up: Annotated[str | None, typer.Option(help=HELP["up"])] = None,
    rotate: Annotated[int | None, typer.Option(help=HELP["rotate"])] = None,
) -> None:
    """Find the joints in the images of a recording once, and store them with it as NPZ."""
    from toolkit.cli.terminal import progress_bars
    from toolkit.pipeline.store_joints import store_joints
    from toolkit.sensing.opening import open_recording
    from toolkit.sensing.settings import SensingSettings

    choice = joint_choice(joints, joints_size)
    opened = open_recording(
        recording,
        **reading_of(
            format=format_,
            intrinsics=intrinsics,
            mirrored=mirrored,
            depth_unit=depth_unit,
            size=None,
            frame_rate=frame_rate,
            up=up,
            rotate=rotate,
        ),
    )
    with progress_bars() as bars:
        stored = store_joints(
            opened,
            output,
            choice,
            people=people_of(people),
            sensing=SensingSettings(**given(segment=segment)),
            progress=lambda done, total: bars("joints", done, total),
        )
    found = sum(bool(stored.joints_2d(i)) for i in range(len(stored)))
    print(f"joints in {found} of {len(stored)} frames: {output}")
