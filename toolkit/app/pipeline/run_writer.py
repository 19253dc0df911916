"""Run folders: checks before a run replaces files, and the writer of a folder, or one per person."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.app.config import settings_text
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.app.pipeline.watch import LOG_FILE
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.checkpoint import HINT
from toolkit.io.errors import OutputError, TrackError, os_errors_as
from toolkit.io.files import check_output, save_text, sha256_of
from toolkit.io.yaml_reader import read_text
from toolkit.motion.contact import foot_contacts
from toolkit.people.evidence import Evidence, furniture
from toolkit.people.vertical import floor_height
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.recording import Recording
from toolkit.tracking.multi_person import Row
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import (
    EMPTY,
    LOST,
    PARTIAL_FILE,
    RUN_FILE,
    TRACK_FILE,
    TRACKED,
    FrameResult,
    RunInfo,
    Track,
    TrackWriter,
)
from toolkit.tracks.runs import PEOPLE_FILE, PersonSummary, load_people, save_people

CONFIG_FILE, STATE_FILE = "config.yaml", "state.npz"
RUN_FILES = (TRACK_FILE, PARTIAL_FILE, RUN_FILE, CONFIG_FILE, LOG_FILE, STATE_FILE, PEOPLE_FILE)
"""Names of the files of a run folder."""


class RunSink:
    """Append-only writer of rows that survive the death of the process.

    Parameters
    ----------
    run : the run folder, made if it is missing
    tracker : tracker of the rows
    info : content of `run.json`; the shape is replaced by that of each person at the end
    several : True if each person has their own folder
    resume : continue an unfinished run

    Raises
    ------
    UsageError
        The folder holds an unfinished track and `resume` is not set.
    TrackError
        The unfinished track was written by a tracker with other stages, sources or pose entries.
    OutputError
        The folder cannot be written.
    """

    def __init__(self, run: Path, tracker: Tracker, info: RunInfo, *, several: bool, resume: bool) -> None:
        self.run, self._tracker, self._info, self._several, self._resume = run, tracker, info, several, resume
        self._writers: dict[int, TrackWriter] = {}
        self._evidence: Mapping[int, Evidence] = {}
        with os_errors_as(OutputError, f"cannot write {run}", "choose a folder that can be written"):
            run.mkdir(parents=True, exist_ok=True)
        begun = os.path.lexists(run / RUN_FILE)  # the partial files come first, because they mark the run as unfinished
        if not begun:
            self._describe(run)
        for person in self._begun() if several else [1]:
            self._open(person)
        if begun:
            self._describe(run)

    def write(self, rows: list[Row]) -> None:
        """Append rows, in frame order for each person.

        Raises
        ------
        OutputError
            A row cannot be written; those before it stay.
        """
        for row in rows:
            self._open(row.person).append(row.result, row.timestamp)

    @property
    def begun(self) -> bool:
        """Return whether rows of a person exist."""
        return any(writer.rows for writer in self._writers.values())

    def rows(self, people: Iterable[int]) -> int:
        """Return the number of frames with rows of each given person."""
        return min((self._writers[p].rows if p in self._writers else 0 for p in people), default=0)

    def keep(self) -> None:
        """Flush the rows to the disk; raises OutputError."""
        for writer in self._writers.values():
            writer.keep()

    def past(self, person: int = 1) -> np.ndarray:
        """Return the rows of a person so far, by default those of the followed person."""
        return self._open(person).past()

    def cut(self, frames: int, people: Mapping[int, Body]) -> None:
        """Truncate the rows of these people to `frames`; people with a later start are removed."""
        for person, writer in list(self._writers.items()):
            writer.cut(frames if person in people else 0)
            if self._several and person not in people:
                writer.abandon()
                del self._writers[person]

    def remove_furniture(self, evidence: Mapping[int, Evidence]) -> None:
        """Remove the people that the evidence classifies as furniture, and renumber the others 1, 2, ... at the end."""
        self._evidence = evidence
        for person in furniture(evidence):
            if self._several and person in self._writers:
                writer = self._writers.pop(person)
                writer.abandon()
                shutil.rmtree(writer.run)

    def replace(self, person: int, rows: Iterable[tuple[FrameResult, float]]) -> None:
        """Replace the rows of a person, with their timestamps; raises as `TrackWriter.replace`."""
        self._open(person).replace(rows)

    def finish(self, bodies: Mapping[int, Body], *, complete: bool) -> list[Track]:
        """Put the tracks in place with the description of each person, and return them."""
        tracks = {}
        for person, writer in sorted(self._writers.items()):
            if person in bodies:
                body = bodies[person]
                shape, scale = [float(c) for c in body.shape], float(body.scale)
                offsets = [] if body.offsets is None else [float(o) for o in body.offsets]
                replace(self._info, shape=shape, scale=scale, offsets=offsets).save(writer.run)
            path = writer.finish(complete=False, contacts=self._contacts(bodies.get(person)))
            tracks[person] = Track.load(path.parent)
        # If folders are renamed, a kill in between restarts the run; otherwise `resume` completes it.
        renumbered = complete and self._several and list(tracks) != list(range(1, len(tracks) + 1))
        if self._several and not renumbered:
            self._save_people([self._summary(p, p, track, bodies[p]) for p, track in tracks.items()])
        for writer in self._writers.values() if complete else ():  # from here on nothing is missing
            writer.forget()
        if renumbered:
            for number, person in enumerate(tracks, start=1):
                (self.run / folder_of(person)).replace(self.run / folder_of(number))
            numbered = enumerate(tracks.items(), start=1)
            self._save_people([self._summary(n, p, track, bodies[p]) for n, (p, track) in numbered])
        return list(tracks.values())

    def _contacts(self, body: Body | None) -> Callable[[Track], np.ndarray] | None:
        """Return the estimator of foot contacts of a body."""
        height = self._info.floor[0] if self._info.floor else None
        return None if body is None else lambda track: foot_contacts(body, track, height)

    def abandon(self) -> None:
        """Close the partial files; empty ones are removed."""
        for writer in self._writers.values():
            writer.abandon()

    def _open(self, person: int) -> TrackWriter:
        if person not in self._writers:
            folder = self.run / folder_of(person) if self._several else self.run
            if self._several and folder.is_symlink():
                raise OutputError(f"{folder} is a link; remove it, or choose another output")
            names = self._tracker.stage_names, self._tracker.source_names
            self._writers[person] = TrackWriter(folder, *names, resume=self._resume)
            if self._several:
                self._describe(folder)
        return self._writers[person]

    def _describe(self, folder: Path) -> None:
        self._info.save(folder)  # run.json first, because it identifies the other files
        save_text(folder / CONFIG_FILE, settings_text(self._tracker.settings))

    def _begun(self) -> list[int]:
        """Return the ids of the people with rows in an unfinished run."""
        names = [path.parent.name.split("_")[1] for path in sorted(self.run.glob(f"person_*/{PARTIAL_FILE}"))]
        return [int(name) for name in names if name.isdecimal() and folder_of(int(name)) == f"person_{name}"]

    def _save_people(self, people: Sequence[PersonSummary]) -> None:
        save_people(self.run, people, [self._evidence[p] for p in sorted(furniture(self._evidence))])

    def _summary(self, number: int, person: int, track: Track, body: Body) -> PersonSummary:
        there = np.flatnonzero(track.state != EMPTY)
        first, last = (int(there[0]), int(there[-1])) if len(there) else (0, 0)
        state = track.state[first : last + 1]
        tracked, lost, hidden = (float((state == kind).mean()) for kind in (TRACKED, LOST, EMPTY))
        stature, why = float(body.height), self._evidence.get(person)
        return PersonSummary(number, folder_of(number), first, last, stature, tracked, lost, hidden, why)


def folder_of(person: int) -> str:
    """Return the name of a person's run folder within a run of several people."""
    return f"person_{person:02d}"


