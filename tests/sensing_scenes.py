"""Depth images of people, in a room or alone: the body by ray casting, floor and wall by analytic geometry."""

from functools import lru_cache
from typing import Any

import cv2
import numpy as np

from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.body.skeleton import POSE_NAMES, POSE_SIZE
from toolkit.people.person_network import person_network
from toolkit.people.view import CoarseCamera, View
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.simulation.raycast import render_depth

TOF = Camera(220.0, 220.0, 87.5, 71.5, 176, 144)
KINECT = Camera(285.63, 285.63, 159.5, 119.5, 320, 240)
ARMS_DOWN = 1.2  # rad below the T-pose
NO_HEAD = -6.0  # log-odds of a head where a fake classifier has none


class ConstantOdds:
    """Person network with the same log-odds for all measured pixels that counts its calls.

    The heads are those of the package's network; their log-odds are `peak`, the same as of pixels unless given.
    """

    def __init__(self, odds: float = 0.0, peak: float | None = None) -> None:
        self.pixels, self.peak, self.calls = odds, odds if peak is None else peak, 0
        self._real = person_network().odds

    def odds(self, depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """See `PersonNetwork.odds`."""
        assert depth.shape == camera.shape
        self.calls += 1
        _, heads = self._real(depth, camera)
        peaks = (heads > 0) & (heads == cv2.dilate(heads, np.ones((5, 5), np.uint8)))
        people = np.where(depth > 0, np.float32(self.pixels), np.float32(0))
        return people, np.where(peaks, np.float32(self.peak), np.float32(NO_HEAD))


@lru_cache(maxsize=1)
def neutral() -> tuple[Body, float]:
    """Return the neutral body and the height of its hips above the floor, metres."""
    body = load_body("neutral")
    return body, -float(body.vertices[:, 1].min())


def standing(x: float, distance: float, height: float) -> np.ndarray:
    """Return a pose with hanging arms that faces a camera `height` metres above the floor, level frame."""
    pose = np.zeros(POSE_SIZE)
    pose[:3] = x, neutral()[1] - height, -distance
    pose[POSE_NAMES.index("left_shoulder_rz")] = -ARMS_DOWN
    pose[POSE_NAMES.index("right_shoulder_rz")] = ARMS_DOWN
    return pose


def up_of_tilt(tilt: float) -> np.ndarray:
    """Return the vertical in the frame of a camera tilted downwards by `tilt` radians."""
    return np.array([0.0, -np.cos(tilt), -np.sin(tilt)])


@lru_cache(maxsize=64)
def _scene(
    camera: Camera, people: tuple[tuple[float, float], ...], tilt: float, height: float, wall: float | None, floor: bool
) -> tuple[np.ndarray, np.ndarray]:
    rotation = level_rotation(up_of_tilt(tilt))
    rays = np.dstack([camera.rays(), np.ones(camera.shape)]) @ rotation.T  # level frame, per metre of z
    depth = np.full(camera.shape, np.inf)
    who = np.zeros(camera.shape, dtype=int)
    planes = ([((0.0, 1.0, 0.0), -height)] if floor else []) + ([((0.0, 0.0, 1.0), -wall)] if wall else [])
    for normal, offset in planes:
        with np.errstate(divide="ignore"):
            t = offset / (rays @ np.array(normal))
        depth = np.where((t > 0) & (t < depth), t, depth)
    for k, (x, distance) in enumerate(people, start=1):
        seen = render_depth(neutral()[0], standing(x, distance, height), camera, rotation)
        hit = (seen > 0) & (seen < depth)
        depth, who = np.where(hit, seen, depth), np.where(hit, k, who)
    depth = np.where(np.isfinite(depth) & (depth < 60), depth, 0.0)
    return np.rint(depth * 1000).astype(np.uint16), who


def scene(
    camera: Camera,
    people: tuple[tuple[float, float], ...] = ((0.0, 3.0),),
    *,
    tilt: float = 0.0,
    height: float = 1.2,
    wall: float | None = None,
    floor: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Return a depth image, uint16 (H, W) millimetres, and the person of each pixel, int (H, W): 0 room, 1.. people.

    `people` stand at (x, distance) in front of a camera `height` metres above the floor; the wall is at a distance too.
    """
    depth, who = _scene(camera, people, tilt, height, wall, floor)
    return depth.copy(), who.copy()


def view_of(
    depth_mm: np.ndarray, camera: Camera = KINECT, up: np.ndarray | None = None, network: Any = None
) -> tuple[CoarseCamera, View]:
    """Return the coarse camera and a frame in which all measured pixels are foreground."""
    coarse = CoarseCamera(camera, up_of_tilt(0.0) if up is None else up, SensingSettings(), network=network)
    depth = coarse.downsampled(depth_mm)
    return coarse, coarse.view(depth, depth > 0, np.zeros(depth.shape, dtype=np.bool_))


def person_alone(camera: Camera, x: float = 0.0, distance: float = 3.0) -> np.ndarray:
    """Return the depth of one person without surroundings, uint16 (H, W), millimetres."""
    return scene(camera, ((x, distance),))[0]
