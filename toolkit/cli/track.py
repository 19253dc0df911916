"""`depthmocap track`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.options import SettingOption, given, numbers
from toolkit.errors import UsageError

if TYPE_CHECKING:
    from toolkit.cli.terminal import Bars
    from toolkit.pipeline.joints import JointChoice
    from toolkit.pipeline.manifest import ManifestRow
    from toolkit.pipeline.rows import RowWatcher
    from toolkit.tracking.guide import Guide

HELP = {
    "format": "npz, ros, mkv, record3d, tum, stray, png, utd_mhad, raw or cloud; guessed from the path.",
    "intrinsics": "fx,fy,cx,cy in pixels, or a JSON file that holds them.",
    "mirrored": "The source shows the scene as a mirror does; its images are flipped.",
    "radial": "Pixels hold the distance to the camera instead of the depth along z.",
    "unit": "mm, m, or the metres of one unit.",
    "size": "Width,height in pixels of raw files.",
    "rate": "Frames per second of a source without timestamps.",
    "up": "The vertical x,y,z in the camera frame.",
    "background": "16-bit PNG of the empty scene.",
    "skeleton": "File or folder of a reference skeleton.",
    "track": "Name of the depth topic or track of a file that holds several.",
    "axes": "camera (x right, y down, z forward) or graphics (y up, z backward), for clouds.",
    "rotate": "Degrees (90, 180, 270) by which the images are turned clockwise, for a camera that stands on its side.",
    "segment": "How to cut the person out: segmented, background, empty-frames:N, range:NEAR,FAR, person, seed:U,V.",
    "joints": "Joints in the image: a folder of OpenPose JSON, colour or depth (detect them there), or none.",
    "joints_size": "Width,height of the images in which the joints of a folder were found.",
    "subject": "Who is meant among several people: only, largest or nearest.",
}
READING = "How to read the recording"
SENSORS = "Inertial sensors"
EVENTS = "Live labels"

JointsOption = Annotated[
    str | None,
    typer.Option(
        metavar="FOLDER|colour|depth|none", help=HELP["joints"], show_default="the recording's, colour, depth"
    ),
]
JointsSizeOption = Annotated[str | None, typer.Option(help=HELP["joints_size"])]


def track(
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING...", show_default=False)],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="Run folder; several recordings go to OUTPUT/<stem>.", show_default=False),
    ],
    database: Annotated[
        Path | None,
        typer.Option("--database", "-d", help="Pose database.", show_default="of bundled motions, built once"),
    ] = None,
    body: Annotated[Path | None, typer.Option(help="The person's own, of `depthmocap body scan`.")] = None,
    config: Annotated[str, typer.Option(help="Settings: a YAML file or the name of a shipped one.")] = "hybrid",
    settings: SettingOption = None,
    max_poses: Annotated[int | None, typer.Option(help="Use only the first poses of the database.", min=2)] = None,
    half_resolution: Annotated[bool, typer.Option("--half-resolution", help="Keep every second pixel.")] = False,
    segment: Annotated[str | None, typer.Option(help=HELP["segment"], show_default="auto")] = None,
    subject: Annotated[str | None, typer.Option(help=HELP["subject"], show_default="only")] = None,
    people: Annotated[
        str, typer.Option(metavar="all|N", help="Follow several people, each in OUTPUT/person_NN.")
    ] = "1",
    joints: JointsOption = None,
    joints_size: JointsSizeOption = None,
    classes: Annotated[
        Path | None, typer.Option(help="Class file of `depthmocap annotate --templates`.", rich_help_panel=EVENTS)
    ] = None,
    priors: Annotated[
        bool,
        typer.Option("--priors", help="Let the classes tell what hidden limbs do.", rich_help_panel=EVENTS),
    ] = False,
    queries: Annotated[
        Path | None, typer.Option(help="Keyframe queries of `depthmocap learn`.", rich_help_panel=EVENTS)
    ] = None,
    events: Annotated[
        str | None,
        typer.Option(metavar="FILE|-", help="One JSON line for each motion that ends.", rich_help_panel=EVENTS),
    ] = None,
    early: Annotated[
        bool, typer.Option("--early", help="And for each that has begun.", rich_help_panel=EVENTS)
    ] = False,
    inertial: Annotated[
        Path | None,
        typer.Option(help="Canonical file of inertial sensors that guide the tracker.", rich_help_panel=SENSORS),
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="Their calibration.json, of a run of this recording.", rich_help_panel=SENSORS)
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a finished run.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Continue a killed or interrupted run.")] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="So many processes share the recordings; finished runs are left alone, manifest.jsonl lists all.",
        ),
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="With --workers: only what manifest.jsonl says failed.")
    ] = False,
    format_: Annotated[str | None, typer.Option("--format", help=HELP["format"], rich_help_panel=READING)] = None,
    intrinsics: Annotated[str | None, typer.Option(help=HELP["intrinsics"], rich_help_panel=READING)] = None,
    mirrored: Annotated[
        bool | None, typer.Option("--mirrored/--not-mirrored", help=HELP["mirrored"], rich_help_panel=READING)
    ] = None,
    radial: Annotated[bool | None, typer.Option("--radial", help=HELP["radial"], rich_help_panel=READING)] = None,
    depth_unit: Annotated[str | None, typer.Option(help=HELP["unit"], rich_help_panel=READING)] = None,
    size: Annotated[str | None, typer.Option(help=HELP["size"], rich_help_panel=READING)] = None,
    frame_rate: Annotated[float | None, typer.Option(help=HELP["rate"], rich_help_panel=READING)] = None,
    up: Annotated[str | None, typer.Option(help=HELP["up"], rich_help_panel=READING)] = None,
    background: Annotated[str | None, typer.Option(help=HELP["background"], rich_help_panel=READING)] = None,
    skeleton: Annotated[str | None, typer.Option(help=HELP["skeleton"], rich_help_panel=READING)] = None,
    axes: Annotated[str | None, typer.Option(help=HELP["axes"], rich_help_panel=READING)] = None,
    rotate: Annotated[int | None, typer.Option(help=HELP["rotate"], rich_help_panel=READING)] = None,
    depth_track: Annotated[str | None, typer.Option("--track", help=HELP["track"], rich_help_panel=READING)] = None,
) -> None:
    """Track the person in depth recordings and write what was found into run folders."""
    from toolkit.cli.terminal import next_commands, progress_bars
    from toolkit.config import parse_overrides
    from toolkit.files import is_file, sha256_of
    from toolkit.pipeline import TrackerRecipe, load_tracker, run_folders, track_many, track_recordings

    reading = reading_of(
        format=format_,
        intrinsics=intrinsics,
        mirrored=mirrored,
        radial=radial,
        depth_unit=depth_unit,
        size=size,
        frame_rate=frame_rate,
        up=up,
        background=background,
        skeleton=skeleton,
        axes=axes,
        rotate=rotate,
        track=depth_track,
    )
    sensing = given(segment=segment, subject=subject, half_resolution=half_resolution or None)
    overrides = {f"sensing.{name}": value for name, value in sensing.items()} | parse_overrides(settings or [])
    choice = joint_choice(joints, joints_size, len(recordings))
    runs = list(run_folders(recordings, output).values())
    batch = workers is not None or retry_failed
    if not (overwrite or resume or batch):
        _keep_finished(runs)
    watcher = row_watcher(recordings, events, classes, queries, early)
    guide, sensors_sha256 = sensor_guide(recordings, inertial, calibration)
    classes_sha256 = ""
    if priors:
        if guide is not None:
            raise UsageError("classes and inertial sensors do not guide one tracker together; give one of them")
        guide, watcher, classes_sha256 = _class_guide(recordings, classes, watcher)
    if batch and (guide is not None or watcher is not None):
        raise UsageError("sensors, events and priors belong to one recording; leave --workers and --retry-failed out")
    with progress_bars() as bars:
        database = _database(database, config, overrides, bars)
        if batch:
            recipe = TrackerRecipe(config, overrides, database, max_poses, body)
            rows = track_many(
                recordings, recipe, output, people=people_of(people), reader_options=reading, joints=choice,
                workers=workers or 1, retry_failed=retry_failed, overwrite=overwrite, progress=bars,
            )  # fmt: skip
    if batch:
        _print_rows(rows)
        return
    with progress_bars() as bars:
        bars("preparing (compiles for a minute the first time)", 0, 1)
        tracker = load_tracker(config, overrides, database=database, max_poses=max_poses, guide=guide, body=body)
        bars("preparing (compiles for a minute the first time)", 1, 1)
        report = track_recordings(
            recordings,
            tracker,
            output,
            people=people_of(people),
            reader_options=reading,
            resume=resume,
            settings_file=config if is_file(config) else None,
            progress=bars.of_recording,
            sensors_sha256=sensors_sha256,
            classes_sha256=classes_sha256,
            watcher=watcher,
            joints=choice,
            body_sha256=sha256_of(body) if body else "",
        )
    for summary in report.done:
        print(summary.text())
    for path, reason in report.failed.items():
        print(f"depthmocap: {path}: {reason}", file=sys.stderr)
    if report.failed or report.interrupted:
        raise typer.Exit(1)
    next_commands(
        {
            f"depthmocap report {output} --output report.html": "one page: film, body in three dimensions, plots",
            f"depthmocap evaluate {output}": "error, where the recording knows the truth; time; states",
            f"depthmocap export {runs[0]} --output motion.glb": "for Blender, Unity, browsers; also .bvh, .c3d, .trc",
        }
    )


def _keep_finished(runs: list[Path]) -> None:
    """Refuse to replace a finished run that nobody said may go."""
    from toolkit.runs import PEOPLE_FILE
    from toolkit.track import PARTIAL_FILE, TRACK_FILE

    for run in runs:
        finished = (run / TRACK_FILE).exists() and not (run / PARTIAL_FILE).exists()
        if finished or (run / PEOPLE_FILE).exists():
            raise UsageError(f"{run} holds a finished run; add --overwrite to replace it, or choose another --output")


def _database(named: Path | None, config: str, overrides: dict[str, object], bars: Bars) -> Path | None:
    """The database named, or that of the user's cache; None for a tracker that looks no poses up. Both are said."""
    from toolkit.cli.default_database import default_database
    from toolkit.pipeline.trackers import needs_database

    if not needs_database(config, overrides):
        if named is not None:
            print(f"{named} is not used: this tracker looks no poses up", file=sys.stderr)
        return None
    if named is not None:
        return named
    path = default_database(bars)
    print(f"poses of bundled motions: {path} (--database names your own)", file=sys.stderr)
    return path


