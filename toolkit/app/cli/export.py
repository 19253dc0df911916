"""The verb `depthmocap export`."""

from __future__ import annotations

from typing import Annotated

import typer

from toolkit.app.cli.options import MovedRecording, Output, Run
from toolkit.app.cli.terminal import print_lines


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
