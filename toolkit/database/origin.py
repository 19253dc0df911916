"""Common origin of clouds and poses: centre and facing of a pose as a tracker estimates them on a view of it.

The centre of a depth cloud lies on the visible front of the torso, not at a pose's root, and it moves with arms and
bends that change the visible surface. Each pose is therefore rendered once, in the canonical frame, by a camera in
front of it; the estimators of centre and facing of a cloud (`toolkit.landmarks`) run on that view.
"""

from __future__ import annotations

import numpy as np

from toolkit.body.body import Body
from toolkit.database.canonical import frontal_centre, place
from toolkit.kernels import linear
from toolkit.kernels.image import raster
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.facing import estimate_facing
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud

ADULT_HEIGHT = 1.7
"""Stature in metres for the lengths of the landmarks."""


CAMERA = Camera(fx=142.8, fy=142.8, cx=79.5, cy=59.5, width=160, height=120)
"""A Kinect at a quarter of its resolution: 2,000 to 3,000 pixels on a person at 3 m, enough for a mean and a plane."""


def observed_offsets(body: Body, poses: np.ndarray) -> np.ndarray:
    """Return the offsets of canonical poses (N, P): float64 (N, 4), centre (metres) and facing yaw (radians).

    Where an arm occludes the torso, the facing estimate has a low weight and a tracker keeps its previous facing.
    The yaw is therefore the weighted mean of the estimate and the body's own facing. The centre is `frontal_centre`.
    """
    scale = body.height / ADULT_HEIGHT
    stand = np.array([0.0, 0.0, -3.0])  # metres from the camera
    offsets = np.empty((len(poses), 4))
    for row, pose in enumerate(place(poses, np.zeros(4), stand, 0.0)):
        points = seen_points(body, pose)
        centre = cloud_centre(points, scale=scale)
        estimate = estimate_facing(points, centre, scale=scale)
        weight, turn = estimate.weight, estimate.yaw
        turned = np.arctan2(weight * np.sin(turn), 1.0 - weight + weight * np.cos(turn))
        offsets[row, :3] = frontal_centre(centre, turned, scale) - stand
        offsets[row, 3] = turned
    return offsets


def seen_points(body: Body, pose: np.ndarray) -> np.ndarray:
    """Return the points of a pose (P,) in the level frame that are visible to `CAMERA`: float32 (N, 3), metres."""
    R_level_camera = np.diag([1.0, -1.0, -1.0])
    vertices_camera = linear.rotated(body.vertex_positions(pose), R_level_camera)
    projected = np.empty_like(vertices_camera)
    raster.project(vertices_camera, np.asarray(CAMERA.intrinsics, dtype=np.float64), projected)
    inverse_depth = np.empty((CAMERA.height, CAMERA.width))
    raster.rasterise(projected, body.faces, inverse_depth, np.empty(inverse_depth.shape, dtype=np.int32))
    depth = np.zeros(inverse_depth.shape, dtype=np.float32)
    np.divide(1.0, inverse_depth, out=depth, where=inverse_depth > 0, casting="same_kind")
    return Cloud.from_depth(depth, CAMERA, R_level_camera).points
