"""Tracking of one recording into one run folder."""

from __future__ import annotations

import logging
import os
import threading
import time
import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from toolkit.app.pipeline.earlier import sightings_before
from toolkit.app.pipeline.folder import STATE_FILE, check_inputs, check_run_file, info_of, tracks_of_same_run
from toolkit.app.pipeline.joint_choice import JointChoice, give_joints, joint_source, name_of
from toolkit.app.pipeline.run_summary import RunSummary, summarised, track_warnings
from toolkit.app.pipeline.run_writer import RunSink
from toolkit.app.pipeline.second import SecondPass
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.app.pipeline.watch import log_file, stop_request
from toolkit.body.body import Body
from toolkit.io.checkpoint import HINT, load_checkpoint, save_checkpoint
from toolkit.io.errors import DepthMocapError, RecordingError, TrackError, UsageError
from toolkit.io.files import locked
from toolkit.io.progress import RecordingProgress, silent
from toolkit.people.evidence import furniture
from toolkit.people.joint_masks import JointSource
from toolkit.people.plausibility import plausibility
from toolkit.people.sighting import PeopleFinder
from toolkit.people.survey import find_people, find_person
from toolkit.people.vertical import floor_height
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.recording import Recording, frame_rate_of
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracking.multi_person import MultiPersonTracker, Row
from toolkit.tracking.searching import SearchingTracker
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import RunInfo

if TYPE_CHECKING:
    from toolkit.app.pipeline.events import EventStream

logger = logging.getLogger(__name__)

MEMORY_SECONDS = 2.0
"""Interval between two stored states of the first pass, seconds; a killed run loses at most this much of its work."""


class Job(NamedTuple):
    """One tracking job: recording, tracker and options.

    Attributes
    ----------
    recording : read frame by frame
    tracker : makes a follower for each person
    people : maximum number of tracked people; None = all
    joints : source of image joints
    folder : the run folder
    report : called as the run advances
    watcher : called with each row of a single tracked person; then there is one pass
    workers : number of processes that share the people in the second pass
    shared : recipe of the tracker in each of them; None = this process only
    """

    recording: Recording
    tracker: Tracker
    people: int | None
    joints: JointSource
    folder: Path
    report: RecordingProgress
    watcher: EventStream | None
    workers: int
    shared: TrackerRecipe | None

    def finder(self) -> PeopleFinder:
        """Return the finder of the people."""
        return finder_of(self.recording, self.people, self.tracker.settings.sensing)

    def people_tracker(self) -> MultiPersonTracker:
        """Return the multi-person tracker of the first pass."""
        recording = self.recording
        return MultiPersonTracker(self.tracker, self.finder(), recording.up_camera, self.joints, floor_of(recording))


def finder_of(recording: Recording, people: int | None, sensing: SensingSettings) -> PeopleFinder:
    """Return the finder of the selected person, of up to `people` people, or (None) of all."""
    if people == 1:
        return find_person(recording, sensing)
    return find_people(recording, sensing, most=people)


def track_recording(
    recording: Recording,
    tracker: Tracker,
    run: str | Path,
    *,
    people: int | None = 1,
    resume: bool = False,
    progress: RecordingProgress = silent,
    watcher: EventStream | None = None,
    joints: JointChoice | None = None,
    made_of: TrackerRecipe | None = None,
    workers: int = 1,
) -> RunSummary:
    """Track the person, or the people, in a recording and write the run folder.

    Each row is on the disk as soon as it is computed. Ctrl-C or a termination signal ends the run after the current
    frame and writes the track so far. `resume` continues a killed or interrupted run with the same result as an
    uninterrupted one.

    Parameters
    ----------
    run : the run folder, made if it is missing
    people : maximum number of tracked people, each in its own folder within `run`; None = all. 1 tracks the person
        selected by the settings, in `run` itself
    resume : continue an unfinished run; a finished one is left unchanged
    progress : called as the run advances
    watcher : called with each row of a single tracked person
    joints : source of image joints
    made_of : recipe of the tracker: its files, which no run may replace; default: its database
    workers : number of processes that share the people in the second pass; needs `made_of`

    Raises
    ------
    UsageError
        The folder holds an unfinished track and `resume` is not set, the run would damage the recording or an input of
        the tracker, events are requested for several people, or joints for a tracker without joint input.
    ModelError
        Joints have to be detected and the pose network cannot be loaded.
    TrackError
        The unfinished track belongs to another recording or database, or to other settings.
    OutputError
        The run folder cannot be written, or another process writes to it; the earlier rows stay.
    RecordingError
        A frame cannot be read; the track of the rows before it is put in place.

    Warns
    -----
    PlausibilityWarning
        The recording or its track is probably not what was meant, see `plausibility` and `track_warnings`.
    """
    if watcher is not None and people != 1:
        raise UsageError("events need a single person; leave --people out")
    recipe = made_of or TrackerRecipe(database=tracker.database)
    check_inputs(Path(run), recording, recipe)
    choice = joints or JointChoice()
    give_joints(recording, choice)
    source = joint_source(recording, choice, tracker.joints_wanted)
    shared = made_of if workers > 1 and made_of is not None and made_of.sensors is None else None
    job = Job(recording, tracker, people, source, Path(run), progress, watcher, workers, shared)
    with locked(run):
        info = replace(info_of(recording, tracker), joints_2d=name_of(source, recording), **recipe.digests())
        return _track(job, info, resume)


