"""Joints in the image, and their back-projection with the depth (Qammaz, 2.2)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import RecordingError
from toolkit.sensing.camera import Camera

HALF_LIMBS = {
    "head": 0.09, "shoulder": 0.07, "elbow": 0.04, "wrist": 0.03, "hand": 0.02,
    "hip": 0.10, "knee": 0.05, "ankle": 0.04, "foot": 0.03,
}  # fmt: skip
"""Metres from the visible skin to the joint behind it."""
MIN_JOINT_CONFIDENCE = 0.3
"""Smallest confidence of a detected joint."""

_JOINTS = skeleton.REPORTED
BEHIND_SKIN: np.ndarray = np.array([HALF_LIMBS.get(name.split("_")[-1], np.nan) for name in _JOINTS])
"""Metres from the skin to each reported joint (20,), NaN for the derived ones."""


class Joints2D(NamedTuple):
    """Reported joints of one person in an image, in the order of `skeleton.REPORTED`.

    Attributes
    ----------
    pixels : float32 (20, 2), u and v in pixels of the depth image, NaN = unknown
    confidence : float32 (20,), 0 to 1, 0 = unknown
    """

    pixels: np.ndarray
    confidence: np.ndarray

    @classmethod
    def of_rows(cls, rows: np.ndarray) -> Joints2D:
        """Return the joints of float (20, 3): u, v, confidence, the format of a recording."""
        pixels, confidence = rows[:, :2].astype(np.float32), rows[:, 2].astype(np.float32)
        unknown = ~(np.isfinite(rows).all(axis=1) & (confidence > 0))
        pixels[unknown], confidence[unknown] = np.nan, 0.0
        return cls(pixels, np.clip(confidence, 0.0, 1.0))

    @property
    def rows(self) -> np.ndarray:
        """Float32 (20, 3): u, v, confidence, NaN where unknown."""
        rows = np.concatenate([self.pixels, self.confidence[:, None]], axis=1)
        return np.where(self.confidence[:, None] > 0, rows, np.float32(np.nan))

    @property
    def sure(self) -> np.ndarray:
        """Bool (20,) mask of the detected joints."""
        return self.confidence >= MIN_JOINT_CONFIDENCE


class LiftedJoints(NamedTuple):
    """Joints in space.

    Attributes
    ----------
    points : float64 (20, 3), metres, NaN = unknown
    confidence : float32 (20,), 0 to 1, 0 = unknown
    """

    points: np.ndarray
    confidence: np.ndarray


def lift(joints: Joints2D, depth: np.ndarray, camera: Camera) -> LiftedJoints:
    """Return the joints on the person's surface, moved behind it by half a limb: camera frame.

    An approximation: if an object occludes a joint, the surface of the object is taken instead.

    Parameters
    ----------
    joints : in pixels of `depth`
    depth : float32 (H, W), metres along z, 0 = not the person
    camera : camera of that depth, without lens distortion
    """
    height, width = depth.shape
    u, v = joints.pixels[:, 0].astype(np.float64), joints.pixels[:, 1].astype(np.float64)
    known = np.isfinite(u) & np.isfinite(v) & (joints.confidence > 0)
    column, row = (np.rint(np.where(known, np.clip(x, -9, 1 << 20), -9)).astype(np.int64) for x in (u, v))
    offsets = np.arange(-1, 2)
    columns = np.tile(column[:, None] + offsets, (1, 3))
    rows = np.repeat(row[:, None] + offsets, 3, axis=1)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    around = depth[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)].astype(np.float64)
    around = np.sort(np.where(inside & (around > 0), around, np.inf), axis=1)
    measured = np.isfinite(around).sum(axis=1)
    each = np.arange(len(around))
    skin = 0.5 * (around[each, np.maximum(measured - 1, 0) // 2] + around[each, np.minimum(measured // 2, 8)])
    z = np.where(measured > 0, skin, np.nan) + BEHIND_SKIN
    points = np.stack([(u - camera.cx) * z / camera.fx, (v - camera.cy) * z / camera.fy, z], axis=1)
    found = np.isfinite(points).all(axis=1)
    points[~found] = np.nan
    return LiftedJoints(points, np.where(found, joints.confidence, 0.0).astype(np.float32))


def check_rows(rows: np.ndarray | None, count: int, where: object) -> np.ndarray | None:
    """Return a copy as float32 (N, count, 20, 3), from that shape or (count, 20, 3) of one person.

    Raises
    ------
    RecordingError
        The shape is wrong, the values are not numbers, or a confidence is not in [0, 1].
    """
    if rows is None:
        return None
    array, expected = np.asarray(rows), (count, len(_JOINTS), 3)
    array = array[None] if array.ndim == 3 else array
    if array.dtype.kind not in "iuf" or array.ndim != 4 or array.shape[1:] != expected:
        raise RecordingError(
            f"joints_2d of {where} is {np.asarray(rows).dtype} {np.shape(rows)}; expected numbers {expected}: u, v, "
            "confidence of the 20 reported joints, or one such array for each of N people"
        )
    confidence = array[..., 2][np.isfinite(array[..., 2])]
    if confidence.size and not (0.0 <= confidence.min() and confidence.max() <= 1.0):
        wrong = confidence.min() if confidence.min() < 0 else confidence.max()
        raise RecordingError(f"joints_2d of {where} holds a confidence of {wrong:g}; give values from 0 to 1")
    return array.astype(np.float32)


def mirrored_rows(rows: np.ndarray, width: int) -> np.ndarray:
    """Return rows (..., 20, 3) of a mirrored image, converted to the unmirrored image of `width` pixels.

    A detector on a mirrored image exchanges left and right.
    """
    flipped = rows[..., skeleton.OTHER_SIDE, :].copy()
    flipped[..., 0] = width - 1 - flipped[..., 0]
    return flipped


def rotated_rows(rows: np.ndarray, camera: Camera, turns: int) -> np.ndarray:
    """Return rows (..., 20, 3) of `camera`, converted to the camera `rotated` by `turns` quarters."""
    turned, height = rows.copy(), camera.height
    for _ in range(turns % 4):
        turned[..., :2] = np.stack([height - 1 - turned[..., 1], turned[..., 0]], axis=-1)
        height = camera.width if height == camera.height else camera.height
    return turned


def same_rays(pixels: np.ndarray, here: Camera, there: Camera) -> np.ndarray:
    """Return pixels (N, 2) of one camera in the image of another at the same place: float32 (N, 2), lenses included."""
    seen = np.full((len(pixels), 2), np.nan)
    known = np.isfinite(pixels).all(axis=1)
    if not known.any():
        return seen.astype(np.float32)
    slopes = (np.asarray(pixels, dtype=np.float64)[known] - (here.cx, here.cy)) / (here.fx, here.fy)
    if here.distortion != there.distortion:
        import cv2

        if here.distortion is not None:
            slopes = np.asarray(cv2.undistortPoints(slopes[:, None], np.eye(3), np.asarray(here.distortion)))[:, 0]
        if there.distortion is not None:
            rays = np.concatenate([slopes, np.ones((len(slopes), 1))], axis=1)
            bent = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.eye(3), np.asarray(there.distortion))
            slopes = np.asarray(bent[0])[:, 0]
    seen[known] = slopes * (there.fx, there.fy) + (there.cx, there.cy)
    return seen.astype(np.float32)
