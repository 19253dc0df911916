"""Measured points for the 3-D view of a report: near the people in each frame, and the room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording

MILLIMETRES = 1000.0
STORED_UNIT = 0.004
"""Metres per unit of a stored point, below the resolution of depth cameras."""


@dataclass(frozen=True, eq=False)
class SceneClouds:
    """Points of a page in image coordinates, int16: column and row in pixels, and depth in units of `STORED_UNIT`.

    Neighbours then differ mainly in depth, and the page needs half the bytes of 3-D points.

    Attributes
    ----------
    points : (N, 3), those near the people, frame after frame
    counts : int64 (F,), number of them in each frame
    room : (M, 3), motionless points away from people
    """

    points: np.ndarray
    counts: np.ndarray
    room: np.ndarray


def gather_clouds(recording: Recording, joints: np.ndarray, frames: range) -> SceneClouds:
    """Read the frames once and keep the points of a page.

    Parameters
    ----------
    recording : tracked recording
    joints : float (T, J, 3), joints of all people in each frame, camera frame, metres; NaN in frames without the person
    frames : numbers of the shown frames, in order
    """
    # Maximum number of points near the people in all frames; long recordings have fewer points per frame.
    total = 500_000
    # Maximum number of points near the people per frame, and of the room, for a page of some megabytes.
    near_points, most_room_points = 900, 12_000
    limit = min(near_points, max(50, total // len(frames)))
    room_frames = 7  # number of frames in the median of the room
    for_room = set(np.linspace(0, len(frames) - 1, min(room_frames, len(frames))).astype(int).tolist())
    rays = np.dstack([recording.camera.rays(), np.ones(recording.camera.shape)])
    points, counts, still = [], [], []
    shown, last = dict(zip(frames, range(len(frames)), strict=True)), max(frames)
    for i, depth in enumerate(recording.frames()):
        if i in shown:
            near = near_people(depth, rays, joints[i])
            chosen = thinned(near, limit)
            points.append(_seen(recording.camera, chosen, depth[chosen]))
            counts.append(len(points[-1]))
            if shown[i] in for_room:
                still.append(np.where(near, 0, depth))
        if i == last:
            break
    scene = median_point(np.stack([recording.background] if recording.background is not None else still))
    there = thinned(scene > 0, most_room_points)
    together = np.concatenate(points) if points else np.zeros((0, 3), dtype=np.int16)
    return SceneClouds(together, np.array(counts, dtype=np.int64), _seen(recording.camera, there, scene[there]))


def near_people(depth_mm: np.ndarray, rays: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Return the mask (H, W) of measured pixels near a joint (J, 3)."""
    reach = 0.45  # metres, the length of a forearm, so that a limb missed by the body is shown
    near = np.zeros(depth_mm.shape, dtype=bool)
    known = joints[np.isfinite(joints).all(axis=1)]
    if not len(known):
        return near
    z = depth_mm / MILLIMETRES
    low, high = known[:, 2].min() - reach, known[:, 2].max() + reach
    rows, columns = np.nonzero((z > max(low, 0.0)) & (z < high))
    points = rays[rows, columns] * z[rows, columns, None]
    distance = np.full(len(points), np.inf)
    for joint in known:
        distance = np.minimum(distance, ((points - joint) ** 2).sum(axis=1))
    near[rows, columns] = distance < reach**2
    return near


def thinned(mask: np.ndarray, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of at most `limit` pixels of a mask, on the finest regular grid."""
    too_many = max(1.0, np.count_nonzero(mask) / limit)
    down = int(np.ceil(np.sqrt(too_many)))
    across = int(np.ceil(too_many / down))
    rows, columns = np.nonzero(mask[::down, ::across])
    return rows[:limit] * down, columns[:limit] * across


def pack(points: np.ndarray) -> bytes:
    """Encode points (N, 3), int16, as compressible bytes: differences of neighbours, low bytes before high bytes."""
    # The differences wrap around, as do the sums of the decoder.
    steps = np.diff(points.astype(np.int32), axis=0, prepend=0).astype("<i2")
    halves = np.ascontiguousarray(steps.T).view(np.uint8).reshape(-1, 2)
    return halves.T.tobytes()


def median_point(images: np.ndarray) -> np.ndarray:
    """Return the median over images (K, H, W) of the non-zero pixels, 0 without any."""
    values = np.where(images > 0, images, np.nan).astype(np.float64)
    seen = np.isfinite(values).any(axis=0)
    out = np.zeros(images.shape[1:])
    out[seen] = np.nanmedian(values[:, seen], axis=0)
    return out


def _seen(camera: Camera, pixels: tuple[np.ndarray, np.ndarray], depth_mm: np.ndarray) -> np.ndarray:
    """Return points (N, 3) at rows and columns; lens distortion is corrected to half a pixel."""
    slopes = camera.rays()[pixels]
    column, row = slopes[:, 0] * camera.fx + camera.cx, slopes[:, 1] * camera.fy + camera.cy
    points = np.rint(np.column_stack([column, row, depth_mm / (MILLIMETRES * STORED_UNIT)]))
    return np.clip(points, -32768, 32767).astype(np.int16)