def _track(job: Job, info: RunInfo, resume: bool) -> RunSummary:
    """Track as `track_recording`, in a folder that this process has locked."""
    recording, tracker, folder, several = job.recording, job.tracker, job.folder, job.people != 1
    check_run_file(folder)
    if resume:
        tracks = tracks_of_same_run(folder, info, tracker, several=several)
        if tracks is not None and all(len(track) == len(recording) for track in tracks):
            return summarised(recording.name, folder, tracks, len(recording))
    sink = RunSink(folder, tracker, info, several=several, resume=resume)
    try:
        with log_file(folder), stop_request() as stop:
            _warn_of(recording)
            second = _second_pass(job, sink)
            frames = len(recording)
            if second is not None and resume and second.restore():
                bodies = second.bodies
                sink.remove_furniture(second.evidence)
            else:
                bodies, frames = _first_pass(job, sink, stop, second)
            complete = frames == len(recording)
            if second is not None and complete:
                complete = second.follow(stop, partial(job.report, recording.name, "second pass"))
                bodies = second.bodies
            tracks = sink.finish(bodies, complete=complete)
            if complete:
                (folder / STATE_FILE).unlink(missing_ok=True)
            logger.info("%s: %d of %d frames written", recording.name, frames, len(recording))
    except DepthMocapError:
        sink.abandon()
        raise
    stature = None if several else next((float(body.height) for body in bodies.values()), None)
    summary = summarised(recording.name, folder, tracks, len(recording), unfinished=not complete, stature=stature)
    for warning in track_warnings(summary, [float(body.height) for body in bodies.values()]):
        warnings.warn(warning, stacklevel=4)
    return summary


def _warn_of(recording: Recording) -> None:
    """Warn of a recording that is not plausible, on the screen and in the run's log."""
    for concern in plausibility(recording):
        logger.warning("%s: %s", recording.name, concern.text)
        warnings.warn(concern.warning(recording.name), stacklevel=5)


def _first_pass(
    job: Job, sink: RunSink, stop: threading.Event, second: SecondPass | None
) -> tuple[dict[int, Body], int]:
    """Run the first pass; return the bodies of the people and the number of frames."""
    recording, watcher = job.recording, job.watcher
    people_tracker = _restored(job, sink)
    if second is not None:
        people_tracker.sightings = second.sightings(people_tracker.frames)
    logger.info("%s: tracking frames %d to %d", recording.name, people_tracker.frames, len(recording))
    if watcher is not None:
        watcher.begin(frame_rate_of(recording.timestamps), people_tracker.bodies.get(1), sink.past())
    try:
        _follow(job, people_tracker, sink, stop)
    except RecordingError:
        if people_tracker.settled and sink.begun:
            sink.finish(people_tracker.bodies, complete=False)
        raise
    bodies, complete = people_tracker.bodies, people_tracker.frames == len(recording)
    if complete:
        sink.remove_furniture(people_tracker.finder.evidence)
        bodies = {
            person: body for person, body in bodies.items() if person not in furniture(people_tracker.finder.evidence)
        }
    if second is not None and people_tracker.sightings is not None and complete:
        before = list(sightings_before(recording, people_tracker.finder, people_tracker.sightings, bodies))
        people_tracker.sightings.close()  # flush the rows before a state that depends on them
        second.begin(bodies, people_tracker.finder.evidence, before)
    return bodies, people_tracker.frames


