"""`depthmocap inertial read|synchronise|calibrate|check`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.options import Output, Run, given
from toolkit.errors import UsageError

app = typer.Typer(
    help="Check a track with inertial sensors: read their files, compare clocks, calibrate, find errors.",
    no_args_is_help=True,
)

SensorFile = Annotated[
    Path, typer.Option("--sensors", help="Canonical file that `depthmocap inertial read` wrote.", show_default=False)
]
MaxOffset = Annotated[float, typer.Option(help="Largest offset of the clocks that is looked for, seconds.")]

Rate = Annotated[str, typer.Option(help="Ratio of the clocks: same, or free to be looked for.")]


@app.command()
def read(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Sensor files of one recording.", show_default=False)
    ],
    output: Output,
    placement: Annotated[
        Path | None, typer.Option(help="YAML: sensor or device id to the part of the body that carries it.")
    ] = None,
    format: Annotated[str | None, typer.Option(help="Name of the reader.", show_default="guessed")] = None,
    columns: Annotated[str | None, typer.Option(help="Of any CSV: ours=theirs pairs, such as time_s=t,qw=Q0.")] = None,
    units: Annotated[str | None, typer.Option(help="Of any CSV, such as gyro=deg/s,acceleration=g,time=ms.")] = None,
    sensor: Annotated[str | None, typer.Option(help="Name of the sensor in a file that does not say it.")] = None,
    rate: Annotated[float | None, typer.Option(help="Samples a second in a file that does not say it.")] = None,
) -> None:
    """Bring sensor files of any known format into the canonical one."""
    from rich.table import Table

    from toolkit.cli.terminal import print_table
    from toolkit.inertial.readers.common import SensorOptions
    from toolkit.inertial.workflow import gap_seconds, read_sensors

    options = SensorOptions(**given(format=format, columns=columns, units=units, sensor=sensor, rate=rate))
    report = read_sensors(files, output, placement=placement, options=options)
    table = Table("sensor", "device", "Hz", "seconds", "rows", "left out", "gaps", "longest gap s", "orientation from")
    for stream in report.sensors:
        table.add_row(
            stream.name, report.sensors.devices.get(stream.name, ""), f"{stream.rate:.1f}",
            f"{stream.times[-1] - stream.times[0]:.2f}", str(len(stream)), str(int((~stream.valid).sum())),
            str(stream.gaps), f"{gap_seconds(stream.times, stream.valid):.3f}", stream.origin,
        )  # fmt: skip
    print_table(table)
    _say(report.suspicions)


@app.command()
def synchronise(
    run: Run,
    sensors: SensorFile,
    max_offset: MaxOffset = 3.0,
    rate: Rate = "same",
) -> None:
    """Find the offset of the sensors' clock against the camera's."""
    from toolkit.inertial.synchronise import SyncSettings
    from toolkit.inertial.workflow import synchronise_run

    clock, doubts = synchronise_run(run, sensors, SyncSettings(max_offset=max_offset, free_rate=_is_free(rate)))
    print(
        f"t_sensor = {clock.rate:.5f} t_camera {clock.offset:+.4f} s "
        f"(correlation {clock.correlation:.2f}, next best {clock.second:.2f})"
    )
    _say(doubts)


def _is_free(rate: str) -> bool:
    if rate not in ("same", "free"):
        raise UsageError(f"--rate is {rate!r}; give same or free")
    return rate == "free"


def _say(sentences: list[str] | tuple[str, ...]) -> None:
    """Suspicions, on the standard output: they belong to the result."""
    for sentence in sentences:
        print(f"suspicion: {sentence}")
