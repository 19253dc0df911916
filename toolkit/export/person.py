"""One tracked person as every exporter takes them: a name, a track and the fitted body."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.body.body import Body
from toolkit.errors import UsageError
from toolkit.runs import person_runs
from toolkit.track import EMPTY, RunInfo, Track


@dataclass(frozen=True, eq=False)
class Person:
    """A track with the body that made it.

    Attributes
    ----------
    name : what the person is called in files: the folder's name
    track : one row per frame of the recording
    body : as it was fitted
    R_level_camera : float64 (3, 3), turns points from the camera frame into the level frame
    """

    name: str
    track: Track
    body: Body
    R_level_camera: np.ndarray

    @property
    def times(self) -> np.ndarray:
        """float64 (T,): seconds since the first frame."""
        return self.track.timestamps - self.track.timestamps[0]

    @property
    def joints_level(self) -> np.ndarray:
        """float64 (T, 20, 3): the reported joints in the level frame (y up), metres, NaN where nobody is there."""
        joints = self.track.joints.astype(np.float64) @ self.R_level_camera.T
        joints[self.track.state == EMPTY] = np.nan
        return joints

    def frame_rate(self) -> float:
        """Frames a second, for files that have one number for it: the median one of the track.

        Raises
        ------
        UsageError
            There are fewer than two frames, or their times do not grow.
        """
        steps = np.diff(self.track.timestamps)
        if len(steps) == 0 or not np.median(steps) > 0:
            raise UsageError(
                f"{self.name} has {len(self.track)} frames whose times do not grow; a file with a frame rate needs two "
                "that do, export it as .csv or .json"
            )
        return float(1.0 / np.median(steps))


def load_persons(run: str | Path) -> tuple[Person, ...]:
    """Everybody in a run folder, in order of appearance.

    Raises
    ------
    TrackError
        A folder holds no finished track, or `people.json` is damaged.
    UsageError
        A track has no frames, or nobody was found.
    """
    people = []
    for folder in person_runs(run):
        track, info = Track.load(folder), RunInfo.load(folder)
        if not len(track):
            raise UsageError(f"{folder} has no frames; there is nothing to export")
        people.append(Person(folder.resolve().name, track, info.body(), info.R_level_camera))
    if not people:
        raise UsageError(f"nobody was found in {run}; there is nothing to export")
    return tuple(people)
