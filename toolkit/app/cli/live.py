"""`depthmocap live`."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.groups import spread
from toolkit.app.cli.reading import Reading, people_of
from toolkit.app.cli.terminal import say
from toolkit.app.cli.track import Tracking


@spread
def live(
    source: Annotated[str, typer.Argument(metavar="realsense|file:RECORDING", show_default=False)],
    tracking: Tracking,
    people: Annotated[
        str, typer.Option(metavar="all|N", help="Track several people; 1 is the largest one in a room.")
    ] = "1",
    record: Annotated[
        Path | None, typer.Option(help="Write each frame that comes into this .npz recording.", show_default=False)
    ] = None,
    stream: Annotated[
        str | None,
        typer.Option(metavar="udp://HOST:PORT", help="Send the poses of each frame as JSON lines.", show_default=False),
    ] = None,
    reading: Reading = Reading(),
) -> None:
    """Track the people before a camera until Ctrl-C, and print how late the poses come.

    A frame that comes while an earlier one is tracked replaces the one that waits: poses are never more than a frame
    late, and dropped frames are counted. A recording is played at its own pace.
    """
    from toolkit.app.pipeline.live import track_live
    from toolkit.io.files import check_output
    from toolkit.io.interrupts import interrupts_deferred
    from toolkit.output.pose_stream import UdpStream, joint_names_line
    from toolkit.recordings.live_sources import FILE, live_source
    from toolkit.recordings.writer import RecordingWriter

    tracking.check()
    count, options = people_of(people), reading.options()
    if record is not None:
        check_output(record, [Path(source.removeprefix(FILE))])
    with ExitStack() as stack:
        outputs = []
        if stream is not None:
            outputs.append(UdpStream(stream))
            stack.callback(outputs[0].close)
        camera = live_source(source, **options)
        stack.callback(camera.close)
        tracker = tracking.recipe().build()
        writer = None
        if record is not None:
            writer = RecordingWriter(record, camera.first.camera, background=camera.first.background)
        for output in outputs:
            output.send(joint_names_line())
        say(f"tracking {camera.name}; Ctrl-C ends it", file=sys.stderr)
        try:
            summary = track_live(camera, tracker, people=count, writer=writer, outputs=outputs)
        finally:  # a camera that was unplugged has a recording, too
            if writer is not None and writer.frames:
                say(f"writing {record}", file=sys.stderr)
                with interrupts_deferred():
                    writer.close()
    say(summary.text())
    if outputs and outputs[0].lost:
        say(f"{outputs[0].lost} lines of the stream were not taken; is a program listening?", file=sys.stderr)