def row_watcher(
    recordings: list[Path], events: str | None, classes: Path | None, queries: Path | None, early: bool
) -> RowWatcher | None:
    """What tells events, if any are wanted; raises UsageError where they cannot be told."""
    if events is None:
        return None
    if classes is None or len(recordings) != 1:
        raise UsageError("--events tells the motions of one recording; name it, and --classes")
    from toolkit.pipeline.events import EventStream
    from toolkit.retrieval.annotation.classes import load_classes
    from toolkit.retrieval.annotation.online import OnlineSettings
    from toolkit.retrieval.keyframes.query_file import load_queries

    wanted = load_queries(queries) if queries else ()
    return EventStream(load_classes(classes), wanted, events, OnlineSettings(early=early))


def _class_guide(
    recordings: list[Path], classes: Path | None, watcher: RowWatcher | None
) -> tuple[Guide, RowWatcher, str]:
    """The guide of the classes, told every row beside what tells events, and the digest of their file."""
    if classes is None or len(recordings) != 1:
        raise UsageError("--priors tells the limbs of one person in one recording; name it, and --classes")
    from toolkit.files import sha256_of
    from toolkit.pipeline.class_guide import ClassGuide
    from toolkit.pipeline.rows import Watchers
    from toolkit.retrieval.annotation.classes import load_classes

    guide = ClassGuide(load_classes(classes))
    return guide, guide if watcher is None else Watchers(guide, watcher), sha256_of(classes)


