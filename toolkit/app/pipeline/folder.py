"""Ownership of a run folder, and the checks before a run replaces files."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from toolkit.app.config import settings_text
from toolkit.app.pipeline.run_writer import CONFIG_FILE, finished_tracks
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.app.pipeline.watch import LOG_FILE
from toolkit.body import skeleton
from toolkit.io.checkpoint import HINT
from toolkit.io.errors import TrackError
from toolkit.io.files import check_output, sha256_of
from toolkit.io.yaml_reader import read_text
from toolkit.people.vertical import floor_height
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.recording import Recording
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import PARTIAL_FILE, RUN_FILE, TRACK_FILE, RunInfo, Track
from toolkit.tracks.runs import PEOPLE_FILE

STATE_FILE = "state.npz"
RUN_FILES = (TRACK_FILE, PARTIAL_FILE, RUN_FILE, CONFIG_FILE, LOG_FILE, STATE_FILE, PEOPLE_FILE)
"""Names of the files of a run folder."""


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
