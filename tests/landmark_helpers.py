"""A plain figure of boxes and drawn bodies in front of a camera, for the tests of the landmarks."""

import numpy as np

from toolkit.body.body import Body
from toolkit.kernels.image import raster
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud

CAMERA = Camera(280.0, 280.0, 160.0, 120.0, 320, 240)
LEVEL = np.diag([1.0, -1.0, -1.0])


def cloud_of(depth: np.ndarray) -> Cloud:
    """Return the cloud of a depth image (metres) of `CAMERA`, which looks horizontally."""
    return Cloud.from_depth(depth, CAMERA, LEVEL)


def paint(depth: np.ndarray, low: tuple[float, float], high: tuple[float, float], z: float) -> None:
    """Draw an upright rectangle, corners (x, y) in metres, level frame, at `z` metres, over farther pixels."""
    u = [CAMERA.cx + CAMERA.fx * x / z for x in (low[0], high[0])]
    v = [CAMERA.cy - CAMERA.fy * y / z for y in (high[1], low[1])]
    part = depth[max(round(v[0]), 0) : round(v[1]) + 1, max(round(u[0]), 0) : round(u[1]) + 1]
    part[(part == 0) | (part > z)] = z


def figure(z: float = 2.6) -> np.ndarray:
    """Return the depth image (240, 320) of a flat person with both arms stretched out to the sides."""
    depth = np.zeros((240, 320), dtype=np.float32)
    paint(depth, (-0.2, -0.35), (0.2, 0.3), z)  # torso
    paint(depth, (-0.08, 0.3), (0.08, 0.55), z)  # head
    paint(depth, (0.2, 0.18), (0.75, 0.28), z)  # left arm
    paint(depth, (-0.75, 0.18), (-0.2, 0.28), z)
    paint(depth, (0.06, -0.95), (0.19, -0.35), z)  # left leg
    paint(depth, (-0.19, -0.95), (-0.06, -0.35), z)
    return depth


def body_cloud(body: Body, pose: np.ndarray) -> Cloud:
    """Return the cloud of a body in a pose (P,), level frame, without noise."""
    vertices_camera = body.vertex_positions(pose) @ LEVEL
    projected = np.empty_like(vertices_camera)
    raster.project(vertices_camera, np.asarray(CAMERA.intrinsics, dtype=np.float64), projected)
    inverse = np.empty((CAMERA.height, CAMERA.width))
    raster.rasterise(projected, body.faces, inverse, np.empty(inverse.shape, dtype=np.int32))
    return cloud_of(np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0))
