"""`depthmocap export`."""

from __future__ import annotations

from toolkit.cli.options import Output, Run


def export(run: Run, output: Output) -> None:
    """Write a track as BVH (constant bone lengths, T-pose) or CSV (joints in the camera frame), by OUTPUT's suffix."""
    from toolkit.mocap.export import export_track

    export_track(run, output)
    print(output)
