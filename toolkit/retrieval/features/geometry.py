"""What relational features measure: body lengths, planes, angles and velocities of one motion (thesis 2.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion


@dataclass(frozen=True)
class BodyLengths:
    """The actor's own units of length, in the unit of the motion's positions; all measured in one frame."""

    humerus_right: float
    humerus_left: float
    shoulders: float
    hips: float
    chest_neck: float
    body: float

    @classmethod
    def of(cls, motion: Motion) -> BodyLengths:
        """Measure the first frame; the body's length is that of right leg and spine, without the drop to the hips."""
        point = dict(zip(NAMED_JOINTS, motion.joints[0], strict=True))

        def length(*chain: str) -> float:
            steps = zip(chain[:-1], chain[1:], strict=True)
            return float(sum(np.linalg.norm(point[a] - point[b]) for a, b in steps))

        return cls(
            humerus_right=length("right_shoulder", "right_elbow"),
            humerus_left=length("left_shoulder", "left_elbow"),
            shoulders=length("left_shoulder", "right_shoulder"),
            hips=length("left_hip", "right_hip"),
            chest_neck=length("chest", "neck"),
            body=length("right_ankle", "right_knee", "right_hip")
            + length("root", "belly", "chest", "neck", "head", "headtop"),
        )

    def symmetric(self) -> BodyLengths:
        """Both arms with their mean length: left and right features become mirror images (F1 and F2 excepted)."""
        mean = 0.5 * (self.humerus_right + self.humerus_left)
        return replace(self, humerus_right=mean, humerus_left=mean)

    def unit(self, name: str) -> float:
        """Length of HR, HL, SW, HW, CN or BL; 1 for degrees."""
        return {
            "HR": self.humerus_right, "HL": self.humerus_left, "SW": self.shoulders, "HW": self.hips,
            "CN": self.chest_neck, "BL": self.body, "deg": 1.0,
        }[name]  # fmt: skip


