"""Software rendering of a shaded body: smooth normals, colours by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.body.body import Body, vertex_normals
from toolkit.kernels.image import shading
from toolkit.output.rendering.style import PART_COLORS, person_color
from toolkit.sensing.camera import Camera

KEY_LIGHT = np.array([-0.45, -0.65, -0.6]) / np.linalg.norm([-0.45, -0.65, -0.6])
"""Direction to the key light, camera frame: from the upper left, in front of the body."""
LIGHTS = np.array([0.28, 0.5, 0.3])
"""Weights of ambient light, key light and a light at the camera."""


def draw_mesh(
    image: np.ndarray,
    vertices_camera: np.ndarray,
    faces: np.ndarray,
    colors: np.ndarray,
    camera: Camera,
    depth: np.ndarray | None = None,
) -> np.ndarray:
    """Draw a closed mesh, seen by an undistorted `camera`, over an RGB image, uint8 (H, W, 3).

    Parameters
    ----------
    vertices_camera : (V, 3), metres, camera frame
    faces : int (F, 3), counter-clockwise seen from outside
    colors : (V, 3), RGB from 0 to 255
    depth : result of an earlier call for the same picture, to draw another mesh before and behind the first one

    Returns
    -------
    Depth of the drawn surface, float32 (H, W), metres along z, infinite elsewhere.
    """
    vertices = np.ascontiguousarray(vertices_camera, dtype=np.float64)
    depth = np.full(camera.shape, np.inf, dtype=np.float32) if depth is None else depth
    shading.shade_triangles(
        vertices, vertex_normals(vertices, faces), np.ascontiguousarray(colors, dtype=np.float64), faces,
        camera.intrinsics, LIGHTS, KEY_LIGHT, depth, image,
    )  # fmt: skip
    return depth


def mesh_colors(bodies: Sequence[Body]) -> list[np.ndarray]:
    """Return vertex colours of each body, float64 (V, 3): by body part for one person, one colour each for several."""
    if len(bodies) == 1:
        return [part_colors(bodies[0])]
    own = (np.array(person_color(number), dtype=np.float64) for number in range(len(bodies)))
    return [np.tile(color, (len(body.vertices), 1)) for color, body in zip(own, bodies, strict=True)]


def part_colors(body: Body) -> np.ndarray:
    """Return vertex colours mixed by the skinning weights: float64 (V, 3)."""
    return np.asarray((body.skin_weights[..., None] * PART_COLORS[body.skin_joints]).sum(axis=1), dtype=np.float64)
