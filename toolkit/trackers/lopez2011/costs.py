"""Cost of upper-body poses for a frame (Lopez-Mendez 2011, 2.1, Eq. 3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.fitting.terms import SOFT
from toolkit.io.errors import SettingsError
from toolkit.kernels import linear
from toolkit.kernels.fit import particles as kernel
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import marked
from toolkit.trackers.lopez2011.upper import UpperBody

ARM_MARGIN = 0.15
"""Margin around an arm's joints and its candidates, metres: contains the proposed hands."""
TRUNK_JOINTS: np.ndarray = np.array(
    [skeleton.REPORTED.index(n) for n in ("spine", "neck", "head", "left_shoulder", "right_shoulder")]
)
"""Indices of the reported joints of the trunk."""


class ParticleImage(NamedTuple):
    """A frame at one resolution: `seen` float32 (h, w) as `Scene.seen`, and intrinsics float64 (4,)."""

    seen: np.ndarray
    intrinsics: np.ndarray

    @classmethod
    def of(cls, depth: np.ndarray, unobserved: np.ndarray | None, camera: Camera, columns: int) -> ParticleImage:
        """Return every n-th pixel of a depth image (H, W), metres, with at least about `columns` columns.

        Raises
        ------
        SettingsError
            The image has fewer columns than `columns`, the setting `particles.columns`.
        """
        if columns > camera.width:
            raise SettingsError(f"particles.columns is {columns}, finer than the image with {camera.width} columns")
        step = max(1, camera.width // columns)
        seen = (depth if unobserved is None else marked(depth, unobserved, np.nan))[::step, ::step]
        return cls(
            np.ascontiguousarray(seen, dtype=np.float32), np.array(camera.subsampled(step).intrinsics, dtype=np.float64)
        )

    def whole(self) -> kernel.Tile:
        """Return the whole image."""
        height, width = self.seen.shape
        return self._within(np.array([0, height, 0, width]))

    def tile(self, points: np.ndarray, margin: float) -> kernel.Tile:
        """Return the part of the image within `margin` metres of points (N, 3), camera frame; empty outside it."""
        fx, fy, cx, cy = self.intrinsics
        height, width = self.seen.shape
        ahead = points[points[:, 2] > kernel.NEAREST]
        window = np.zeros(4, dtype=np.int64)
        if len(ahead):
            z = ahead[:, 2]
            u, v = fx * ahead[:, 0] / z + cx, fy * ahead[:, 1] / z + cy
            rows, columns = fy * margin / z, fx * margin / z
            ends = np.array([(v - rows).min(), (v + rows).max() + 1, (u - columns).min(), (u + columns).max() + 1])
            window = np.clip(ends, 0, [height, height, width, width]).astype(np.int64)
        return self._within(window)

    def _within(self, window: np.ndarray) -> kernel.Tile:
        """Return rows `window[0]` to `window[1]` and columns `window[2]` to `window[3]` of the image."""
        part = self.seen[window[0] : window[1], window[2] : window[3]]
        pixels = max(int(np.count_nonzero(part > 0)), 1)
        # Weights of the mean squared depth difference in units of the cap (`lambda_1`), and of the silhouette
        # mismatch (`lambda_2`), which is half of the former.
        depth, silhouette = 40.0, 20.0
        cap = 0.10  # cap of a depth difference (`d_max`), metres: the width of a limb
        return kernel.Tile(self.seen, self.intrinsics, window, pixels, cap, depth, silhouette)


class ParticleFrame(NamedTuple):
    """A frame as input of the filter.

    Attributes
    ----------
    image : image that poses are weighed in
    candidates : float64 (M, 3), metres, level frame, where hands may be
    """

    image: ParticleImage
    candidates: np.ndarray


def likelihood(costs: np.ndarray) -> np.ndarray:
    """Return the weights (N,), sum 1, of costs (N,) (Eq. 3); a constant in all costs has no effect."""
    weights = np.exp(-(costs - costs.min()))
    return weights / weights.sum()


def costs_of_both_arms(upper: UpperBody, poses: np.ndarray, frame: ParticleFrame) -> np.ndarray:
    """Return the costs (N,) of `poses` (N, P) with one trunk over the whole image."""
    return _over_one_trunk(upper, poses, frame.image.whole())


def mean_cost(upper: UpperBody, pose: np.ndarray, frame: ParticleFrame) -> float:
    """Return the mean cost of a pose (P,) over the three layers (last term of Eq. 7)."""
    trunk = costs_of_trunks(upper, pose[None], pose, frame)
    arms = [
        _over_one_trunk(upper, pose[None], frame.image.tile(_arm_joints(upper, side, pose), ARM_MARGIN))
        for side in range(2)
    ]
    return float(trunk[0] + arms[0][0] + arms[1][0]) / 3.0


def costs_of_trunks(upper: UpperBody, poses: np.ndarray, before: np.ndarray, frame: ParticleFrame) -> np.ndarray:
    """Return the trunk costs (N,) of `poses` (N, P) around the trunk of the pose `before` (P,)."""
    trunk_margin = 0.22  # margin around the trunk's joints for the trunk cost, metres at their depth: half a shoulder
    costs = np.empty(len(poses))
    tile = frame.image.tile(_joints(upper, before, TRUNK_JOINTS), trunk_margin)
    kernel.trunk_costs(poses, upper.whole, tile, costs)
    return costs


def trunk_pictures(upper: UpperBody, poses: np.ndarray, frame: ParticleFrame) -> np.ndarray:
    """Draw the trunks of `poses` (K, P) into the image, (K, h, w), metres."""
    return _trunk_pictures(upper, poses, frame.image.whole())


def costs_of_arm(
    upper: UpperBody, poses: np.ndarray, side: int, before: np.ndarray, frame: ParticleFrame, base_of: np.ndarray,
    pictures: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the costs (N,) of `poses` (N, P) around one arm, over the drawn trunks `pictures` (K, h, w)."""
    return _overlaid(upper, poses, _around(upper, side, before, frame), base_of, pictures)


def _around(upper: UpperBody, side: int, pose: np.ndarray, frame: ParticleFrame) -> kernel.Tile:
    """Return the part of the image around one arm and the candidates within its reach."""
    joints, arm = _arm_joints(upper, side, pose), upper.arms[side]
    candidates = linear.rotated(frame.candidates, upper.whole.from_level.T)
    lengths = linear.lengths(np.stack([arm.bones.upper, arm.fore, arm.hand]))
    near = linear.lengths(candidates - joints[0]) < lengths.sum() + ARM_MARGIN
    return frame.image.tile(np.concatenate([joints, candidates[near]]), ARM_MARGIN)


def _trunk_pictures(upper: UpperBody, poses: np.ndarray, tile: kernel.Tile) -> np.ndarray:
    pictures = np.empty((len(poses), *tile.seen.shape))
    kernel.draw_bases(poses, upper.trunk, tile, pictures)
    return pictures


def _over_one_trunk(upper: UpperBody, poses: np.ndarray, tile: kernel.Tile) -> np.ndarray:
    picture = _trunk_pictures(upper, poses[:1], tile)
    return _overlaid(upper, poses, tile, np.zeros(len(poses), dtype=np.int64), picture)


def _overlaid(
    upper: UpperBody, poses: np.ndarray, tile: kernel.Tile, base_of: np.ndarray, pictures: np.ndarray
) -> np.ndarray:
    """Return the costs (N,) of `poses` (N, P) with arms drawn as balls over the trunks `pictures` (K, h, w)."""
    balls = np.empty((len(poses), len(upper.trunk.radii), 3))
    kernel.place_balls(poses, upper.trunk, balls)
    rows = np.concatenate(upper.of_arm)
    costs, overlap = np.empty(len(poses)), np.empty(len(poses))
    arms = np.ascontiguousarray(balls[:, rows])
    kernel.overlay_costs(arms, upper.trunk.radii[rows], base_of, pictures, tile, costs)
    kernel.overlap_costs(balls, upper.trunk.radii, upper.apart, SOFT, overlap)
    overlap_weight = 10.0  # weight of squared overlaps in units of the ball radii (`lambda_3`)
    return costs + overlap_weight * overlap


def _joints(upper: UpperBody, pose: np.ndarray, rows: np.ndarray) -> np.ndarray:
    return linear.rotated(upper.body.joint_positions(pose)[rows], upper.whole.from_level.T)


def _arm_joints(upper: UpperBody, side: int, pose: np.ndarray) -> np.ndarray:
    names = [f"{skeleton.SIDES[side]}_{name}" for name in ("shoulder", "elbow", "wrist", "hand")]
    return _joints(upper, pose, np.array([skeleton.REPORTED.index(name) for name in names]))
