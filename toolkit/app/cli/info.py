"""The verb `depthmocap info`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.groups import spread
from toolkit.app.cli.options import given
from toolkit.app.cli.reading import Reading, SegmentOption
from toolkit.app.cli.terminal import print_lines


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
    from toolkit.output.rendering.survey_picture import save_picture
    from toolkit.people.description import describe
    from toolkit.people.plausibility import HELP
    from toolkit.recordings.opening import open_upright
    from toolkit.sensing.sensing_settings import SensingSettings

    target = check_output(output or Path(f"{recording.stem}_info.png"), [recording], sealed=[recording])
    look = describe(open_upright(recording, **reading.options()), SensingSettings(**given(segment=segment)))
    save_picture(look, target)
    print_lines("\n".join(look.lines))
    for concern in look.concerns:
        print_lines(f"doubt: {concern.text}; {HELP}")
    print_lines(f"picture: {target} (frame {look.frame})")
