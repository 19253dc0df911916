"""The verb `depthmocap track`."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from toolkit.app.cli.options import Joints, Reading, SegmentOption, SettingOption, given, people_of, spread
from toolkit.app.cli.terminal import doing_words, next_commands, print_lines, progress_bars
from toolkit.io.errors import UsageError

if TYPE_CHECKING:
    from toolkit.app.pipeline import TrackerRecipe
    from toolkit.app.pipeline.events import EventStream
    from toolkit.fitting.guide import Guide

SENSORS = "Inertial sensors"
EVENTS = "Live labels"


@dataclass(frozen=True)
class SensorGuideOptions:
    """Options for motion classes and inertial sensors."""

    classes: Annotated[
        Path | None, typer.Option(help="Class file written by `depthmocap learn --templates`.", rich_help_panel=EVENTS)
    ] = None
    queries: Annotated[
        Path | None, typer.Option(help="Keyframe queries written by `depthmocap learn`.", rich_help_panel=EVENTS)
    ] = None
    events: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|-",
            help="Write a JSON line when a motion ends; needs one pass (--online).",
            rich_help_panel=EVENTS,
        ),
    ] = None
    inertial: Annotated[
        Path | None,
        typer.Option(help="Canonical file of inertial sensors that guide the tracker.", rich_help_panel=SENSORS),
    ] = None
    calibration: Annotated[
        Path | None,
        typer.Option(
            help="Calibration of the sensors from a run of this recording (calibration.json).", rich_help_panel=SENSORS
        ),
    ] = None

    def watcher(self, recordings: list[Path]) -> EventStream | None:
        """Return the event stream, or None if no events are requested.

        Raises
        ------
        UsageError
            Options contradict each other, or need a single recording.
        """
        if self.events is None:
            if self.classes is not None or self.queries is not None:
                raise UsageError("--classes and --queries need --events; add it, or leave them out")
            return None
        if self.classes is None or len(recordings) != 1:
            raise UsageError("--events needs one recording and --classes; name both")
        from toolkit.app.pipeline.events import EventStream
        from toolkit.retrieval.annotation.classes import load_classes
        from toolkit.retrieval.keyframes.query import load_queries

        wanted = load_queries(self.queries) if self.queries else ()
        return EventStream(load_classes(self.classes), wanted, self.events)

    def guide(self, recordings: list[Path]) -> Guide | None:
        """Return the guide of the sensors, or None without sensors; raises as `watcher`."""
        if self.inertial is None and self.calibration is None:
            return None
        if self.inertial is None or self.calibration is None:
            raise UsageError("--inertial and --calibration belong together; give both or neither")
        if len(recordings) != 1:
            raise UsageError(
                f"inertial sensors belong to one recording, not to {len(recordings)}; track the recordings one by one"
            )
        from toolkit.inertial.calibration import Calibration
        from toolkit.inertial.guide import InertialGuide
        from toolkit.inertial.workflow import load_sensors

        sensors = load_sensors(self.inertial)
        return InertialGuide(sensors, Calibration.load(self.calibration), recordings[0].stem)


@dataclass(frozen=True)
class Tracking:
    """Options that select the tracker."""

    database: Annotated[
        Path | None,
        typer.Option("--database", "-d", help="Pose database.", show_default="the packaged one"),
    ] = None
    body: Annotated[Path | None, typer.Option(help="Body file of the person, written by `depthmocap body scan`.")] = (
        None
    )
    config: Annotated[str, typer.Option(help="Settings: a YAML file or the name of a shipped one.")] = "hybrid"
    settings: SettingOption = None
    online: Annotated[
        bool, typer.Option("--online", help="One pass: finish each frame when it arrives, as for a live camera.")
    ] = False
    segment: SegmentOption = None
    subject: Annotated[
        str | None,
        typer.Option(help="Selection of one of several people: only, largest or nearest.", show_default="only"),
    ] = None

    def overrides(self) -> dict[str, Any]:
        """Return the settings of the command line by their dotted names."""
        from toolkit.app.config import parse_overrides
        from toolkit.app.pipeline import TrackerRecipe
        from toolkit.tracking.registry import DEFAULT

        sensing = given(segment=self.segment, subject=self.subject)
        found = {f"sensing.{name}": value for name, value in sensing.items()} | parse_overrides(self.settings or [])
        # Other trackers have one pass only.
        if self.online and TrackerRecipe(self.config, found).tracker == DEFAULT:
            found["passes"] = 1
        return found

    def recipe(self, sensors: Path | None = None) -> TrackerRecipe:
        """Return the recipe of the tracker with the named database, or the packaged one if the tracker needs one.

        A database for a tracker without lookup is ignored with a warning.
        """
        from toolkit.app.pipeline import TrackerRecipe
        from toolkit.database import DEFAULT_DATABASE

        recipe = TrackerRecipe(self.config, self.overrides(), self.database, self.body, sensors)
        if not recipe.needs_database():
            if self.database is not None:
                print_lines(f"{self.database} is not used: this tracker has no database lookup", file=sys.stderr)
            return replace(recipe, database=None)
        return recipe if self.database else replace(recipe, database=DEFAULT_DATABASE)

    def check(self) -> None:
        """Raise SettingsError for invalid settings before the work starts."""
        from toolkit.app.pipeline import TrackerRecipe

        TrackerRecipe(self.config, self.overrides()).settings()


@dataclass(frozen=True)
class Folders:
    """Options for existing run folders and for batches."""

    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace finished runs.")] = False
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue a killed or interrupted run; a batch always does.")
    ] = False
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Number of processes that share the recordings, or the people of a single one.",
            show_default="1 for recordings; one per processor for people",
        ),
    ] = None

    def keep_finished(self, run: Path) -> None:
        """Refuse to replace a finished run without --overwrite."""
        from toolkit.tracks import PARTIAL_FILE, TRACK_FILE
        from toolkit.tracks.runs import PEOPLE_FILE

        finished = (run / TRACK_FILE).exists() and not (run / PARTIAL_FILE).exists()
        if (finished or (run / PEOPLE_FILE).exists()) and not (self.overwrite or self.resume):
            raise UsageError(f"{run} holds a finished run; add --overwrite to replace it, or choose another --output")


@spread
def track(
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING...", show_default=False)],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="Run folder; several recordings go to OUTPUT/<stem>.", show_default=False),
    ],
    tracking: Tracking,
    people: Annotated[str, typer.Option(metavar="all|N", help="Track several people, each in OUTPUT/person_NN.")] = "1",
    joints: Joints = Joints(),
    guiding: SensorGuideOptions = SensorGuideOptions(),
    folders: Folders = Folders(),
    reading: Reading = Reading(),
) -> None:
    """Track the person in depth recordings and write run folders.

    Several recordings, or --workers, write OUTPUT/<stem> each and OUTPUT/manifest.jsonl; finished runs are skipped.
    """
    from toolkit.app.pipeline import unreadable

    options, choice = reading.options(), joints.choice(len(recordings))
    how = {"people": people_of(people), "joints": choice}
    batch = len(recordings) > 1 or folders.workers is not None
    if not batch:
        folders.keep_finished(output)
    tracking.check()
    for path, reason in unreadable(recordings, options).items():  # before expensive work
        print_lines(f"depthmocap: {path}: {reason}; the others are tracked", file=sys.stderr)
    if batch:
        _track_batch(recordings, output, tracking, guiding, folders, {**how, "reader_options": options})
    else:
        _track_one(recordings[0], options, output, tracking, guiding, folders.resume, how)


def _track_one(
    path: Path, options: dict[str, Any], run: Path, tracking: Tracking, guiding: SensorGuideOptions, resume: bool,
    how: dict[str, Any],
) -> None:  # fmt: skip
    """Track one recording into `run`. Exit code 1 if it is not finished, 3 without a tracked person."""
    from toolkit.app.pipeline import track_recording
    from toolkit.io.workers import usable_processors
    from toolkit.recordings.opening import open_upright

    guide, watcher = guiding.guide([path]), guiding.watcher([path])
    if watcher is not None:  # events are written in the first pass
        tracking = replace(tracking, online=True)
    with progress_bars() as bars:
        recipe, preparing = tracking.recipe(guiding.inertial), doing_words("compiling")
        bars(preparing, 0, 1)
        tracker = recipe.build(guide)
        bars(preparing, 1, 1)
        summary = track_recording(
            open_upright(path, **options),
            tracker,
            run,
            resume=resume,
            progress=lambda name, doing, done, total: bars(f"{name}: {doing_words(doing)}", done, total),
            watcher=watcher,
            made_of=recipe,
            workers=usable_processors(),
            **how,
        )
    print_done(summary.text(), run, sys.stderr if guiding.events == "-" else None)
    if summary.interrupted:
        raise typer.Exit(1)
    if not summary.states["tracked"]:
        next_commands({("info", str(path)): "describes the recording and names the options that it needs"})
        raise typer.Exit(3)
    next_commands(
        {
            ("report", str(run), "--output", "report.html"): "one page: film, 3-D view, plots",
            ("evaluate", str(run)): "error if the recording contains the true joints; time; states",
            ("export", str(run), "--output", "motion.glb"): "for Blender, Unity, browsers; also .bvh, .trc, .csv",
        }
    )


def _track_batch(
    recordings: list[Path],
    output: Path,
    tracking: Tracking,
    guiding: SensorGuideOptions,
    folders: Folders,
    how: dict[str, Any],
) -> None:
    """Track several recordings, with one line each. Exit code 1 if one is not finished, 3 if one has no tracked
    person."""
    from toolkit.app.pipeline import track_recordings
    from toolkit.app.pipeline.batch import DONE

    if guiding.guide(recordings) or guiding.watcher(recordings):
        raise UsageError("sensors and events belong to one recording; leave --workers out")
    with progress_bars() as bars:
        rows = track_recordings(
            recordings, tracking.recipe(), output, workers=folders.workers or 1, overwrite=folders.overwrite,
            progress=lambda name, doing, done, total: bars(f"{name}: {doing_words(doing)}", done, total), **how,
        )  # fmt: skip
    for row in rows:
        if row.status == DONE:
            print_done(row.text, Path(row.run))
        else:
            print_lines(f"depthmocap: {row.recording}: {row.status}: {row.reason or row.text}", file=sys.stderr)
    if any(row.status != DONE for row in rows):
        raise typer.Exit(1)
    if not all(row.tracked for row in rows):
        raise typer.Exit(3)
    next_commands(
        {
            ("report", str(output), "--output", "report.html"): "one page: films, 3-D views, plots",
            ("evaluate", str(output)): "error if the recordings contain the true joints; time; states",
        }
    )


def print_done(text: str, run: Path, file: TextIO | None = None) -> None:
    """Print the summary of a recording, with its people if there are several, and the uncertain limbs of each."""
    from toolkit.motion.uncertain_limbs import uncertain_text
    from toolkit.tracks import TRACK_FILE, Track
    from toolkit.tracks.runs import PEOPLE_FILE, load_people, person_runs

    print_lines(text, file=file)
    if (run / PEOPLE_FILE).exists():
        print_lines(load_people(run).text(), file=file)
    for person in [person for person in person_runs(run) if (person / TRACK_FILE).exists()]:
        who = "" if person == run else f" of {person.name}"
        print_lines(f"uncertain limbs{who}: {uncertain_text(Track.load(person))}", file=file)
