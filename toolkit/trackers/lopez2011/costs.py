"""Cost of upper-body poses for a frame (Lopez-Mendez 2011, 2.1, Eq. 3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.kernels import linear
from toolkit.kernels.fit import particles as kernel
from toolkit.kernels.fit.swarm import View, buffers_for
from toolkit.kernels.image.raster import NEAREST
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import marked
from toolkit.trackers.lopez2011.upper import UpperBody

ARM_MARGIN = 0.15
"""Margin around an arm's joints and its candidates, metres: contains the proposed hands."""
TRUNK_MARGIN = 0.22
"""Margin around the trunk's joints for the trunk cost, metres at their depth: half a shoulder."""
TRUNK_JOINTS: np.ndarray = np.array(
    [skeleton.REPORTED.index(n) for n in ("spine", "neck", "head", "left_shoulder", "right_shoulder")]
)
"""Indices of the reported joints of the trunk."""


class ParticleFrame(NamedTuple):
    """A frame as input of the filter.

    Attributes
    ----------
    seen : float64 (h, w), metres, as `Scene.seen`
    intrinsics : float64 (4,)
    candidates : float64 (M, 3), metres, level frame, where hands may be
    """

    seen: np.ndarray
    intrinsics: np.ndarray
    candidates: np.ndarray

    @classmethod
    def of(
        cls, depth: np.ndarray, unobserved: np.ndarray | None, camera: Camera, candidates: np.ndarray
    ) -> ParticleFrame:
        """Return the frame of a depth image (h, w), metres, of `camera`."""
        seen = depth if unobserved is None else marked(depth, unobserved, np.nan)
        return cls(seen.astype(np.float64), np.array(camera.intrinsics, dtype=np.float64), candidates)

    def window(self, points: np.ndarray, margin: float) -> np.ndarray:
        """Return the window of the image within `margin` metres of points (N, 3), camera frame; empty outside it."""
        fx, fy, cx, cy = self.intrinsics
        height, width = self.seen.shape
        ahead = points[points[:, 2] > NEAREST]
        if not len(ahead):
            return np.zeros(4, dtype=np.int64)
        z = ahead[:, 2]
        u, v = fx * ahead[:, 0] / z + cx, fy * ahead[:, 1] / z + cy
        rows, columns = fy * margin / z, fx * margin / z
        ends = np.array([(v - rows).min(), (v + rows).max() + 1, (u - columns).min(), (u + columns).max() + 1])
        return np.clip(ends, 0, [height, height, width, width]).astype(np.int64)


def likelihood(costs: np.ndarray) -> np.ndarray:
    """Return the weights (N,), sum 1, of costs (N,) (Eq. 3); a constant in all costs has no effect."""
    weights = np.exp(-(costs - costs.min()))
    return weights / weights.sum()


def costs_of(upper: UpperBody, poses: np.ndarray, frame: ParticleFrame, window: np.ndarray | None = None) -> np.ndarray:
    """Return the costs (N,) of `poses` (N, P) in a window (4,) of the image, see `ParticleFrame.window`, or in all."""
    height, width = frame.seen.shape
    window = np.array([0, height, 0, width]) if window is None else window
    pixels = max(int(np.count_nonzero(frame.seen[window[0] : window[1], window[2] : window[3]] > 0)), 1)
    # Weights of the mean squared depth difference in units of the cap (`lambda_1`), and of the silhouette
    # mismatch (`lambda_2`), which is half of the former.
    depth, silhouette = 40.0, 20.0
    cap = 0.10  # cap of a depth difference (`d_max`), metres: the width of a limb
    view = View(upper.from_level, upper.from_level, frame.intrinsics, frame.seen, cap, 0.0)
    costs = np.empty(len(poses))
    kernel.particle_costs(
        poses, upper.figure, view, upper.contacts, kernel.Tile(window, depth / pixels, silhouette / pixels),
        buffers_for(upper.figure, frame.seen.shape), costs,
    )  # fmt: skip
    return costs


def mean_cost(upper: UpperBody, pose: np.ndarray, frame: ParticleFrame) -> float:
    """Return the mean cost of a pose (P,) over the three layers (last term of Eq. 7)."""
    around = [(upper.camera_joints(pose, TRUNK_JOINTS), TRUNK_MARGIN)]
    around += [(upper.arm_joints(side, pose), ARM_MARGIN) for side in range(2)]
    return float(np.mean([costs_of(upper, pose[None], frame, frame.window(*place))[0] for place in around]))


def costs_of_trunks(upper: UpperBody, poses: np.ndarray, before: np.ndarray, frame: ParticleFrame) -> np.ndarray:
    """Return the costs (N,) of `poses` (N, P) around the trunk of the pose `before` (P,)."""
    return costs_of(upper, poses, frame, frame.window(upper.camera_joints(before, TRUNK_JOINTS), TRUNK_MARGIN))


def costs_of_arm(
    upper: UpperBody, poses: np.ndarray, side: int, before: np.ndarray, frame: ParticleFrame
) -> np.ndarray:
    """Return the costs (N,) of `poses` (N, P) around one arm of the pose `before` and the candidates within reach."""
    joints, arm = upper.arm_joints(side, before), upper.arms[side]
    candidates = linear.rotated(frame.candidates, upper.from_level.T)
    lengths = linear.lengths(np.stack([arm.bones.upper, arm.fore, arm.hand]))
    near = linear.lengths(candidates - joints[0]) < lengths.sum() + ARM_MARGIN
    return costs_of(upper, poses, frame, frame.window(np.concatenate([joints, candidates[near]]), ARM_MARGIN))
