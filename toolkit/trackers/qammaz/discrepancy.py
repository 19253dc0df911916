"""Cost of many poses for one frame: depth image and image joints (Qammaz, 2.3)."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Literal, NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.rotations import quaternions as quat
from toolkit.fitting.placed import balls_of
from toolkit.fitting.terms import CARRIERS
from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import AtLeastOne, NotNegative, Range
from toolkit.kernels.fit import swarm as kernel

WEIGHTS: dict[str, float] = {"hip": 0.2, "wrist": 1.8, "ankle": 1.8}
"""Weights of joints that detectors find less or more reliably (Qammaz, 2.3.2); 1 for the others."""
JOINT_WEIGHTS: np.ndarray = np.array([WEIGHTS.get(name.split("_")[-1], 1.0) for name in skeleton.REPORTED])


@dataclass(frozen=True)
class DiscrepancySettings:
    """Settings of the objective (Qammaz, 2.3).

    Attributes
    ----------
    figure : drawn model: 40 "balls", or the body's "mesh". Balls cost a fifth of the mesh, which the local optimisation
        uses
    width, height : size of the small image, pixels; a limb is two pixels wide
    clamp : maximum cost of a pixel, metres (T of Eq. 3, from the paper)
    depth : weight of the mean distance of pixels. All is in metres, so that a mean pixel counts as a mean joint
    joints_2d : weight of the mean distance of image joints, at the person's distance; detectors are 2 to 3 cm off for
        correct poses
    joints_3d : weight of the mean distance of joints in space; occluded ones are lifted to the occluding surface
    published : Eq. 3 to 6 as printed: joints are weighted by w_i alone, without the detector's confidence, and lie on
        the skin instead of half a limb behind it; N_P has no lower bound
    fewest : minimum number of detected joints; with fewer, no joint is used
    """

    figure: Literal["balls", "mesh"] = "balls"
    width: Annotated[int, Range(2)] = 30
    height: Annotated[int, Range(2)] = 40
    clamp: Annotated[float, Range(1e-6)] = 0.3
    depth: NotNegative = 1.0
    joints_2d: NotNegative = 0.5
    joints_3d: NotNegative = 0.2
    published: bool = False
    fewest: AtLeastOne = 6

    def __post_init__(self) -> None:
        if not self.depth + self.joints_2d + self.joints_3d:
            raise SettingsError("the weights depth, joints_2d and joints_3d are 0; one of them must be positive")


class SeenJoints(NamedTuple):
    """Detected joints of a frame, in the order of the reported joints.

    Attributes
    ----------
    slopes : float64 (20, 2), x/z and y/z of their rays
    points : float64 (20, 3), camera frame, metres, NaN for an unknown distance
    confidence : float64 (20,), in [0, 1]; 0 for a joint without detection
    """

    slopes: np.ndarray
    points: np.ndarray
    confidence: np.ndarray


class SmallImage(NamedTuple):
    """Small depth image of a person and the surroundings.

    Attributes
    ----------
    depth : float64 (h, w), metres; 0 for background, NaN for unobserved pixels
    intrinsics : float64 (4,), of its pixels, which need not be square
    distance : median depth of the person, metres
    """

    depth: np.ndarray
    intrinsics: np.ndarray
    distance: float

    @property
    def person(self) -> int:
        """Return the number of pixels of the person."""
        return int(np.count_nonzero(self.depth > 0.0))


def small_image(
    depth: np.ndarray, unobserved: np.ndarray | None, intrinsics: np.ndarray, shape: tuple[int, int]
) -> SmallImage:
    """Resample the box around a person's `depth` (H, W), metres, widened by a quarter, to `shape` pixels (h, w).

    Nearest-neighbour sampling avoids mixed depths; `unobserved` (H, W) pixels and pixels outside the image are NaN.
    """
    person = depth > 0.0
    axes, intrinsics = [], np.array(intrinsics, dtype=np.float64)
    margin = 1.25  # size of the small image's box relative to the silhouette, so that misplaced arms have a cost
    for axis, count in ((0, shape[0]), (1, shape[1])):
        there = np.flatnonzero(person.any(axis=1 - axis))
        low, high = float(there[0]) - 0.5, float(there[-1]) + 0.5
        step = margin * (high - low) / count
        start = 0.5 * (low + high) - 0.5 * margin * (high - low) + 0.5 * step
        axes.append(np.rint(start + step * np.arange(count)).astype(np.int64))
        row = 1 - axis  # index of the focal length; u is the second axis of the image
        intrinsics[row] /= step
        intrinsics[2 + row] = (intrinsics[2 + row] - start) / step
    rows, columns = axes
    inside = ((rows >= 0) & (rows < depth.shape[0]))[:, None] & (columns >= 0) & (columns < depth.shape[1])
    place = np.ix_(np.clip(rows, 0, depth.shape[0] - 1), np.clip(columns, 0, depth.shape[1] - 1))
    known = inside if unobserved is None else inside & ~unobserved[place]
    small = np.where(known, depth[place].astype(np.float64), np.nan)
    return SmallImage(small, intrinsics, float(np.median(depth[person])))


@lru_cache(maxsize=32)
def figure_of(body: Body, kind: str) -> kernel.Figure:
    """Return the drawn model of the body, `kind` as in `DiscrepancySettings.figure`."""
    balls = balls_of(body)
    drawn = slice(None) if kind == "balls" else slice(0)
    faces = body.faces.astype(np.int64) if kind == "mesh" else np.empty((0, 3), dtype=np.int64)
    return kernel.Figure(
        skeleton.PARENTS, skeleton.DOF_JOINT, skeleton.DOF_AXIS, body.joints,
        balls.joint[drawn], balls.offset[drawn], balls.radius[drawn],
        body.vertices, body.skin_joints, body.skin_weights, faces,
    )  # fmt: skip


def _targets_of(body: Body, seen: SeenJoints | None, distance: float, settings: DiscrepancySettings) -> kernel.Targets:
    """Return the detected joints of a body with their weights; none if fewer than required."""
    carriers = np.array([carrier for carrier, _ in CARRIERS])
    confidence = np.zeros(len(carriers)) if seen is None else np.where(carriers >= 0, seen.confidence, 0.0)
    rows = np.flatnonzero(confidence > 0.0)
    if seen is None or len(rows) < settings.fewest:
        rows = rows[:0]
    offset = np.zeros((len(rows), 3))
    for k, row in enumerate(rows):
        joint, site = CARRIERS[row]
        if site >= 0:
            offset[k] = body.sites[site] - body.joints[joint]
    weights = JOINT_WEIGHTS[rows] if settings.published else (JOINT_WEIGHTS * confidence)[rows]
    slopes, points = (np.zeros((0, 2)), np.zeros((0, 3))) if seen is None else (seen.slopes[rows], seen.points[rows])
    lifted = np.where(np.isfinite(points).all(axis=1), weights, 0.0)
    total = max(weights.sum(), 1e-9)  # W of Eq. 4 and of Eq. 5
    return kernel.Targets(
        carriers[rows], offset, np.ascontiguousarray(slopes, dtype=np.float64), distance,
        np.nan_to_num(np.asarray(points, dtype=np.float64)),
        settings.joints_2d * weights / total,
        settings.joints_3d * lifted / total,
    )  # fmt: skip


class Discrepancy:
    """Objective E (Qammaz, Eq. 2) of many positions for one body and one frame.

    A position is a pose with a root rotation relative to that of `around` (`kernels/fit/swarm.py`).

    Parameters
    ----------
    body : body of all positions
    image : the frame
    seen : the joints seen in it, or None
    level_rotation : R_level_camera, float64 (3, 3)
    around : float64 (P,), pose in the level frame whose root orientation is the reference
    previous : True if `around` is the previous solution, which defines N_P
    settings : weights and drawn figure
    """

    def __init__(
        self,
        body: Body,
        image: SmallImage,
        seen: SeenJoints | None,
        level_rotation: np.ndarray,
        around: np.ndarray,
        settings: DiscrepancySettings,
        *,
        previous: bool = False,
    ) -> None:
        self.settings = settings
        self._figure = figure_of(body, settings.figure)
        self._targets = _targets_of(body, seen, image.distance, settings)
        from_level = np.ascontiguousarray(level_rotation.T, dtype=np.float64)
        self._root = quat.exponential(around[skeleton.ROOT_ROTATION])
        turn = quat.matrices(self._root)
        reference = (from_level[:, :, None] * turn[None, :, :]).sum(axis=1)
        self._view = kernel.View(
            from_level, reference, image.intrinsics, image.depth, settings.clamp, settings.depth / max(image.person, 1)
        )
        self._buffers = kernel.buffers_for(self._figure, image.depth.shape)
        if previous:
            # At least half of the person, so that a lost solution does not outweigh the joints; the paper has no lower
            # bound.
            floor = 1.0 if settings.published else max(0.5 * image.person, 1.0)
            near = max(self._explained(self.position_of(around)), floor)
            self._view = self._view._replace(weight=settings.depth / near)

    @property
    def guided(self) -> bool:
        """Return whether enough joints were detected."""
        return len(self._targets.joint) > 0

    def position_of(self, poses: np.ndarray) -> np.ndarray:
        """Convert poses (..., P) to positions, with root rotations relative to the reference."""
        positions = np.array(poses, dtype=np.float64)
        turn = quat.multiply(quat.conjugate(self._root), quat.exponential(positions[..., skeleton.ROOT_ROTATION]))
        positions[..., skeleton.ROOT_ROTATION] = quat.logarithm(turn)
        return positions

    def pose_of(self, position: np.ndarray) -> np.ndarray:
        """Convert a position (P,) to a pose, level frame."""
        pose = np.array(position, dtype=np.float64)
        turn = quat.multiply(self._root, quat.exponential(pose[skeleton.ROOT_ROTATION]))
        pose[skeleton.ROOT_ROTATION] = quat.logarithm(turn)
        return pose

    def joints_alone(self) -> Discrepancy:
        """Return the same objective without the image."""
        alone = copy(self)
        alone._view = self._view._replace(weight=0.0)
        return alone

    def __call__(self, positions: np.ndarray) -> np.ndarray:
        """Return the costs of `positions` (N, P), metres: float64 (N,)."""
        out = np.empty(len(positions))
        kernel.discrepancies(positions, self._figure, self._view, self._targets, self._buffers, out)
        return out

    def _explained(self, position: np.ndarray) -> int:
        """Return N_P: the number of the person's pixels within the clamp of the model in `position` (Qammaz, 2.3.1)."""
        buffers = self._buffers
        kernel.place(position, self._figure, self._view, buffers)
        kernel.draw(self._figure, self._view, buffers)
        drawn = np.divide(1.0, buffers.inverse, out=np.zeros_like(buffers.inverse), where=buffers.inverse > 0.0)
        depth = self._view.depth
        return int(np.count_nonzero((drawn > 0.0) & (depth > 0.0) & (np.abs(depth - drawn) < self.settings.clamp)))
