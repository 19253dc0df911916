"""`depthmocap live`."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import Reading, people_of, spread
from toolkit.app.cli.terminal import print_lines
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
        typer.Option(
            metavar="udp://HOST:PORT|osc://HOST:PORT",
            help="Send the poses of each frame as JSON lines, or as messages of Open Sound Control.",
            show_default=False,
        ),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show depth and skeletons in the viewer rerun.")] = False,
    reading: Reading = Reading(),
) -> None:
    """Track the people before a camera until Ctrl-C, and print how late the poses come.

    A frame that comes while an earlier one is tracked replaces the one that waits: poses are never more than a frame
    late, and dropped frames are counted. A recording is played at its own pace.
    """
    from toolkit.app.pipeline.live import track_live
    from toolkit.io.files import check_output
    from toolkit.io.interrupts import interrupts_deferred
    from toolkit.output.live_view import RerunView
    from toolkit.output.pose_stream import LiveOutput, PoseStream
    from toolkit.recordings.live_sources import FILE, live_source
    from toolkit.recordings.writer import RecordingWriter

    tracking.check()
    count, options = people_of(people), reading.options()
    if record is not None:
        check_output(record, [Path(source.removeprefix(FILE))])
    with ExitStack() as stack:
        outputs: list[LiveOutput] = []
        poses = None if stream is None else PoseStream(stream)
        if poses is not None:
            outputs.append(poses)
            stack.callback(poses.close)
        camera = live_source(source, **options)
        stack.callback(camera.close)
        if view:
            shown = RerunView(camera.first)
            outputs.append(shown)
            stack.callback(shown.close)
        tracker = tracking.recipe().build()
        writer = None
        if record is not None:
            writer = RecordingWriter(record, camera.first.camera, background=camera.first.background)
        print_lines(f"tracking {camera.name}; Ctrl-C ends it", file=sys.stderr)
        try:
            summary = track_live(camera, tracker, people=count, writer=writer, outputs=outputs)
        finally:  # a camera that was unplugged has a recording, too
            if writer is not None and writer.frames:
                print_lines(f"writing {record}", file=sys.stderr)
                with interrupts_deferred():
                    writer.close()
    print_lines(summary.text())
    if poses is not None and poses.lost:
        print_lines(f"{poses.lost} datagrams of the stream were not taken; is a program listening?", file=sys.stderr)
