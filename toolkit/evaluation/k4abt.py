"""Skeletons of the Azure Kinect body tracking SDK in the JSON format of its offline processor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import k4abt
from toolkit.io.errors import RecordingError
from toolkit.io.yaml_reader import read_json

HINT = "give a JSON file of the offline processor of the Azure Kinect body tracking SDK"


@dataclass(frozen=True, eq=False)
class KinectBodies:
    """Skeletons over T frames.

    Attributes
    ----------
    timestamps : float64 (T,), seconds of the device's clock
    positions : float64 (N, T, 32, 3), metres, depth camera frame, NaN while absent; joints in the order of
        `k4abt.NAMES`
    """

    timestamps: np.ndarray
    positions: np.ndarray

    @property
    def joints(self) -> np.ndarray:
        """Return the 20 reported joints, float32 (N, T, 20, 3), metres, depth camera frame."""
        return k4abt.reported(self.positions).astype(np.float32)

    def at(self, timestamps: np.ndarray) -> np.ndarray:
        """Return `joints` at the frames of a recording (T',): float32 (N, T', 20, 3), NaN without a skeleton.

        With equal frame counts, frames are matched by index. Otherwise they are matched by time, relative to the first
        frame unless the clocks agree.

        Raises
        ------
        RecordingError
            The file is longer than the recording, or fewer than half of its frames match.
        """
        joints, own = self.joints, self.timestamps
        if len(own) == len(timestamps):
            return joints
        step = float(np.median(np.diff(timestamps))) if len(timestamps) > 1 else 1.0
        best, rows = -1, np.zeros(0, dtype=np.int64)
        # Maximum difference between the times of a skeleton and a frame, as a fraction of the frame interval.
        tolerance = 0.6
        for shift in (0.0, timestamps[0] - own[0]):
            near = np.abs(timestamps[:, None] - (own + shift)[None, :])
            chosen = near.argmin(axis=1)
            hit = near[np.arange(len(timestamps)), chosen] < tolerance * step
            if hit.sum() > best:
                best, rows = int(hit.sum()), np.where(hit, chosen, -1)
        if best < 0.5 * min(len(own), len(timestamps)):
            raise RecordingError(
                f"the skeleton has {len(own)} frames, the recording {len(timestamps)}, and their times do not fit; "
                "name the right file"
            )
        found = np.full((len(joints), len(timestamps), *joints.shape[2:]), np.nan, dtype=np.float32)
        found[:, rows >= 0] = joints[:, rows[rows >= 0]]
        return found


def is_k4abt(path: Path) -> bool:
    """Return whether the name of a path fits such a file."""
    return path.suffix.lower() == ".json"


def read_k4abt(path: str | Path) -> KinectBodies:
    """Read a file of any SDK version; bodies without an id are matched by position.

    Raises
    ------
    RecordingError
        The file is missing or has another structure, a joint is missing, or a value is no number.
    """
    file = Path(path)
    content = read_json(file, RecordingError, HINT)
    if not isinstance(content, dict) or not isinstance(content.get("frames"), list) or not content["frames"]:
        raise RecordingError(f"{file} has no frames; {HINT}")
    columns = _columns(content.get("joint_names"), file)
    times: list[float] = []
    rows: list[list[tuple[int | None, np.ndarray]]] = []
    for i, frame in enumerate(content["frames"]):
        try:
            times.append(float(frame["timestamp_usec"]) / 1e6)
            rows.append([_body(body, columns) for body in frame.get("bodies") or ()])
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            raise RecordingError(f"cannot read frame {i} of {file} ({error!r}); {HINT}") from error
    return _gathered(np.array(times), rows)


def _columns(names: Any, file: Path) -> list[int]:
    """Return the index of each of `k4abt.NAMES` in a row of the file."""
    if names is None:
        return list(range(len(k4abt.NAMES)))
    if not isinstance(names, list):
        raise RecordingError(f"the joint_names of {file} are no list; {HINT}")
    known = [k4abt.OLD_NAMES.get(str(name).upper(), str(name).upper()) for name in names]
    known = [name.removeprefix("K4ABT_JOINT_") for name in known]
    if missing := [name for name in k4abt.NAMES if name not in known]:
        raise RecordingError(f"{file} has no joint {missing[0]} among its joint_names; {HINT}")
    return [known.index(name) for name in k4abt.NAMES]


def _body(body: dict[str, Any], columns: list[int]) -> tuple[int | None, np.ndarray]:
    """Return id or None and positions (32, 3), metres, of one body of a frame, joints in our order."""
    positions = np.array(body["joint_positions"], dtype=np.float64)[columns]
    if positions.shape != (len(columns), 3):
        raise ValueError(f"joints of shape {positions.shape}")
    return None if body.get("body_id") is None else int(body["body_id"]), positions / 1000.0


def _gathered(times: np.ndarray, frames: list[list[tuple[int | None, np.ndarray]]]) -> KinectBodies:
    """Return the skeletons by id; a body without id has that of the nearest previous body, or a new one."""
    from scipy.optimize import linear_sum_assignment

    fresh = max((number for frame in frames for number, _ in frame if number is not None), default=0) + 1
    found: dict[int, np.ndarray] = {}
    last: dict[int, int] = {}
    fastest = 5.0  # maximum speed of a body without id between two frames, m/s
    for t, frame in enumerate(frames):
        numbers = [number for number, _ in frame]
        unknown = [k for k, number in enumerate(numbers) if number is None]
        free = [number for number in found if number not in numbers]
        if unknown and free:
            before = np.array([found[number][last[number], 0] for number in free])
            apart = np.array([np.linalg.norm(frame[k][1][0] - before, axis=1) for k in unknown])
            reach = fastest * np.clip(times[t] - times[[last[number] for number in free]], 0.1, 1.0)
            for r, c in zip(*linear_sum_assignment(apart), strict=True):
                if apart[r, c] <= reach[c]:
                    numbers[unknown[r]] = free[c]
        for number, (_, positions) in zip(numbers, frame, strict=True):
            if number is None:
                number, fresh = fresh, fresh + 1
            found.setdefault(number, np.full((len(frames), len(k4abt.NAMES), 3), np.nan))[t] = positions
            last[number] = t
    return KinectBodies(times, np.array(list(found.values())).reshape(len(found), len(frames), len(k4abt.NAMES), 3))
