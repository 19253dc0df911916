"""Pictures of bodies for publications, by ray casting with Open3D: smooth contours, soft shadows, white paper.

Open3D's `OffscreenRenderer` is not used: with Mesa's software driver the same picture took 0.4 s to over 200 s, and it
needs Vulkan. Ray casting needs neither a driver nor a display, and gives the same picture everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from toolkit.output.rendering.style import KEY_LIGHT, LIGHTS
from toolkit.output.rendering.views import OutsideView
from toolkit.simulation.mesh import Mesh, joined
from toolkit.simulation.raycast import cast, scene_of, window_of
from toolkit.simulation.shading import shaded

SAMPLES = 3
"""Rays of a pixel along rows and along columns; their mean smooths contours."""


class PicturePainter:
    """Painter of bodies on white paper, with their shadows on the ground.

    Parameters
    ----------
    view : viewpoint of the picture
    ground : y of the ground, metres, level frame; NaN for none
    """

    def __init__(self, view: OutsideView, ground: float) -> None:
        self._camera = view.camera.scaled(SAMPLES)
        self._up, self._ground = view.rotation[1], ground - view.centre[1]
        to_light = view.rotation @ KEY_LIGHT
        lowest = 0.5  # sine of the light's elevation, for short shadows before a camera that looks up
        to_light[1] = max(to_light[1], lowest)
        self._key = to_light @ view.rotation / np.linalg.norm(to_light)
        across = np.cross(self._key, self._up)
        across /= np.linalg.norm(across)
        angles = np.pi * np.arange(2 * SAMPLES**2) / SAMPLES**2
        ring = np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * np.cross(self._key, across)
        radius = 0.05  # of the light, as a share of its distance, for soft shadows
        self._lights = self._key + radius * ring  # two opposite points of the light for each ray of a pixel

    def paint(self, meshes: Sequence[Mesh]) -> np.ndarray:
        """Return the picture of coloured meshes in the frame of the view's camera: RGB, uint8 (H, W, 3)."""
        camera, mesh = self._camera, joined(meshes)
        image = np.full((*camera.shape, 3), 255, dtype=np.uint8)
        scene, hits = scene_of(mesh.vertices, mesh.faces), cast(mesh.vertices, mesh.faces, camera)
        rays = np.dstack([camera.rays(), np.ones(camera.shape)])
        body = hits.depth > 0
        if body.any():
            points = rays[body] * hits.depth[body, None]
            lit = self._lit(scene, points, body)
            surface = hits.triangles[body], hits.uvs[body], rays[body][:, :2]
            image[body] = shaded(mesh, *surface, LIGHTS, self._key, lit)
        if len(meshes) and np.isfinite(self._ground):
            below = np.zeros(camera.shape, dtype=bool)
            window = window_of(self._shadows(mesh.vertices), camera)
            below[window] = ~body[window] & (self._ground * (rays[window] @ self._up) > 0)
            points = rays[below] * (self._ground / (rays[below] @ self._up))[:, None]
            shadow = 0.5  # share of the light that a shadow takes from the ground
            image[below] = 255.0 * (1.0 - shadow * (1.0 - self._lit(scene, points, below)[:, None]))
        fine = image.reshape(len(image) // SAMPLES, SAMPLES, -1, SAMPLES, 3)
        return np.rint(fine.mean(axis=(1, 3), dtype=np.float32)).astype(np.uint8)

    def _lit(self, scene: Any, points: np.ndarray, where: np.ndarray) -> np.ndarray:
        """Return the share of the light that the points (N, 3) of the pixels `where` (H, W) see: float64 (N,)."""
        from open3d.core import Tensor

        rows, columns = np.nonzero(where)
        first = SAMPLES * (rows % SAMPLES) + columns % SAMPLES
        # Distance from a surface at which a ray to the light starts, metres: below the resolution of the mesh.
        start, dark = 1e-3, np.zeros(len(points))
        for light in (self._lights[first], self._lights[first + SAMPLES**2]):
            rays = Tensor.from_numpy(np.concatenate([points, light], axis=1, dtype=np.float32))
            dark += scene.test_occlusions(rays, tnear=start).numpy()
        return 1.0 - dark / 2.0

    def _shadows(self, vertices: np.ndarray) -> np.ndarray:
        """Return the shadows (N, 3) of vertices (V, 3) on the ground, by all points of the light."""
        height = vertices @ self._up - self._ground
        return np.concatenate([vertices - light * (height / (light @ self._up))[:, None] for light in self._lights])
