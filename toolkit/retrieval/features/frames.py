"""Relational features of single frames, equal to those of whole motions (`relational`)."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.kernels.motion import relations as r
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion, points_of_body
from toolkit.retrieval.features.relational import FEATURES, program

_TESTS = {"<": r.BELOW, "<=": r.AT_MOST, ">": r.ABOVE, ">=": r.AT_LEAST, "within": r.WITHIN}


class FrameFeatures:
    """Features of single frames of one body.

    Parameters
    ----------
    body : body of the poses
    frame_rate : frames a second

    Attributes
    ----------
    loose, strict : float64 (40,), thresholds in metres, metres per second or degrees, in the units of `lengths`
    """

    def __init__(self, body: Body, frame_rate: float) -> None:
        self._points, self._rate, self._body = points_of_body(body), frame_rate, body
        self._program = program(frame_rate)
        self._tests = np.array([_TESTS[feature.test] for feature in FEATURES])
        self.loose, self.strict = np.empty(len(FEATURES)), np.empty(len(FEATURES))

    def measure(self, joints: np.ndarray) -> None:
        """Set the units of length from named joints (24, 3)."""
        lengths = BodyLengths.of(Motion("now", joints[None], self._rate))
        units = np.array([lengths.unit(feature.unit) for feature in FEATURES])
        self.loose[:] = [feature.loose for feature in FEATURES] * units
        self.strict[:] = [feature.strict for feature in FEATURES] * units

    def joints(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return named joints (24, 3), metres, and the root's x axis (3,) of a pose (P,), in its frame."""
        joints, axis = np.empty((len(NAMED_JOINTS), 3)), np.empty(3)
        r.named_joints(
            skeleton.check_pose(pose), skeleton.PARENTS, self._body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS,
            *self._points, joints, axis,
        )  # fmt: skip
        return joints, axis

    def quantities(
        self, joints: np.ndarray, axes: np.ndarray, frame: int, rows: np.ndarray | slice = slice(None)
    ) -> np.ndarray:
        """Return the quantities of features, float64 (40,) or some, in one frame of joints (T, 24, 3)."""
        wanted = self._program[rows]
        values = np.empty(len(wanted))
        r.quantities(joints, axes, frame, self._rate, wanted, values)
        return values

    def push(self, joints: np.ndarray, axes: np.ndarray, frame: int, on: np.ndarray) -> None:
        """Update the features (40,) of the previous frame to this one, with their hysteresis."""
        r.push_tests(self.quantities(joints, axes, frame), self._tests, self.loose, self.strict, on)
