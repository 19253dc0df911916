"""Finished run that is to be stabilised, with its track, recording, tracker and body."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from toolkit.app.pipeline import TrackerRecipe
from toolkit.app.pipeline.run_writer import CONFIG_FILE
from toolkit.body.body import Body
from toolkit.body.sole import FEET, Sole
from toolkit.io.errors import RecordingError, TrackError, UsageError
from toolkit.io.safe_open import is_inside
from toolkit.people.vertical import find_vertical
from toolkit.sensing.recording import Recording
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracks import TRACKED, RunInfo, Track
from toolkit.tracks.runs import PEOPLE_FILE


class FloorHeight(NamedTuple):
    """Height of the floor (y in the level frame, metres) and its source."""

    height: float
    source: str


@dataclass(frozen=True, eq=False)
class SourceRun:
    """Finished run with its inputs.

    Attributes
    ----------
    run : run folder
    track, info, body, recording : track, description, body and recording of the run
    tracker : tracker with the run's settings and database
    """

    run: Path
    track: Track
    info: RunInfo
    body: Body
    recording: Recording
    tracker: HybridTracker

    @property
    def present(self) -> np.ndarray:
        """Bool (T,) mask of the frames with a tracked person."""
        return self.track.state == TRACKED

    @cached_property
    def floor(self) -> FloorHeight:
        """Floor under the person: from the run, else from the recording, else below nearly all tracked soles."""
        if self.info.floor:
            return FloorHeight(-self.info.floor[0], "run")
        try:
            seen = find_vertical(self.recording).height
        except RecordingError:
            seen = None
        if seen is not None:
            return FloorHeight(-seen, "recording")
        soles = [Sole.of(self.body, leg) for leg in FEET]
        heights = [sole.at(self.body, pose)[:, 1].min() for pose in self.track.pose[self.present] for sole in soles]
        floor_quantile = 0.05  # quantile of the heights of the tracked soles that replaces an unobserved floor
        return FloorHeight(float(np.quantile(heights, floor_quantile)) if heights else 0.0, "soles")


def open_source(
    run: str | Path, *, recording: str | Path | None = None, database: str | Path | None = None
) -> SourceRun:
    """Open a run folder with everything that a second tracking needs.

    Parameters
    ----------
    run : run folder of one person by the hybrid tracker
    recording, database : new paths, if they were moved

    Raises
    ------
    TrackError
        There is no finished run, or it has no settings.
    RecordingError, DatabaseError
        The recording or the database is missing or has changed.
    UsageError
        The run has several people, or its tracker takes no guide.
    """
    folder = Path(run)
    track, info = Track.load(folder), RunInfo.load(folder)
    if (folder.resolve().parent / PEOPLE_FILE).exists():
        raise UsageError(f"{folder} is one of several people's runs; stabilise needs the run of one person")
    if info.tracker not in ("hybrid", "baak2013"):
        raise UsageError(f"{folder} was made by the tracker {info.tracker!r}; stabilise needs the hybrid one")
    config = folder / CONFIG_FILE
    if not is_inside(config):
        raise TrackError(f"{folder} holds no {CONFIG_FILE}; track the recording again")
    opened = info.open_recording(recording)
    tracker = TrackerRecipe(config, database=database or info.database).build()
    assert isinstance(tracker, HybridTracker)  # by its name
    return SourceRun(folder, track, info, info.body(), opened, tracker)
