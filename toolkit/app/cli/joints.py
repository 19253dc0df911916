"""The verb `depthmocap joints`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.groups import spread
from toolkit.app.cli.options import given
from toolkit.app.cli.reading import Joints, Reading, SegmentOption, people_of
from toolkit.app.cli.terminal import print_lines
from toolkit.io.errors import UsageError


@spread
def joints(
    recording: Annotated[Path | None, typer.Argument(metavar="RECORDING", show_default=False)] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="What is written.", show_default=False)] = None,
    fetch: Annotated[bool, typer.Option("--fetch", help="Download the pose network; needs no RECORDING.")] = (False),
    wheel: Annotated[
        Path | None, typer.Option(help="With --fetch: wheel of the network that was downloaded elsewhere.")
    ] = None,
    joints: Joints = Joints(),
    people: Annotated[str, typer.Option(metavar="all|N", help="Maximum number of people with joints.")] = "1",
    segment: SegmentOption = None,
    reading: Reading = Reading(),
) -> None:
    """Detect the joints in the images of a recording once and store them with it as NPZ."""
    if fetch:
        from toolkit.people.image_joints.pose_model import fetch_pose_model

        print_lines(fetch_pose_model(wheel))
        return
    if recording is None or output is None:
        raise UsageError("name a RECORDING and the NPZ file with --output, or get the network with --fetch")
    from toolkit.app.cli.terminal import progress_bars
    from toolkit.app.pipeline.store_joints import store_joints
    from toolkit.recordings.opening import open_recording
    from toolkit.sensing.sensing_settings import SensingSettings

    choice = joints.choice()
    opened = open_recording(recording, **reading.options())
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
    print_lines(f"joints in {found} of {len(stored)} frames: {output}")
