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
from typing import TYPE_CHECKING

from toolkit.app.pipeline.earlier import sightings_before
from toolkit.app.pipeline.image_joints import JointChoice, give_joints, joint_source, name_of
from toolkit.app.pipeline.run_summary import RunSummary, summarised, track_warnings
from toolkit.app.pipeline.run_writer import (
    STATE_FILE,
    RunSink,
    check_inputs,
    check_run_file,
    info_of,
    tracks_of_same_run,
)
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
from toolkit.people.survey import find
from toolkit.people.vertical import floor_of
from toolkit.sensing.recording import Recording, frame_rate_of
from toolkit.tracking.multi_person import MultiPersonTracker, Row
from toolkit.tracking.searching import SearchingTracker
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import RunInfo

if TYPE_CHECKING:
    from toolkit.app.pipeline.events import EventStream

logger = logging.getLogger(__name__)

MEMORY_SECONDS = 2.0
"""Interval between two stored states of the first pass, seconds; a killed run loses at most this much of its work."""


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
    job = _Run(recording, tracker, Path(run), people, source, progress, watcher)
    with locked(run):
        info = replace(info_of(recording, tracker), joints_2d=name_of(source, recording), **recipe.digests())
        return job.track(info, resume, workers, None if made_of is None or made_of.sensors else made_of)


