"""`depthmocap simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.options import Output


def simulate(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A BVH or AMC file.", show_default=False)],
    output: Output,
    body: Annotated[str, typer.Option(help="Name of a body, or shape coefficients such as 1.0,-0.5.")] = "neutral",
    sensor: Annotated[str, typer.Option(help="tof (176x144) or kinect (320x240).")] = "tof",
    distance: Annotated[float, typer.Option(help="Metres from the camera to the subject.")] = 3.0,
    height: Annotated[float, typer.Option(help="Metres of the camera above the floor.")] = 1.0,
    tilt: Annotated[
        float | None, typer.Option(help="Degrees downwards.", show_default="aims at the middle of the body")
    ] = None,
    yaw: Annotated[float, typer.Option(help="Degrees by which the subject is turned to its left.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Seed of the sensor's noise.")] = 0,
    frame_rate: Annotated[float, typer.Option(help="Frames per second.")] = 30.0,
    furnished: Annotated[
        bool, typer.Option("--furnished/--empty", help="Show a room and hold its background, or the subject only.")
    ] = True,
    subject_seed: Annotated[
        int | None, typer.Option(help="Seed of what makes the subject unlike every body of the shape space.")
    ] = None,
) -> None:
    """Simulate a depth recording with exact truth from a motion, a body and a camera."""
    from toolkit.cli.terminal import progress_bars
    from toolkit.simulation.simulate import simulate_recording

    with progress_bars() as bars:
        recording = simulate_recording(
            clip,
            output,
            body=body,
            sensor=sensor,
            distance=distance,
            height=height,
            tilt=tilt,
            yaw=yaw,
            seed=seed,
            frame_rate=frame_rate,
            furnished=furnished,
            subject_seed=subject_seed,
            progress=lambda done, total: bars("simulating", done, total),
        )
    size = f"{recording.camera.width}x{recording.camera.height}"
    print(f"{output}: {len(recording)} frames of {size} pixels")
