"""`depthmocap database build` and `info`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import Output
from toolkit.app.cli.terminal import say

app = typer.Typer(help="Build a pose database from motion capture, or show what is in one.", no_args_is_help=True)


@app.command()
def build(
    sources: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="MOCAP...", help="BVH, AMC and AMASS files, or folders of them; the bundled motions without any."
        ),
    ] = None,
    output: Output = Path("poses.npz"),
    threshold: Annotated[
        float | None,
        typer.Option(help="Distance in metres (Baak 2013, Eq. 5.1) at which sampling stops.", show_default="0.009"),
    ] = None,
    max_poses: Annotated[int | None, typer.Option(help="Largest number of poses.")] = None,
    body: Annotated[str, typer.Option(help="Name of the body whose poses they become.")] = "neutral",
    mirror: Annotated[bool, typer.Option(help="Add the mirror image of every pose.")] = True,
    seated: Annotated[bool, typer.Option(help="Add the bundled motions of people who sit.")] = True,
    parts: Annotated[bool, typer.Option(help="Train the joint regressor on the poses.")] = True,
    workers: Annotated[int | None, typer.Option(help="Number of processes.", show_default="one per processor")] = None,
    strict: Annotated[bool, typer.Option("--strict", help="A file that cannot be used is an error.")] = False,
) -> None:
    """Read motion capture, sample it evenly and write one pose database."""
    from database_builder.build import THRESHOLD, Sampling, build_database
    from database_builder.regressor import RegressorSettings
    from toolkit.app.cli.terminal import progress_bars
    from toolkit.body.shape import load_body

    with progress_bars() as bars:
        report = build_database(
            sources or None,
            output,
            Sampling(THRESHOLD if threshold is None else threshold, max_poses, mirror, seated),
            body=load_body(body),
            parts=RegressorSettings() if parts else None,
            workers=workers,
            strict=strict,
            progress=bars,
        )
    say(report.text())


@app.command()
def info(
    database: Annotated[Path, typer.Argument(metavar="DATABASE", help="A pose database.", show_default=False)],
) -> None:
    """Print what a pose database holds and covers."""
    from database_builder.build_report import database_text
    from toolkit.database.database import PoseDatabase

    say(database_text(PoseDatabase.load(database)))
