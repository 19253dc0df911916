"""The verbs `depthmocap inertial read|calibrate|check`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.options import Output
from toolkit.app.cli.terminal import print_lines, print_rows

app = typer.Typer(
    help="Check a track with inertial sensors: read files, calibrate, detect errors.",
    no_args_is_help=True,
)

SensorFiles = Annotated[
    list[Path],
    typer.Option("--sensors", help="Canonical file; one for all runs, or one per run.", show_default=False),
]
Runs = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.", show_default=False)]
MaxOffset = Annotated[float, typer.Option(help="Maximum clock offset, seconds.")]


@app.command()
def read(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Sensor files of one recording.", show_default=False)
    ],
    output: Output,
    placement: Annotated[Path | None, typer.Option(help="YAML file: sensor or device id -> body part.")] = None,
    columns: Annotated[
        str | None, typer.Option(help="Columns of a CSV file as pairs ours=theirs, for example time_s=t,qw=Q0.")
    ] = None,
    units: Annotated[
        str | None, typer.Option(help="Units of a CSV file, for example gyro=deg/s,acceleration=g,time=ms.")
    ] = None,
) -> None:
    """Convert sensor files of any supported format to the canonical one."""
    from toolkit.inertial.workflow import read_sensors

    sensors = read_sensors(files, output, placement=placement, columns=columns, units=units)
    rows = [
        (
            stream.name, sensors.devices.get(stream.name, ""), f"{stream.rate:.1f}",
            f"{stream.times[-1] - stream.times[0]:.2f}", str(len(stream)), str(int((~stream.valid).sum())),
            str(stream.gaps), f"{stream.longest_gap:.3f}", stream.origin,
        )
        for stream in sensors
    ]  # fmt: skip
    head = ("sensor", "device", "Hz", "seconds", "rows", "left out", "gaps", "longest gap s", "orientation from")
    print_rows(head, rows)


@app.command()
def calibrate(
    runs: Runs,
    sensors: SensorFiles,
    output: Output,
    method: Annotated[str, typer.Option(help="robust, or thesis (closed form of Park and Martin).")] = "robust",
    heading: Annotated[
        str | None,
        typer.Option(
            help="Heading reference of the sensors: shared, or own (one per sensor).",
            show_default="shared if the devices measure orientations",
        ),
    ] = None,
    max_offset: MaxOffset = 3.0,
) -> None:
    """Estimate the mounting of each sensor on its limb and the rotation between the sensor and track frames."""
    from toolkit.inertial.calibrate import CalibrationSettings
    from toolkit.inertial.workflow import calibrate_runs

    found = calibrate_runs(
        runs, sensors, output, settings=CalibrationSettings(method=method, heading=heading),
        max_offset=max_offset,
    )  # fmt: skip
    rows = [
        (limb, s.status, f"{s.spread:.0f}", f"{s.median:.1f}", f"{s.p90:.1f}", f"{100 * s.inliers:.0f}", s.reason)
        for limb, s in found.sensors.items()
    ]
    print_rows(("sensor", "status", "spread deg", "median deg", "90 % deg", "inliers %", "why"), rows)
    for name, take in found.takes.items():
        print_lines(f"{name}: t_sensor = t_camera {take.offset:+.4f} s")
    for note in found.notes:
        print_lines(note)


@app.command()
def check(
    runs: Runs,
    sensors: SensorFiles,
    output: Output,
    calibration: Annotated[
        Path | None, typer.Option(help="calibration.json.", show_default="each run by itself")
    ] = None,
    threshold: Annotated[
        float, typer.Option(help="Orientation difference that counts as a tracking error, degrees.")
    ] = 45.0,
    truth: Annotated[
        Path | None, typer.Option(help="CSV file of known errors with columns limb, start, end, run.")
    ] = None,
    max_offset: MaxOffset = 3.0,
) -> None:
    """Detect disagreement between tracks and sensors: curves, errors, a picture and a page for each run."""
    from toolkit.evaluation.orientation_report import ERROR_HEAD, error_rows, write_check
    from toolkit.evaluation.orientations import check_runs

    checks = check_runs(
        runs, sensors, calibration=calibration, truth=truth, threshold=threshold,
        max_offset=max_offset,
    )  # fmt: skip
    rows = []
    for found in checks:
        folder = output if len(checks) == 1 else output / found.name
        write_check(found, folder)
        rows += [(found.name, *cells) for cells in error_rows(found)]
        for limb, sensor in found.calibration.sensors.items():
            if sensor.status == "refused":
                print_lines(f"{found.name}: {limb} is left out: {sensor.reason}")
        for name, s in found.scores().items():
            print_lines(f"{found.name}: over {name} precision {s.precision:.2f}, recall {s.recall:.2f}, F {s.f:.2f}")
    if rows:
        print_rows(("run", *ERROR_HEAD), rows)
    else:
        print_lines(f"no disagreement above {threshold:g} degrees")
