"""The 40 relational quantities of whole motions in plain NumPy (thesis 2.2): reference for
`kernels.motion.relations`.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion


def plain_quantities(motion: Motion) -> np.ndarray:
    """Return float64 (40, T), F1 to F40."""
    g = Geometry(motion)
    rows = [
        *((g.vplane("neck", "right_hip", "left_hip", f"{s}_wrist", 250)) for s in ("right", "left")),
        *((g.nplane("chest", "neck", "neck", f"{s}_wrist")) for s in ("right", "left")),
        *((g.vnplane("chest", "neck", "neck", f"{s}_wrist", 250)) for s in ("right", "left")),
        *((g.angle(f"{s}_elbow", f"{s}_shoulder", f"{s}_elbow", f"{s}_wrist")) for s in ("right", "left")),
        np.abs(g.nplane("left_shoulder", "right_shoulder", "left_wrist", "right_wrist")),
        g.vnplane("left_wrist", "right_wrist", "right_wrist", "left_wrist", 100),
        *((g.vnplane(f"{s}_wrist", "root", f"{s}_wrist", "root", 0)) for s in ("right", "left")),
        *((g.speed(f"{s}_fingers", 100)) for s in ("right", "left")),
        g.plane("root", "left_hip", "left_ankle", "right_ankle"),
        g.plane("root", "right_ankle", "right_hip", "left_ankle"),
        *((g.height(f"{s}_toes")) for s in ("right", "left")),
        np.abs(g.nplane("left_hip", "right_hip", "left_ankle", "right_ankle")),
        *((g.angle(f"{s}_knee", f"{s}_hip", f"{s}_knee", f"{s}_ankle")) for s in ("right", "left")),
        g.nplane("left_hip", "right_hip", "left_ankle", "right_ankle"),
        g.vnplane("left_hip", "right_hip", "right_ankle", "left_ankle", 100),
        g.vnplane("left_hip", "right_hip", "left_ankle", "right_ankle", 100),
        *((np.minimum(g.speed(f"{s}_toes", 100), g.speed(f"{s}_ankle", 100))) for s in ("right", "left")),
        *((g.angle("root", "neck", f"{s}_shoulder", f"{s}_elbow")) for s in ("right", "left")),
        *((g.angle("root", "neck", f"{s}_knee", f"{s}_hip")) for s in ("right", "left")),
        g.plane("left_ankle", "neck", "right_ankle", "root"),
        g.incline("root", "neck"),
        *((g.height(f"{s}_fingers", (f"{s}_fingers", f"{s}_wrist"))) for s in ("right", "left")),
        g.shoulder_turn(),
        -g.shoulder_turn(),
        g.vertical_extent(),
        g.ground_extent("left_ankle", "right_ankle", "left_wrist", "right_wrist", "headtop", "root"),
        g.speed("root", 0),
        g.yaw_rate(),
    ]
    return np.stack([np.broadcast_to(row, len(motion)) for row in rows])


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
        """Return the distance of the left shoulder in front of the right one, along the forward normal of hips and
        neck.
        """
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
