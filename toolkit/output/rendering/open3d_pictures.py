"""Pictures of bodies for publications, by ray casting with Open3D: smooth shading, soft shadows, white paper.

Open3D's `OffscreenRenderer` is not used: with Mesa's software driver the same picture took 0.4 s to over 200 s, and it
needs Vulkan. Ray casting needs neither a driver nor a display, and gives the same picture everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from toolkit.body.body import vertex_normals
from toolkit.output.rendering.mesh import KEY_LIGHT, LIGHTS
from toolkit.output.rendering.views import OutsideView

WHITE_PAPER = (255, 255, 255)
"""Background of the pictures, RGB."""


class ColoredMesh(NamedTuple):
    """Mesh of one body: vertices (V, 3), metres, level frame; faces int (F, 3); colours (V, 3), RGB 0 to 255."""

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray


class PicturePainter:
    """Painter of bodies on white paper, with their shadows on the ground.

    Parameters
    ----------
    view : viewpoint of the picture
    ground : y of the ground, metres, level frame; NaN for none
    """

    def __init__(self, view: OutsideView, ground: float) -> None:
        self._view, self._ground = view, ground
        self._samples = 3  # rays of a pixel along rows and along columns; their mean smooths contours
        self._to_light = view.rotation @ KEY_LIGHT
        lowest = 0.5  # sine of the light's elevation, for short shadows before a camera that looks up
        self._to_light[1] = max(self._to_light[1], lowest)
        self._to_light /= np.linalg.norm(self._to_light)
        across = np.cross(self._to_light, (0.0, 1.0, 0.0))
        across /= np.linalg.norm(across)
        angles = np.pi * np.arange(2 * self._samples**2) / self._samples**2
        ring = np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * np.cross(self._to_light, across)
        radius = 0.05  # of the light, as a share of its distance, for soft shadows
        self._lights = self._to_light + radius * ring  # two opposite points of the light for each ray of a pixel

    def paint(self, surfaces: Sequence[ColoredMesh]) -> np.ndarray:
        """Return the picture of surfaces: RGB, uint8 (H, W, 3)."""
        import open3d as o3d

        camera = self._view.camera
        picture = np.full((*camera.shape, 3), WHITE_PAPER, dtype=np.uint8)
        v0, v1, u0, u1 = self._window(surfaces)
        if not surfaces or v0 >= v1 or u0 >= u1:
            return picture
        scene = o3d.t.geometry.RaycastingScene()
        for surface in surfaces:
            mesh = surface.vertices.astype(np.float32), surface.faces.astype(np.uint32)
            scene.add_triangles(*map(o3d.core.Tensor.from_numpy, mesh))
        corners = np.concatenate([[0], np.cumsum([len(surface.vertices) for surface in surfaces])])
        faces = [surface.faces + first for surface, first in zip(surfaces, corners, strict=False)]
        normals = np.concatenate([vertex_normals(surface.vertices, surface.faces) for surface in surfaces])
        whole = ColoredMesh(normals, np.concatenate(faces), np.concatenate([surface.colors for surface in surfaces]))
        first_faces = np.concatenate([[0], np.cumsum([len(surface.faces) for surface in surfaces])])
        count = self._samples
        offsets = (np.arange(count) + 0.5) / count - 0.5
        total = np.zeros((v1 - v0, u1 - u0, 3))
        for k, (dv, du) in enumerate((dv, du) for dv in offsets for du in offsets):
            v, u = np.meshgrid(np.arange(v0, v1) + dv, np.arange(u0, u1) + du, indexing="ij")
            rays = np.dstack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)])
            lights = self._lights[[k, k + count**2]]
            total += self._traced(scene, whole, first_faces, rays @ self._view.rotation.T, lights)
        picture[v0:v1, u0:u1] = np.rint(total / count**2)
        return picture

    def _traced(
        self, scene: Any, whole: ColoredMesh, first_faces: np.ndarray, rays: np.ndarray, lights: np.ndarray
    ) -> np.ndarray:
        """Return the colours (h, w, 3) that rays (h, w, 3) of the level frame hit."""
        hit = _cast(scene, np.broadcast_to(self._view.centre, rays.shape), rays)
        distance = hit["t_hit"]
        body = np.isfinite(distance)
        colors = np.full(rays.shape, WHITE_PAPER, dtype=np.float64)
        corners = whole.faces[first_faces[hit["geometry_ids"][body]] + hit["primitive_ids"][body]]
        uv = hit["primitive_uvs"][body]
        shares = np.column_stack([1.0 - uv.sum(axis=1), uv])[..., None]
        normals = (whole.vertices[corners] * shares).sum(axis=1)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        towards = -rays[body] / np.linalg.norm(rays[body], axis=1, keepdims=True)
        points = self._view.centre + rays[body] * distance[body, None]
        # Distance from a surface at which a ray to the light starts, metres: below the resolution of the mesh.
        start = 1e-3
        lit = self._lit(scene, points + start * normals, lights)
        ambient, key, head = LIGHTS
        shade = ambient + key * lit * np.maximum(normals @ self._to_light, 0.0)
        shade += head * np.maximum((normals * towards).sum(axis=1), 0.0)
        colors[body] = np.minimum((whole.colors[corners] * shares).sum(axis=1) * shade[:, None], 255.0)
        below = ~body & ((self._ground - self._view.centre[1]) * rays[..., 1] > 0)  # False without a ground
        reach = (self._ground - self._view.centre[1]) / rays[below][:, 1]
        ground = self._view.centre + rays[below] * reach[:, None]
        shadow = 0.5  # share of the light that a shadow takes from the ground
        colors[below] *= 1.0 - shadow * (1.0 - self._lit(scene, ground, lights)[:, None])
        return colors

    def _lit(self, scene: Any, points: np.ndarray, lights: np.ndarray) -> np.ndarray:
        """Return the share of the lights (L, 3) that each point (n, 3) sees: float64 (n,)."""
        hits = [_cast(scene, points, np.broadcast_to(light, points.shape))["t_hit"] for light in lights]
        return np.asarray(np.isinf(hits).mean(axis=0), dtype=np.float64)

    def _window(self, surfaces: Sequence[ColoredMesh]) -> tuple[int, int, int, int]:
        """Return the first and last rows and columns, ends excluded, that bodies and shadows reach."""
        camera, points = self._view.camera, [surface.vertices for surface in surfaces]
        if np.isfinite(self._ground):
            for light in self._lights:
                points += [s.vertices - light * (s.vertices[:, 1:2] - self._ground) / light[1] for s in surfaces]
        pixels = self._view.project(np.concatenate(points)) if points else np.zeros((0, 2))
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        if not len(pixels):
            return 0, 0, 0, 0
        low, high = pixels.min(axis=0) - 1, pixels.max(axis=0) + 2
        (u0, v0), (u1, v1) = (np.clip(p, 0, (camera.width, camera.height)).astype(int) for p in (low, high))
        return int(v0), int(v1), int(u0), int(u1)


def _cast(scene: Any, origins: np.ndarray, directions: np.ndarray) -> dict[str, np.ndarray]:
    """Return the surfaces that rays (..., 3) hit, see `open3d.t.geometry.RaycastingScene.cast_rays`."""
    from open3d.core import Tensor

    rays = np.concatenate([origins, directions], axis=-1, dtype=np.float32)
    return {name: values.numpy() for name, values in scene.cast_rays(Tensor.from_numpy(rays)).items()}
