"""Cameras on their side: the quarter turns that bring their images upright."""

from __future__ import annotations

import numpy as np

from toolkit.kernels import linear
from toolkit.people.floor import Floor, find_floor
from toolkit.people.plausibility import better_turns, sampled_frames
from toolkit.people.surroundings import is_cut_out
from toolkit.people.vertical import people_axes
from toolkit.people.view import CoarseCamera
from toolkit.sensing.camera import DEFAULT_UP, Camera, rotated_points
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings

CLEARLY = np.cos(np.radians(35.0))
"""Minimum cosine between up and the vertical of the turned image; a tilted camera needs `--rotate`."""


def quarter_turns(recording: Recording) -> int:
    """Return the quarter turns clockwise that bring the images upright; 0 without evidence for another orientation.

    The vertical of the file decides. Else, where people are cut out, the orientation decides in which heads have the
    highest log odds of a person. Else a floor decides that is visible in a turned image only and on which a person
    stands. A ceiling is no floor: no person stands on it in the turned image. `--rotate` and `--up` override.
    """
    if recording.options.keys() & {"rotate", "up_camera"}:
        return 0
    vertical = recording.vertical
    if vertical.source == "file":
        fits = [linear.dot(rotated_points(vertical.up_camera, turns), np.array(DEFAULT_UP)) for turns in range(4)]
        best = int(np.argmax(fits))
        return best if best and fits[best] > CLEARLY else 0
    if vertical.source == "floor":
        return 0
    depth, camera = recording.depth(0), recording.camera
    scene = depth if recording.background is None else recording.background
    coarse = CoarseCamera(camera.undistorted(), np.array(DEFAULT_UP), SensingSettings())
    if recording.background is None and is_cut_out(coarse.downsampled(depth), coarse):
        return better_turns(sampled_frames(recording), camera)
    if _standing(depth, camera, 0):
        return 0
    others = (1, 3, 2)  # quarter turns clockwise, the most frequent ones first
    # Maximum height above a floor, metres, of the lowest twentieth of a standing person: soles may be part of the
    # floor.
    on_floor = 0.5
    for turns in others:
        standing = _standing(depth, camera, turns)
        floor = find_floor(_turned(scene, turns), camera.rotated(turns)) if standing else None
        if floor is not None and any(_lowest(points, floor) < on_floor for points in standing):
            return turns
    return 0


def _standing(depth_mm: np.ndarray, camera: Camera, turns: int) -> list[np.ndarray]:
    """Return the points (N, 3), camera frame, metres, of each person who stands after `turns` quarter turns."""
    coarse = CoarseCamera(camera.undistorted().rotated(turns), np.array(DEFAULT_UP), SensingSettings())
    people = people_axes(coarse.downsampled(_turned(depth_mm, turns)), coarse)
    up = np.array(DEFAULT_UP)
    return [points for axis, trust, points in people if trust == "standing" and linear.dot(axis, up) > CLEARLY]


def _lowest(points: np.ndarray, floor: Floor) -> float:
    """Return the height above a floor, metres, of the lowest twentieth of points (N, 3), camera frame."""
    return float(np.quantile(linear.times(points, floor.up_camera) + floor.height, 0.05))


def _turned(image: np.ndarray, turns: int) -> np.ndarray:
    return np.ascontiguousarray(np.rot90(image, -turns))