class Geometry:
    """Planes, angles and velocities of one motion; every quantity is float64 (T,), every vector float64 (3, T)."""

    def __init__(self, motion: Motion) -> None:
        self.rate = motion.frame_rate
        self.positions = np.ascontiguousarray(motion.joints.transpose(1, 2, 0), dtype=np.float64)
        axis = motion.root_axis
        self.root_axis = self["left_hip"] - self["right_hip"] if axis is None else np.ascontiguousarray(axis.T)
        self._velocities: dict[tuple[str, float], np.ndarray] = {}

    def __getitem__(self, joint: str) -> np.ndarray:
        return self.positions[_INDEX[joint]]

    def normal(self, a: str, b: str, c: str) -> np.ndarray:
        """Unit normal of the plane through joints a, b, c, along (a - c) x (b - c)."""
        return _unit(_cross(self[a] - self[c], self[b] - self[c]))

    def direction(self, a: str, b: str) -> np.ndarray:
        """Unit vector from a to b."""
        return _unit(self[b] - self[a])

    def velocity(self, joint: str, smoothing_ms: float) -> np.ndarray:
        """Forward difference of a joint's position per second, then a box average over `smoothing_ms`."""
        key = (joint, smoothing_ms)
        if key not in self._velocities:
            self._velocities[key] = smoothed_velocity(self[joint], self.rate, smoothing_ms)
        return self._velocities[key]

    def plane(self, a: str, b: str, c: str, q: str) -> np.ndarray:
        """PLANE(a, b, c; q): signed distance of q from the plane."""
        return _dot(self.normal(a, b, c), self[q] - self[c])

    def nplane(self, a: str, b: str, c: str, q: str) -> np.ndarray:
        """NPLANE(a > b; c; q): signed distance of q from the plane through c whose normal points from a to b."""
        return _dot(self.direction(a, b), self[q] - self[c])

    def vplane(self, a: str, b: str, c: str, q: str, ms: float) -> np.ndarray:
        """VPLANE(a, b, c; q): smoothed velocity of q - c along the normal of PLANE(a, b, c)."""
        return _dot(self.normal(a, b, c), self.velocity(q, ms) - self.velocity(c, ms))

    def vnplane(self, a: str, b: str, c: str, q: str, ms: float) -> np.ndarray:
        """VNPLANE(a > b; c; q): smoothed velocity of q - c along the direction from a to b."""
        return _dot(self.direction(a, b), self.velocity(q, ms) - self.velocity(c, ms))

    def speed(self, q: str, ms: float) -> np.ndarray:
        """SPEED(q): length of the smoothed velocity."""
        return _norm(self.velocity(q, ms))

    def angle(self, a: str, b: str, c: str, d: str) -> np.ndarray:
        """ANGLE(b - a, d - c) between the vectors from a to b and from c to d, degrees, 0 to 180."""
        return _angle(self[b] - self[a], self[d] - self[c])

    def incline(self, a: str, b: str) -> np.ndarray:
        """Angle between the vector from a to b and the vertical, degrees, 0 to 180."""
        return _angle(self[b] - self[a], np.array([[0.0], [1.0], [0.0]]))

    def height(self, q: str, without: tuple[str, ...] = ()) -> np.ndarray:
        """Height of q above the lowest named joint, some joints left out."""
        kept = [i for name, i in _INDEX.items() if name not in without]
        return self[q][1] - self.positions[kept, 1].min(axis=0)

    def vertical_extent(self) -> np.ndarray:
        """Highest minus lowest y of all named joints."""
        heights = self.positions[:, 1]
        return heights.max(axis=0) - heights.min(axis=0)

    def ground_extent(self, *joints: str) -> np.ndarray:
        """Largest distance in the ground plane between any two of the joints."""
        ground = [self[joint][::2] for joint in joints]
        return np.sqrt(np.max([np.square(a - b).sum(axis=0) for a, b in combinations(ground, 2)], axis=0))

    def shoulder_turn(self) -> np.ndarray:
        """How far the left shoulder is before the right one, along the forward normal of the hips and the neck."""
        normal = self.normal("right_hip", "left_hip", "neck")
        return _dot(normal, self["left_shoulder"] - self["right_shoulder"])

    def yaw_rate(self) -> np.ndarray:
        """Unsigned turn of the root's x axis in the ground plane, degrees per second; 0 in the last frame."""
        x, z = self.root_axis[0], self.root_axis[2]
        turn = np.arctan2(x[:-1] * z[1:] - z[:-1] * x[1:], x[:-1] * x[1:] + z[:-1] * z[1:])
        return np.append(np.abs(np.degrees(turn)) * self.rate, 0.0)


def smoothed_velocity(positions: np.ndarray, rate: float, smoothing_ms: float) -> np.ndarray:
    """Velocity (..., T) of positions (..., T): forward difference, last value repeated, then a box average.

    The window has `ceil(smoothing_ms * rate)` frames, the ends are mirrored. An odd window is centred on the frame, an
    even one reaches one value further into the future.
    """
    velocity = np.zeros_like(positions)
    if positions.shape[-1] > 1:
        np.subtract(positions[..., 1:], positions[..., :-1], out=velocity[..., :-1])
        velocity[..., -1] = velocity[..., -2]
        velocity *= rate
    window = max(1, int(np.ceil(smoothing_ms * rate / 1000.0 - 1e-9)))
    if window == 1:
        return velocity
    ends = [(0, 0)] * (velocity.ndim - 1) + [((window - 1) // 2 + 1, window // 2)]
    sums = np.pad(velocity, ends, mode="symmetric")
    np.cumsum(sums, axis=-1, out=sums)
    return (sums[..., window:] - sums[..., :-window]) / window


_INDEX: dict[str, int] = {name: index for index, name in enumerate(NAMED_JOINTS)}


def _dot(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _norm(u: np.ndarray) -> np.ndarray:
    return np.sqrt(_dot(u, u))


def _unit(u: np.ndarray) -> np.ndarray:
    """Unit vectors; a vector without direction stays zero, so that its features are those of distance 0."""
    length = _norm(u)
    return u / np.where(length > 0, length, 1.0)


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])


def _angle(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    cosine = _dot(_unit(u), _unit(v))
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
