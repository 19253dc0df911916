"""`depthmocap export`."""

from __future__ import annotations

from typing import Annotated

import typer

from toolkit.cli.options import Output, Run


def export(
    run: Run,
    output: Output,
    rig: Annotated[
        str | None,
        typer.Option(
            help="Joint names of .glb and .bvh: mixamo, cmu, classic or a YAML file.", show_default="the body's own"
        ),
    ] = None,
) -> None:
    """Write a track for other programs, by OUTPUT's suffix.

    .glb skinned and animated (Blender, Unity, browsers), .bvh (animation tools), .c3d (motion laboratories), .trc
    (OpenSim), .csv and .json.
    """
    from toolkit.export.run import export_run

    for path in export_run(run, output, rig=rig):
        print(path)
