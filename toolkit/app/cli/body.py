"""The verb `depthmocap body`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import Output, given, numbers
from toolkit.app.cli.reading import SegmentOption
from toolkit.app.cli.terminal import print_lines

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
