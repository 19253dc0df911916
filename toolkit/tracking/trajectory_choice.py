"""Trajectories of one person: their steps on disk, and the selection between two of them.

A trajectory is a row of the track for each frame, found by following the person forwards or backwards in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from toolkit.io.checkpoint import HINT
from toolkit.io.errors import OutputError, TrackError
from toolkit.io.safe_open import open_file
from toolkit.tracks import FrameResult
from toolkit.tracks.track_writer import check_rows, row_type

SWITCH_COST = 1.0
"""Cost of a switch between two trajectories per metre between them: ten frames in which the better one is 3 cm nearer
to the measurements outweigh a jump of 30 cm.
"""


class Direction(Enum):
    """Direction of time in which a person is followed; the value is the step to the next frame."""

    FORWARD = 1
    BACKWARD = -1


@dataclass(frozen=True, eq=False)
class Step:
    """One frame of a trajectory.

    Attributes
    ----------
    result : row of the track
    cost : metres, distance of the pose from the frame
    direction : in which the person was followed to this frame
    continues : the pose continues that of the frame followed before
    rival_cost : metres, of the first pass's pose in this frame; infinite without one
    """

    result: FrameResult
    cost: float
    direction: Direction = Direction.FORWARD
    continues: bool = True
    rival_cost: float = math.inf


class TrajectoryStore:
    """Steps of one trajectory on disk, in any order of the frames.

    Parameters
    ----------
    path : made if it is missing
    stages : number of timed stages of a row
    sources : number of possible sources of a row

    Raises
    ------
    OutputError
        The file cannot be written.
    TrackError
        What is there holds what no tracker writes.
    """

    def __init__(self, path: Path, stages: int, sources: int) -> None:
        numbers = [("cost", "<f8"), ("rival_cost", "<f8"), ("direction", "i1"), ("continues", "?"), ("known", "?")]
        self._type = np.dtype([("row", row_type(stages)), *numbers])
        self._path = path
        try:
            open_file(path, "a+b", inside=True).close()
            self._file = open_file(path, "r+b", inside=True, buffering=0)
            steps = self._file.read()
        except OSError as error:
            raise OutputError(f"cannot write {path}: {error.strerror or error}; free some space") from error
        self._sources = sources
        self._check(np.frombuffer(steps, dtype=self._type, count=len(steps) // self._type.itemsize))

    def _check(self, steps: np.ndarray) -> None:
        """Raise TrackError for a row that no tracker writes: a file may be damaged or foreign."""
        check_rows(steps["row"][steps["known"]], self._sources, str(self._path))

    def packed(self, step: Step) -> np.ndarray:
        """Return a step as uint8 (N,), as stored on disk."""
        record = np.zeros((), dtype=self._type)
        for name in ("joints", "pose", "confidence", "state", "source", "stage_ms", "observed"):
            record["row"][name] = getattr(step.result, name)
        record["cost"], record["rival_cost"], record["known"] = step.cost, step.rival_cost, True
        record["direction"], record["continues"] = step.direction.value, step.continues
        return np.frombuffer(record.tobytes(), dtype=np.uint8)

    def unpacked(self, packed: np.ndarray) -> Step:
        """Return a step from `packed`."""
        record = np.frombuffer(packed.tobytes(), dtype=self._type)[0]
        direction = Direction.BACKWARD if record["direction"] < 0 else Direction.FORWARD
        costs = float(record["cost"]), float(record["rival_cost"])
        return Step(result_of(record["row"]), costs[0], direction, bool(record["continues"]), costs[1])

    def __setitem__(self, frame: int, step: Step) -> None:
        try:
            self._file.seek(frame * self._type.itemsize)
            self._file.write(self.packed(step).tobytes())
        except OSError as error:
            raise OutputError(
                f"cannot write {self._path}: {error.strerror or error}; free some space and continue with --resume"
            ) from error

    def put_back(self, frame: int, packed: np.ndarray) -> None:
        """Set a frame's step from `packed` of an interrupted run; raises TrackError for anything else."""
        step = np.asarray(packed)
        if step.dtype != np.uint8 or step.shape != (self._type.itemsize,):
            raise TrackError(f"{self._path} cannot take step {frame}; {HINT}")
        self._check(np.frombuffer(step.tobytes(), dtype=self._type))
        self[frame] = self.unpacked(step)

    def get(self, frame: int) -> Step | None:
        """Return the step of a frame; None without one."""
        self._file.seek(frame * self._type.itemsize)
        data = self._file.read(self._type.itemsize)
        if len(data) < self._type.itemsize or not np.frombuffer(data, dtype=self._type)[0]["known"]:
            return None
        return self.unpacked(np.frombuffer(data, dtype=np.uint8))

    def __getitem__(self, frame: int) -> Step:
        step = self.get(frame)
        if step is None:
            raise TrackError(f"{self._path} lacks frame {frame}; {HINT}")
        return step

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def result_of(row: np.void) -> FrameResult:
    """Return a row of the track as a result."""
    return FrameResult(
        pose=row["pose"].astype(np.float64),
        joints=row["joints"].copy(),
        confidence=row["confidence"].copy(),
        state=int(row["state"]),
        source=int(row["source"]),
        stage_ms=row["stage_ms"].copy(),
        observed=row["observed"].copy(),
    )


def apart(one: FrameResult, other: FrameResult) -> float:
    """Return the mean distance of two rows' joints, metres."""
    return float(np.linalg.norm(one.joints - other.joints, axis=1).mean())


def better_parts(
    first: np.ndarray, second: np.ndarray, gaps: np.ndarray, ends: tuple[bool, bool] = (False, False)
) -> np.ndarray:
    """Return the frames of the second of two trajectories on the cheapest path through both (Viterbi 1967).

    Parameters
    ----------
    first, second : float64 (T,), metres, cost of each frame on either trajectory
    gaps : float64 (T,), metres, between the trajectories in each frame, for the cost of a switch
    ends : True if the path may begin and end on the second trajectory, else it does on the first one

    Returns
    -------
    bool (T,)
    """
    costs = np.stack([first, second], axis=1)
    best, came = np.array([0.0, 0.0 if ends[0] else np.inf]), np.zeros((len(costs), 2), dtype=np.int64)
    for t, cost in enumerate(costs):
        switched = best[::-1] + SWITCH_COST * gaps[t]
        came[t] = np.where(switched < best, [1, 0], [0, 1])
        best = np.minimum(best, switched) + cost
    if not ends[1]:
        best[1] += SWITCH_COST * gaps[-1]
    taken, chosen = int(np.argmin(best)), np.zeros(len(costs), dtype=np.bool_)
    for t in range(len(costs) - 1, -1, -1):
        chosen[t] = taken == 1
        taken = int(came[t, taken])
    return chosen
