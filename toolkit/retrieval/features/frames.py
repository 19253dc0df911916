"""Relational features frame by frame: the quantities of `relational.FEATURES` as a program for the compiled kernel."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from toolkit import skeleton
from toolkit.body.body import Body
from toolkit.kernels.motion import relations as r
from toolkit.retrieval.features.geometry import BodyLengths
from toolkit.retrieval.features.motion import NAMED_JOINTS, SIDES, Motion, points_of_body
from toolkit.retrieval.features.relational import FEATURES

Row = tuple[int, tuple[str, ...], float, int]
"""Operation, points, window of velocities in milliseconds, and sign; see `relations.quantities`."""

_TESTS = {"<": r.BELOW, "<=": r.AT_MOST, ">": r.ABOVE, ">=": r.AT_LEAST, "within": r.WITHIN}
_MASKS = {r.HEIGHT: 1, r.WIDE: 0}
"""Operations of which the points from that place on are a set."""


def _row(operation: int, *points: str, ms: float = 0.0, sign: int = 1) -> Row:
    return operation, points, ms, sign


def _sides(operation: int, *points: str, ms: float = 0.0) -> list[Row]:
    """A row for the right side and one for the left; `*_` in a point stands for the side."""
    return [_row(operation, *(p.replace("*", s) for p in points), ms=ms) for s in reversed(SIDES)]


def _rows() -> list[Row]:
    """One row per feature, F1 to F40, in the order of `FEATURES`."""
    across = ("left_hip", "right_hip")
    return [
        *_sides(r.VPLANE, "neck", "right_hip", "left_hip", "*_wrist", "left_hip", ms=250),
        *_sides(r.NPLANE, "chest", "neck", "neck", "*_wrist", "neck"),
        *_sides(r.VNPLANE, "chest", "neck", "neck", "*_wrist", "neck", ms=250),
        *_sides(r.ANGLE, "*_elbow", "*_shoulder", "*_elbow", "*_wrist"),
        _row(r.NPLANE, "left_shoulder", "right_shoulder", "left_wrist", "right_wrist", "left_wrist", sign=0),
        _row(r.VNPLANE, "left_wrist", "right_wrist", "right_wrist", "left_wrist", "right_wrist", ms=100),
        *_sides(r.VNPLANE, "*_wrist", "root", "*_wrist", "root", "*_wrist"),
        *_sides(r.SPEED, "*_fingers", ms=100),
        _row(r.PLANE, "root", "left_hip", "left_ankle", "right_ankle", "left_ankle"),
        _row(r.PLANE, "root", "right_ankle", "right_hip", "left_ankle", "right_hip"),
        *_sides(r.HEIGHT, "*_toes"),
        _row(r.NPLANE, *across, "left_ankle", "right_ankle", "left_ankle", sign=0),
        *_sides(r.ANGLE, "*_knee", "*_hip", "*_knee", "*_ankle"),
        _row(r.NPLANE, *across, "left_ankle", "right_ankle", "left_ankle"),
        _row(r.VNPLANE, *across, "right_ankle", "left_ankle", "right_ankle", ms=100),
        _row(r.VNPLANE, *across, "left_ankle", "right_ankle", "left_ankle", ms=100),
        *_sides(r.SLOWER, "*_toes", "*_ankle", ms=100),
        *_sides(r.ANGLE, "root", "neck", "*_shoulder", "*_elbow"),
        *_sides(r.ANGLE, "root", "neck", "*_knee", "*_hip"),
        _row(r.PLANE, "left_ankle", "neck", "right_ankle", "root", "right_ankle"),
        _row(r.INCLINE, "root", "neck"),
        *_sides(r.HEIGHT, "*_fingers", "*_fingers", "*_wrist"),
        _row(r.PLANE, "right_hip", "left_hip", "neck", "left_shoulder", "right_shoulder"),
        _row(r.PLANE, "right_hip", "left_hip", "neck", "left_shoulder", "right_shoulder", sign=-1),
        _row(r.TALL),
        _row(r.WIDE, "left_ankle", "right_ankle", "left_wrist", "right_wrist", "headtop", "root"),
        _row(r.SPEED, "root"),
        _row(r.YAW),
    ]  # fmt: skip


@lru_cache(maxsize=16)
def program(frame_rate: float) -> np.ndarray:
    """The rows for the kernel, int64 (40, 8), at so many frames a second."""
    found = np.zeros((len(FEATURES), 8), dtype=np.int64)
    for row, (operation, points, ms, sign) in enumerate(_rows()):
        places = [NAMED_JOINTS.index(point) for point in points]
        if operation in _MASKS:
            single = _MASKS[operation]
            places = [*places[:single], sum(1 << place for place in places[single:])]
        found[row, 0], found[row, 1 : 1 + len(places)] = operation, places
        found[row, 6] = max(1, int(np.ceil(ms * frame_rate / 1000.0 - 1e-9)))
        found[row, 7] = sign
    return found


class FrameFeatures:
    """The features of single frames of one body, as `relational_features` has them for the whole.

    Parameters
    ----------
    body : whose poses will come
    frame_rate : of the frames

    Attributes
    ----------
    loose, strict : float64 (40,), thresholds in metres, metres per second or degrees; those of `lengths`
    """

    def __init__(self, body: Body, frame_rate: float) -> None:
        self._points, self._rate, self._body = points_of_body(body), frame_rate, body
        self._program = program(frame_rate)
        self._tests = np.array([_TESTS[feature.test] for feature in FEATURES])
        self.loose, self.strict = np.empty(len(FEATURES)), np.empty(len(FEATURES))

    def measure(self, joints: np.ndarray) -> None:
        """Take the units of length from named joints (24, 3)."""
        lengths = BodyLengths.of(Motion("now", joints[None], self._rate))
        units = np.array([lengths.unit(feature.unit) for feature in FEATURES])
        self.loose[:] = [feature.loose for feature in FEATURES] * units
        self.strict[:] = [feature.strict for feature in FEATURES] * units

    def joints(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Named joints (24, 3), metres, and the root's x axis (3,) of a pose (P,), in its own frame."""
        joints, axis = np.empty((len(NAMED_JOINTS), 3)), np.empty(3)
        r.named_joints(
            skeleton.check_pose(pose), skeleton.PARENTS, self._body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS,
            *self._points, joints, axis,
        )  # fmt: skip
        return joints, axis

    def quantities(
        self, joints: np.ndarray, axes: np.ndarray, frame: int, rows: np.ndarray | slice = slice(None)
    ) -> np.ndarray:
        """What features compare with their thresholds, float64 (40,), in a frame of joints (T, 24, 3), or some."""
        wanted = self._program[rows]
        values = np.empty(len(wanted))
        r.quantities(joints, axes, frame, self._rate, wanted, values)
        return values

    def push(self, joints: np.ndarray, axes: np.ndarray, frame: int, on: np.ndarray) -> None:
        """Bring the features (40,) of the frame before to this one, with their hysteresis."""
        r.push_tests(self.quantities(joints, axes, frame), self._tests, self.loose, self.strict, on)
