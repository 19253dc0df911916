"""The run that is to be stabilised: its track, its recording, its tracker, its body."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.body.body import Body
from toolkit.door import is_inside
from toolkit.errors import TrackError, UsageError
from toolkit.hybrid.tracker import HybridTracker
from toolkit.pipeline import TrackerRecipe
from toolkit.pipeline.sink import CONFIG_FILE
from toolkit.runs import PEOPLE_FILE
from toolkit.sensing.recording import Recording
from toolkit.track import TRACKED, RunInfo, Track


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
