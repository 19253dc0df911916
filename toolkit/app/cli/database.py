"""The verbs `depthmocap database build` and `depthmocap database info`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import Output
from toolkit.app.cli.terminal import print_lines, progress_bars

app = typer.Typer(help="Build a pose database from motion capture, or describe one.", no_args_is_help=True)


@app.command()
def build(
    sources: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="MOCAP...", help="BVH, AMC and AMASS files, or folders of them; default: the bundled motions."
        ),
    ] = None,
    output: Output = Path("poses.npz"),
    threshold: Annotated[
        float | None,
        typer.Option(
            help="Minimum distance between sampled poses in metres (Baak 2013, Eq. 5.1).", show_default="0.009"
        ),
    ] = None,
    max_poses: Annotated[int | None, typer.Option(help="Maximum number of poses.")] = None,
    body: Annotated[str, typer.Option(help="Name of the body to which the motions are retargeted.")] = "neutral",
    mirror: Annotated[bool, typer.Option(help="Add the mirror image of each pose.")] = True,
    seated: Annotated[bool, typer.Option(help="Add the bundled seated motions.")] = True,
    workers: Annotated[int | None, typer.Option(help="Number of processes.", show_default="one per processor")] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Stop at a file that cannot be read instead of skipping it.")
    ] = False,
) -> None:
    """Read motion capture, sample its poses evenly and write a pose database."""
    from database_builder.build import SAMPLING_THRESHOLD, Sampling, build_database
    from toolkit.body.shape import load_body

    with progress_bars() as bars:
        report = build_database(
            sources or None,
            output,
            Sampling(SAMPLING_THRESHOLD if threshold is None else threshold, max_poses, mirror, seated),
            body=load_body(body),
            workers=workers,
            strict=strict,
            progress=bars,
        )
    print_lines(report.text())


@app.command()
def info(
    database: Annotated[Path, typer.Argument(metavar="DATABASE", help="A pose database.", show_default=False)],
) -> None:
    """Print the contents and the coverage of a pose database."""
    from database_builder.build_report import database_text
    from toolkit.database.database import PoseDatabase

    print_lines(database_text(PoseDatabase.load(database)))