def _second_pass(job: Job, sink: RunSink) -> SecondPass | None:
    """Return the second pass, or None for a tracker with one pass or a watcher."""
    tracker, recording = job.tracker, job.recording
    if job.watcher is not None or not isinstance(tracker, SearchingTracker) or tracker.passes < 2:
        return None
    camera = DepthFilter(recording.camera, tracker.settings.sensing).camera
    rotation, floor = level_rotation(recording.up_camera), floor_of(recording)
    return SecondPass(job.folder, tracker, camera, rotation, recording.timestamps, floor, sink, job.workers, job.shared)


def floor_of(recording: Recording) -> float | None:
    """Return the floor height, y in the level frame, metres; None without a visible floor."""
    height = floor_height(recording)
    return None if height is None else -height


def _follow(job: Job, people_tracker: MultiPersonTracker, sink: RunSink, stop: threading.Event) -> None:
    """Track from the next frame to the last one, or until a stop is requested."""
    recording, report, watcher = job.recording, job.report, job.watcher
    total, remembered = len(recording), time.monotonic()
    report(recording.name, "tracking" if people_tracker.frames else "learning", people_tracker.frames, total)
    measured = people_tracker.frames > 0
    for frame in recording.stream(people_tracker.frames, color=people_tracker.joints.needs_color):
        if stop.is_set():
            break
        measured = measured or bool(frame.depth_mm.any())
        _write(sink, people_tracker, people_tracker.step(frame), watcher)
        report(recording.name, "tracking" if people_tracker.settled else "learning", people_tracker.frames, total)
        if people_tracker.settled and time.monotonic() - remembered > MEMORY_SECONDS:
            _remember(sink, people_tracker)
            remembered = time.monotonic()
    if people_tracker.settled and people_tracker.frames < total:
        _remember(sink, people_tracker)
    # During body estimation there is no state to resume from: `resume` computes these rows again.
    _write(sink, people_tracker, people_tracker.finish(), watcher)
    if not measured and not stop.is_set():
        raise RecordingError(
            f"no frame of {recording.name} holds a measurement, only 0 or 65535; record it again, or see its unit"
        )
    if watcher is not None and not stop.is_set():
        watcher.end()
    if not stop.is_set() and people_tracker.frames < total:
        raise RecordingError(
            f"{recording.name} ended after {people_tracker.frames} of {total} frames; "
            "copy it again and continue with --resume"
        )


def _write(sink: RunSink, people_tracker: MultiPersonTracker, rows: list[Row], watcher: EventStream | None) -> None:
    sink.write(rows)
    if watcher is not None:
        for row in rows:
            watcher.row(row.result, row.timestamp, people_tracker.bodies[row.person])


def _remember(sink: RunSink, people_tracker: MultiPersonTracker) -> None:
    sink.keep()
    if people_tracker.sightings is not None:
        people_tracker.sightings.flush()
    save_checkpoint(sink.run / STATE_FILE, people_tracker.tracker.settings.tracker, people_tracker)


def _restored(job: Job, sink: RunSink) -> MultiPersonTracker:
    """Return the tracker restored from the last stored state; later rows are computed again.

    If rows before the state are missing, for example after a power failure, all rows are computed again.
    """
    recording, tracker, path = job.recording, job.tracker, job.folder / STATE_FILE
    people_tracker = job.people_tracker()
    if sink.begun and os.path.lexists(path):
        state = load_checkpoint(path, tracker.settings.tracker)
        try:
            people, frames = state["followers"], len(state["timestamps"])
            if not people or frames <= sink.rows(people):
                people_tracker.restore_state(state)
        except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise TrackError(f"cannot resume from {path} ({error}); {HINT}") from error
        if people_tracker.timestamps != recording.timestamps[: people_tracker.frames].tolist():
            raise TrackError(f"{path} is of another recording; {HINT}")
    sink.cut(people_tracker.frames, people_tracker.bodies)
    return people_tracker