def sensor_guide(recordings: list[Path], inertial: Path | None, calibration: Path | None) -> tuple[Guide | None, str]:
    """The guide of the sensors, if there are any, and the digest of their file; raises UsageError for half of it."""
    if inertial is None and calibration is None:
        return None, ""
    if inertial is None or calibration is None:
        raise UsageError("--inertial and --calibration go together; give both or neither")
    if len(recordings) != 1:
        raise UsageError(f"inertial sensors belong to one recording, not to {len(recordings)}; track them one by one")
    from toolkit.files import sha256_of
    from toolkit.inertial.calibration import Calibration
    from toolkit.inertial.workflow import load_sensors
    from toolkit.tracking.guide import InertialGuide

    sensors = load_sensors(inertial)
    return InertialGuide(sensors, Calibration.load(calibration), recordings[0].stem), sha256_of(inertial)


def _print_rows(rows: list[ManifestRow]) -> None:
    """A line for each recording of a batch; exit code 1 where one is not done."""
    from toolkit.pipeline.manifest import DONE

    for row in rows:
        if row.status == DONE:
            print(row.text)
        else:
            print(f"depthmocap: {row.recording}: {row.status}: {row.reason or row.text}", file=sys.stderr)
    if any(row.status != DONE for row in rows):
        raise typer.Exit(1)


def people_of(text: str) -> int | None:
    """The option `--people`: a number, or None for all."""
    if text == "all":
        return None
    if not text.isdigit() or int(text) < 1:
        raise UsageError(f"--people is {text!r}; give a number of people, or all")
    return int(text)


def joint_choice(joints: str | None, size: str | None, recordings: int = 1) -> JointChoice:
    """The options `--joints` and `--joints-size`."""
    from toolkit.pipeline.joints import JointChoice

    choice = JointChoice(**given(source=joints, size=None if size is None else size_of(size, "--joints-size")))
    choice.check(recordings)
    return choice


def reading_of(
    *, intrinsics: str | None, depth_unit: str | None, size: str | None, up: str | None, **others: Any
) -> dict[str, Any]:
    """Options of `ReaderOptions` that were given, from their texts on the command line."""
    return given(
        intrinsics=intrinsics_of(intrinsics),
        depth_unit=unit_of(depth_unit),
        size=None if size is None else size_of(size, "--size"),
        up_camera=None if up is None else numbers(up, 3, "--up"),
        **others,
    )


def size_of(text: str, option: str) -> tuple[int, int]:
    """A width and height in pixels."""
    width, height = numbers(text, 2, option)
    return int(width), int(height)


def intrinsics_of(text: str | None) -> str | tuple[float, ...] | None:
    """The option `--intrinsics`: four numbers, or the path of a file."""
    return numbers(text, 4, "--intrinsics") if text and "," in text else text


def unit_of(text: str | None) -> str | float | None:
    """The option `--depth-unit`: a name, or a number of metres."""
    try:
        return text if text is None else float(text)
    except ValueError:
        return text
