"""Vertical of a recording without one: from the floor, else from walls and people.

Cameras are mostly level and people mostly stand. Without a floor, up is the direction that agrees best with walls
(normal to it), with the axes of people (parallel) and with the image's vertical, each with its own weight: the smallest
eigenvector of a weighted sum. The image's vertical is kept unless that direction clearly differs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.kernels import linear
from toolkit.people.detection import connected_surfaces, find_heads
from toolkit.people.floor import LARGEST_TILT, Floor, find_floor, find_known_floor
from toolkit.people.structure import find_planes
from toolkit.people.surroundings import first_look, tolerances
from toolkit.people.view import CoarseCamera
from toolkit.sensing.camera import DEFAULT_UP, Camera
from toolkit.sensing.recording import Recording, Vertical
from toolkit.sensing.sensing_settings import SensingSettings

FLOOR_FRAMES = 4  # frames searched for a floor; a person may occlude it in one
SAMPLED_SECONDS = 3.0
CAMERA_HEIGHT = (0.3, 4.0)  # m above the floor: from a chair's seat to a ceiling
TRUST = {"wall": np.deg2rad(2.0), "standing": np.deg2rad(8.0), "torso": np.deg2rad(15.0), "image": np.deg2rad(20.0)}


def find_vertical(recording: Recording) -> Vertical:
    """Find the vertical in the background or the first seconds of a recording."""
    early = int(np.searchsorted(recording.timestamps, recording.timestamps[0] + SAMPLED_SECONDS))
    if recording.background is not None:
        scenes = [recording.background]
    else:
        scenes = [recording.depth(i) for i in _spread(early, FLOOR_FRAMES)]
    floor = agreed_floor(scenes, recording.camera)
    if floor is not None:
        return Vertical(floor.up_camera, "floor", floor.height)
    people_frames = 8  # a stride leans, several do not
    frames = [recording.depth(i) for i in _spread(early, people_frames)]
    return Vertical(assumed_up(frames, recording.camera), "assumed")


def floor_height(recording: Recording) -> float | None:
    """Return the camera's height above the floor, metres; None where no floor is visible."""
    if recording.vertical.height is not None:
        return recording.vertical.height
    scenes = [recording.background]
    if recording.background is None:
        early = int(np.searchsorted(recording.timestamps, recording.timestamps[0] + SAMPLED_SECONDS))
        scenes = [recording.depth(i) for i in _spread(early, FLOOR_FRAMES)]
    floors = [find_known_floor(scene, recording.camera, recording.up_camera) for scene in scenes if scene is not None]
    heights = [floor.height for floor in floors if floor is not None]
    heights = [height for height in heights if CAMERA_HEIGHT[0] <= height <= CAMERA_HEIGHT[1]]
    return float(np.median(heights)) if heights else None


def _spread(end: int, count: int) -> list[int]:
    return np.unique(np.linspace(0, max(end - 1, 0), min(max(end, 1), count)).astype(np.int64)).tolist()


def agreed_floor(scenes: Sequence[np.ndarray], camera: Camera) -> Floor | None:
    """Return the floor that two of these frames (uint16 (H, W), millimetres) agree on; of a single frame its own."""
    floors: list[Floor] = []
    agreeing = np.deg2rad(3.0)  # between the floors of two frames
    for scene in scenes:
        floor = find_floor(scene, camera)
        if floor is None or not CAMERA_HEIGHT[0] <= floor.height <= CAMERA_HEIGHT[1]:
            continue
        if len(scenes) == 1:
            return floor
        for other in floors:
            if _angle(floor.up_camera, other.up_camera) <= agreeing:
                return other
        floors.append(floor)
    return None


def assumed_up(frames: Sequence[np.ndarray], camera: Camera) -> np.ndarray:
    """Return the direction that best agrees with walls, people and the image's vertical: float64 (3,), camera frame.

    `frames` uint16 (H, W), millimetres.
    """
    image_up = np.array(DEFAULT_UP)
    # Minimised: squared sines to people's axes and to the image's vertical, squared cosines to walls' normals.
    doubt = -_outer(image_up, TRUST["image"])
    coarse = CoarseCamera(camera.undistorted(), image_up, SensingSettings())
    for frame in frames:
        depth = coarse.downsampled(frame)
        for axis, trust, _ in people_axes(depth, coarse):
            doubt -= _outer(axis, TRUST[trust]) / len(frames)
    wall_tilt = np.deg2rad(25.0)  # by which a wall may lean in the image of a tilted camera
    if frames:
        depth = coarse.downsampled(frames[0])
        tolerance = tolerances(depth, coarse)
        for plane in find_planes(depth, coarse.rays, tolerance):
            if abs(_angle(plane.normal, image_up) - np.pi / 2) < wall_tilt:
                doubt += _outer(plane.normal, TRUST["wall"])
    up = linear.principal_axes(doubt)[1][:, 0]
    up = up * np.sign(linear.dot(up, image_up))
    clearly = np.deg2rad(10.0)  # from the image's vertical: a lean of as much is everyday
    return up if clearly < _angle(up, image_up) <= LARGEST_TILT else image_up


def _outer(direction: np.ndarray, deviation: float) -> np.ndarray:
    return np.asarray(direction[:, None] * direction[None, :] / deviation**2)


def people_axes(depth: np.ndarray, coarse: CoarseCamera) -> list[tuple[np.ndarray, str, np.ndarray]]:
    """Return the upward axis of each person of a coarse frame, its kind in `TRUST`, and points (N, 3), camera frame."""
    surroundings = first_look(depth, coarse)
    foreground = surroundings.foreground(depth, coarse.rays, tolerances(depth, coarse))
    view = coarse.view(depth, foreground, surroundings.still)
    heads = [head.place for head in find_heads(view, coarse) if head.score > 0]
    labels = connected_surfaces(view, coarse, heads)
    axes = []
    elongated = 2.2  # length over width of a standing person with the arms down
    for k, head in enumerate(heads, start=1):
        points = coarse.from_level(view.points[labels == k].astype(np.float64))
        _, covariance = linear.moments(points)
        widths, directions = linear.principal_axes(covariance)
        longest = directions[:, 2] * np.sign(linear.dot(directions[:, 2], np.array(DEFAULT_UP)))
        if widths[2] >= elongated**2 * widths[1]:
            axes.append((longest, "standing", points))
        else:
            upwards = coarse.from_level(head[None])[0] - _chest(points, head, coarse)
            axes.append((upwards / np.sqrt(linear.dot(upwards, upwards)), "torso", points))
    return [person for person in axes if _angle(person[0], np.array(DEFAULT_UP)) <= LARGEST_TILT]


def _chest(points: np.ndarray, head: np.ndarray, coarse: CoarseCamera) -> np.ndarray:
    """Return the centre of the points below a head (3,), level frame, on its axis: float64 (3,), camera frame."""
    below = coarse.to_level(points) - head
    chest_drop, chest_radius = 0.45, 0.25  # m below a head's centre and around there
    column = (np.hypot(below[:, 0], below[:, 2]) < chest_radius) & (np.abs(below[:, 1] + chest_drop) < chest_radius)
    return linear.moments(points[column] if column.any() else points)[0]


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.arccos(np.clip(linear.dot(a, b), -1.0, 1.0)))


def floor_of(recording: Recording) -> float | None:
    """Return the y of the floor in the level frame, metres; None without a visible floor."""
    height = floor_height(recording)
    return None if height is None else -height