class _Run:
    """A tracking job in a folder that this process has locked; see `track_recording` for its parameters."""

    def __init__(
        self,
        recording: Recording,
        tracker: Tracker,
        folder: Path,
        people: int | None,
        joints: JointSource,
        report: RecordingProgress,
        watcher: EventStream | None,
    ) -> None:
        self.recording, self.tracker, self.folder, self.several = recording, tracker, folder, people != 1
        self.count, self.joints, self.report, self.watcher = people, joints, report, watcher
        self.floor, self.total = floor_of(recording), len(recording)

    def track(self, info: RunInfo, resume: bool, workers: int, recipe: TrackerRecipe | None) -> RunSummary:
        """Track as `track_recording`; `recipe` makes the tracker in worker processes."""
        name, folder, several = self.recording.name, self.folder, self.several
        check_run_file(folder)
        if resume:
            tracks = tracks_of_same_run(folder, info, self.tracker, several=several)
            if tracks is not None and all(len(track) == self.total for track in tracks):
                return summarised(name, folder, tracks, self.total)
        sink = RunSink(folder, self.tracker, info, several=several, resume=resume)
        try:
            with log_file(folder), stop_request() as stop:
                self._warn()
                second, frames = self._second_pass(sink, workers, recipe), self.total
                if second is not None and resume and second.restore():
                    bodies = second.bodies
                    sink.remove_furniture(second.evidence)
                else:
                    bodies, frames = self._first_pass(sink, stop, second)
                complete = frames == self.total
                if second is not None and complete:
                    complete = second.follow(stop, partial(self.report, name, "second pass"))
                    bodies = second.bodies
                tracks = sink.finish(bodies, complete=complete)
                if complete:
                    (folder / STATE_FILE).unlink(missing_ok=True)
                logger.info("%s: %d of %d frames written", name, frames, self.total)
        except DepthMocapError:
            sink.abandon()
            raise
        stature = None if several else next((float(body.height) for body in bodies.values()), None)
        summary = summarised(name, folder, tracks, self.total, unfinished=not complete, stature=stature)
        for warning in track_warnings(summary, [float(body.height) for body in bodies.values()]):
            warnings.warn(warning, stacklevel=4)
        return summary

    def _warn(self) -> None:
        """Warn of a recording that is not plausible, on the screen and in the run's log."""
        for concern in plausibility(self.recording):
            logger.warning("%s: %s", self.recording.name, concern.text)
            warnings.warn(concern.warning(self.recording.name), stacklevel=5)

    def _second_pass(self, sink: RunSink, workers: int, recipe: TrackerRecipe | None) -> SecondPass | None:
        """Return the second pass, or None for a tracker with one pass or a watcher."""
        tracker = self.tracker
        if self.watcher is not None or not isinstance(tracker, SearchingTracker) or tracker.passes < 2:
            return None
        return SecondPass(self.folder, tracker, self.recording, self.floor, sink, workers, recipe)

    def _first_pass(
        self, sink: RunSink, stop: threading.Event, second: SecondPass | None
    ) -> tuple[dict[int, Body], int]:
        """Run the first pass; return the bodies of the people and the number of frames."""
        recording, people = self.recording, self._restored(sink)
        if second is not None:
            people.sightings = second.sightings(people.frames)
        logger.info("%s: tracking frames %d to %d", recording.name, people.frames, self.total)
        if self.watcher is not None:
            self.watcher.begin(frame_rate_of(recording.timestamps), people.bodies.get(1), sink.past())
        try:
            self._follow(people, sink, stop)
        except RecordingError:
            if people.settled and sink.begun:
                sink.finish(people.bodies, complete=False)
            raise
        bodies, evidence, complete = people.bodies, people.finder.evidence, people.frames == self.total
        if complete:
            sink.remove_furniture(evidence)
            bodies = {person: body for person, body in bodies.items() if person not in furniture(evidence)}
        if second is not None and people.sightings is not None and complete:
            before = list(sightings_before(recording, people.finder, people.sightings, bodies))
            people.sightings.close()  # flush the rows before a state that depends on them
            second.begin(bodies, evidence, before)
        return bodies, people.frames

    def _follow(self, people: MultiPersonTracker, sink: RunSink, stop: threading.Event) -> None:
        """Track from the next frame to the last one, or until a stop is requested."""
        recording, remembered, measured = self.recording, time.monotonic(), people.frames > 0
        self.report(recording.name, "tracking" if measured else "learning", people.frames, self.total)
        for frame in recording.stream(people.frames, color=people.joints.needs_color):
            if stop.is_set():
                break
            measured = measured or bool(frame.depth_mm.any())
            self._write(people.step(frame), people, sink)
            self.report(recording.name, "tracking" if people.settled else "learning", people.frames, self.total)
            if people.settled and time.monotonic() - remembered > MEMORY_SECONDS:
                self._remember(people, sink)
                remembered = time.monotonic()
        if people.settled and people.frames < self.total:
            self._remember(people, sink)
        # During body estimation there is no state to resume from: `resume` computes these rows again.
        self._write(people.finish(), people, sink)
        if stop.is_set():
            return
        if not measured:
            raise RecordingError(
                f"no frame of {recording.name} holds a measurement, only 0 or 65535; record it again, or see its unit"
            )
        if self.watcher is not None:
            self.watcher.end()
        if people.frames < self.total:
            raise RecordingError(
                f"{recording.name} ended after {people.frames} of {self.total} frames; "
                "copy it again and continue with --resume"
            )

    def _write(self, rows: list[Row], people: MultiPersonTracker, sink: RunSink) -> None:
        sink.write(rows)
        if self.watcher is not None:
            for row in rows:
                self.watcher.row(row.result, row.timestamp, people.bodies[row.person])

    def _remember(self, people: MultiPersonTracker, sink: RunSink) -> None:
        sink.keep()
        if people.sightings is not None:
            people.sightings.flush()
        save_checkpoint(self.folder / STATE_FILE, self.tracker.settings.tracker, people)

    def _restored(self, sink: RunSink) -> MultiPersonTracker:
        """Return the tracker of the people restored from the last stored state; later rows are computed again.

        If rows before the state are missing, for example after a power failure, all rows are computed again.
        """
        recording, path = self.recording, self.folder / STATE_FILE
        finder = find(recording, self.count, self.tracker.settings.sensing)
        people = MultiPersonTracker(self.tracker, finder, recording.up_camera, self.joints, self.floor)
        if sink.begun and os.path.lexists(path):
            state = load_checkpoint(path, self.tracker.settings.tracker)
            try:
                known, frames = state["followers"], len(state["timestamps"])
                if not known or frames <= sink.rows(known):
                    people.restore_state(state)
            except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
                raise TrackError(f"cannot resume from {path} ({error}); {HINT}") from error
            if people.timestamps != recording.timestamps[: people.frames].tolist():
                raise TrackError(f"{path} is of another recording; {HINT}")
        sink.cut(people.frames, people.bodies)
        return people