def finished_tracks(run: Path, *, several: bool) -> list[Track] | None:
    """Return the tracks of a finished run, or None for an unfinished one."""
    if not several:
        whole = (run / TRACK_FILE).exists() and not (run / PARTIAL_FILE).exists()
        return [Track.load(run)] if whole else None
    if not (run / PEOPLE_FILE).exists() or any(run.glob(f"person_*/{PARTIAL_FILE}")):
        return None
    return [Track.load(run / person.folder) for person in load_people(run).people]


def check_inputs(folder: Path, recording: Recording, recipe: TrackerRecipe) -> None:
    """Raise UsageError if the run would damage the recording or the files of the tracker."""
    if not recording.in_memory:
        check_output(folder, [recording.path], sealed=[recording.path])
    for name in RUN_FILES:
        check_output(folder / name, recipe.files())


def check_run_file(folder: Path) -> None:
    """Raise TrackError if the folder holds files of a run but no `run.json`."""
    if os.path.lexists(folder / RUN_FILE):
        return
    found = [name for name in RUN_FILES if os.path.lexists(folder / name)]
    found += [path.name for path in sorted(folder.glob("person_*"))]
    if found:
        raise TrackError(
            f"{folder} holds {found[0]} and no {RUN_FILE}, so its run is unknown; choose another output, or remove it"
        )


