"""The run that is to be stabilised: its track, its recording, its tracker, its body."""

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

SOLES = 0.05
"""Share of the tracked soles that may lie below the floor where none is seen."""


class FloorHeight(NamedTuple):
    """Metres, y of the floor in the level frame, and how it is known."""

    height: float
    source: str


@dataclass(frozen=True, eq=False)
class SourceRun:
    """A finished run and what it was made from.

    Attributes
    ----------
    run : its folder
    track, info, body, recording : as it left them
    tracker : with the run's settings and database
    """

    run: Path
    track: Track
    info: RunInfo
    body: Body
    recording: Recording
    tracker: HybridTracker

    @property
    def present(self) -> np.ndarray:
        """Bool (T,): frames in which the person was followed."""
        return self.track.state == TRACKED

    @cached_property
    def floor(self) -> FloorHeight:
        """The floor under the person: as the run or the recording knows it, else below nearly all tracked soles."""
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
        return FloorHeight(float(np.quantile(heights, SOLES)) if heights else 0.0, "soles")


def open_source(
    run: str | Path, *, recording: str | Path | None = None, database: str | Path | None = None
) -> SourceRun:
    """A run folder with everything that tracking again needs.

    Parameters
    ----------
    run : of one person, by a hybrid tracker
    recording, database : where they have been moved to

    Raises
    ------
    TrackError
        There is no finished run, or it has no settings.
    RecordingError, DatabaseError
        What it was made from is gone or has changed.
    UsageError
        It is one of several people's, or of a tracker that takes no guide.
    """
    folder = Path(run)
    track, info = Track.load(folder), RunInfo.load(folder)
    if (folder.resolve().parent / PEOPLE_FILE).exists():
        raise UsageError(f"{folder} is one of several people's runs; stabilise follows one person alone")
    if info.tracker not in ("hybrid", "baak2013"):
        raise UsageError(f"{folder} was made by the tracker {info.tracker!r}; stabilise needs the hybrid one")
    config = folder / CONFIG_FILE
    if not is_inside(config):
        raise TrackError(f"{folder} holds no {CONFIG_FILE}; track the recording again")
    opened = info.open_recording(recording)
    tracker = TrackerRecipe(config, database=database or info.database).build()
    assert isinstance(tracker, HybridTracker)  # what the name stands for
    return SourceRun(folder, track, info, info.body(), opened, tracker)
