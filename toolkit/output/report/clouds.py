"""Measured points of a recording for the scene of a report: those near the people in every frame, and the room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording

REACH = 0.45
"""Points this near to a joint belong to the picture of a person, metres: a forearm's length, so that a limb that the
body has missed is seen too."""
POINTS, ROOM_POINTS = 900, 12_000
"""At most so many points near the people in a frame, and so many in the room: a page of some megabytes."""
TOTAL = 500_000
"""Near the people in all frames together; a long recording has fewer points a frame."""
ROOM_FRAMES = 7
"""The room is the median of so many frames."""
MILLIMETRES = 1000.0
UNIT = 0.004
"""Metres per unit of a stored point, finer than depth cameras measure."""


@dataclass(frozen=True, eq=False)
class SceneClouds:
    """Points as a camera sees them, int16: column and row in pixels, and the depth in units of `UNIT`.

    Neighbours are then alike but for their depth, and a page needs half as many bytes as for points in space.

    Attributes
    ----------
    points : (N, 3), those near the people, frame after frame
    counts : int64 (F,), how many of them belong to each frame
    room : (M, 3), what stays where it is and is near to no person
    """

    points: np.ndarray
    counts: np.ndarray
    room: np.ndarray


def gather_clouds(recording: Recording, joints: np.ndarray, frames: range) -> SceneClouds:
    """Read the frames once and keep what a page can show.

    Parameters
    ----------
    recording : that was tracked
    joints : float (T, J, 3), joints of all people in every frame, camera frame, metres; NaN where no person is there
    frames : which ones are shown, in order
    """
    limit = min(POINTS, max(50, TOTAL // len(frames)))
    for_room = set(np.linspace(0, len(frames) - 1, min(ROOM_FRAMES, len(frames))).astype(int).tolist())
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
    there = thinned(scene > 0, ROOM_POINTS)
    together = np.concatenate(points) if points else np.zeros((0, 3), dtype=np.int16)
    return SceneClouds(together, np.array(counts, dtype=np.int64), _seen(recording.camera, there, scene[there]))


def near_people(depth_mm: np.ndarray, rays: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Mask (H, W) of the measured pixels within `REACH` of one of the joints (J, 3)."""
    near = np.zeros(depth_mm.shape, dtype=bool)
    known = joints[np.isfinite(joints).all(axis=1)]
    if not len(known):
        return near
    z = depth_mm / MILLIMETRES
    low, high = known[:, 2].min() - REACH, known[:, 2].max() + REACH
    rows, columns = np.nonzero((z > max(low, 0.0)) & (z < high))
    points = rays[rows, columns] * z[rows, columns, None]
    distance = np.full(len(points), np.inf)
    for joint in known:
        distance = np.minimum(distance, ((points - joint) ** 2).sum(axis=1))
    near[rows, columns] = distance < REACH**2
    return near


def thinned(mask: np.ndarray, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of at most `limit` pixels of a mask, on a grid as fine as that allows."""
    too_many = max(1.0, np.count_nonzero(mask) / limit)
    down = int(np.ceil(np.sqrt(too_many)))
    across = int(np.ceil(too_many / down))
    rows, columns = np.nonzero(mask[::down, ::across])
    return rows[:limit] * down, columns[:limit] * across


def pack(points: np.ndarray) -> bytes:
    """Points (N, 3), int16, as bytes that deflate well: differences of neighbours, coordinate by coordinate, all low
    bytes before all high ones.
    """
    steps = np.diff(points.astype(np.int32), axis=0, prepend=0).astype("<i2")  # wraps, and so do the sums
    halves = np.ascontiguousarray(steps.T).view(np.uint8).reshape(-1, 2)
    return halves.T.tobytes()


def median_point(images: np.ndarray) -> np.ndarray:
    """Median over images (K, H, W) of the pixels that hold something, 0 where none does."""
    values = np.where(images > 0, images, np.nan).astype(np.float64)
    seen = np.isfinite(values).any(axis=0)
    out = np.zeros(images.shape[1:])
    out[seen] = np.nanmedian(values[:, seen], axis=0)
    return out


def _seen(camera: Camera, pixels: tuple[np.ndarray, np.ndarray], depth_mm: np.ndarray) -> np.ndarray:
    """Points (N, 3) at rows and columns; where the lens bends, those of a straight one to half a pixel."""
    slopes = camera.rays()[pixels]
    column, row = slopes[:, 0] * camera.fx + camera.cx, slopes[:, 1] * camera.fy + camera.cy
    points = np.rint(np.column_stack([column, row, depth_mm / (MILLIMETRES * UNIT)]))
    return np.clip(points, -32768, 32767).astype(np.int16)