def info_of(recording: Recording, tracker: Tracker) -> RunInfo:
    """Return the `run.json` of a new run."""
    path, height = Path(recording.path).resolve(), floor_height(recording)
    return RunInfo(
        recording=str(path),
        recording_sha256="" if recording.in_memory else sha256_of(path),
        reader_options=recording.options,
        body_fingerprint=skeleton.fingerprint(),
        shape=[],
        scale=1.0,
        database=tracker.database and str(Path(tracker.database).resolve()),
        level_rotation=level_rotation(recording.up_camera).ravel().tolist(),
        sensing=asdict(tracker.settings.sensing),
        version=version("depthmocap"),
        tracker=tracker.settings.tracker,
        seed=tracker.settings.seed,
        up_source=recording.vertical.source,
        floor=[] if height is None else [height],
    )


def tracks_of_same_run(folder: Path, info: RunInfo, tracker: Tracker, *, several: bool) -> list[Track] | None:
    """Return the tracks if the folder holds the finished run of the same inputs, else None.

    Raises
    ------
    TrackError
        The folder holds rows of another recording, database, tracker or of other settings.
    """
    if not (folder / RUN_FILE).exists():
        return None
    same, tracks = _is_same_run(folder, info, tracker), finished_tracks(folder, several=several)
    if not same and (_is_unfinished(folder) or tracks is not None):
        raise TrackError(
            f"{folder} was begun with another recording, database, tracker or other settings; remove it and track again"
        )
    return tracks if same else None


def _is_same_run(folder: Path, info: RunInfo, tracker: Tracker) -> bool:
    """Return whether a run folder belongs to this recording, database, version and these settings."""
    before, config = RunInfo.load(folder), folder / CONFIG_FILE
    facts = (
        "recording_sha256",
        "reader_options",
        "body_fingerprint",
        "database",
        "version",
        "tracker",
        "sensors_sha256",
        "joints_2d",
        "body_sha256",
    )
    return (
        all(_as_json(getattr(before, fact)) == _as_json(getattr(info, fact)) for fact in facts)
        and os.path.lexists(config)
        and read_text(config, TrackError, HINT, inside=True) == settings_text(tracker.settings)
    )


def _as_json(value: Any) -> str:
    return json.dumps(value, sort_keys=True)


def _is_unfinished(folder: Path) -> bool:
    return any(folder.glob(PARTIAL_FILE)) or any(folder.glob(f"person_*/{PARTIAL_FILE}"))
