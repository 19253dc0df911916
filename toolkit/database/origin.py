"""The common origin of clouds and poses: centre and facing of a pose as a tracker would estimate them on a view of it.

The centre of a depth cloud lies on the visible front of the torso, not at a pose's root, and where arms or a bend
change what the camera sees, it moves. So every pose is looked at once, in the canonical frame, by a camera in front
of it, and the same code that finds the centre and the facing of a cloud (`toolkit.landmarks`) is run on that view.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.database.canonical import about_up, frontal_centre, place
from toolkit.kernels import linear
from toolkit.kernels.image import raster
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.facing import estimate_facing
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud

ADULT_HEIGHT = 1.7
"""Metres: the size of a person for which the landmarks' lengths are stated."""


@dataclass(frozen=True)
class RootView:
    """A camera that looks horizontally at the root of a canonical pose.

    Attributes
    ----------
    distance : metres from camera to root
    yaw : radians, facing of the body against the camera: at 0 the pose faces it
    """

    distance: float = 3.0
    yaw: float = 0.0


CAMERA = Camera(fx=142.8, fy=142.8, cx=79.5, cy=59.5, width=160, height=120)
"""A Kinect at a quarter of its resolution: 2,000 to 3,000 pixels on a person at 3 m, enough for a mean and a plane."""

R_LEVEL_CAMERA = np.diag([1.0, -1.0, -1.0])


def observed_offsets(body: Body, poses: np.ndarray, view: RootView | None = None) -> np.ndarray:
    """Offsets of canonical poses (N, P): float64 (N, 4), centre (metres) and facing yaw (radians), canonical frame.

    Where an arm hides the torso, the facing estimate has a low weight and a tracker keeps the facing that it had; so
    the yaw is the mean, by weight, of the estimate and the body's own facing. The centre is that of `frontal_centre`.
    """
    view = view or RootView()
    scale = body.height / ADULT_HEIGHT
    stand = np.array([0.0, 0.0, -view.distance])
    offsets = np.empty((len(poses), 4))
    for row, pose in enumerate(place(poses, np.zeros(4), stand, view.yaw)):
        points = seen_points(body, pose)
        centre = cloud_centre(points, scale=scale)
        estimate = estimate_facing(points, centre, scale=scale)
        weight, turn = estimate.weight, estimate.yaw - view.yaw
        turned = np.arctan2(weight * np.sin(turn), 1.0 - weight + weight * np.cos(turn))
        offsets[row, :3] = frontal_centre(centre, view.yaw + turned, scale) - stand
        offsets[row, 3] = turned
    offsets[:, :3] = linear.rotated(offsets[:, :3], about_up(view.yaw))
    return offsets


def seen_points(body: Body, pose: np.ndarray) -> np.ndarray:
    """Points that `CAMERA` sees of a pose (P,) in the level frame: float32 (N, 3), metres, level frame."""
    vertices_camera = linear.rotated(body.vertex_positions(pose), R_LEVEL_CAMERA)
    projected = np.empty_like(vertices_camera)
    raster.project(vertices_camera, np.asarray(CAMERA.intrinsics, dtype=np.float64), projected)
    inverse_depth = np.empty((CAMERA.height, CAMERA.width))
    raster.rasterise(projected, body.faces, inverse_depth, np.empty(inverse_depth.shape, dtype=np.int32))
    depth = np.zeros(inverse_depth.shape, dtype=np.float32)
    np.divide(1.0, inverse_depth, out=depth, where=inverse_depth > 0, casting="same_kind")
    return Cloud.from_depth(depth, CAMERA, R_LEVEL_CAMERA).points
