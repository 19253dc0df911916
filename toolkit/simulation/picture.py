"""Colour images of simulated people in their room, registered to the depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.sensing.camera import Camera
from toolkit.simulation.mesh import Mesh
from toolkit.simulation.raycast import Hits
from toolkit.simulation.scene import PlacedCamera
from toolkit.simulation.shading import draw

FINER = 2
"""Supersampling factor of images, for smooth contours."""
LIGHTS = np.array([0.35, 0.5, 0.2])
"""Fractions of ambient light, of a lamp, and of light from the camera."""


@dataclass(frozen=True, eq=False)
class Backdrop:
    """Image of the room without people.

    Attributes
    ----------
    image : float64 (H, W, 3), RGB
    depth : float64 (H, W), metres, infinite without a surface
    key : (3,), direction towards the lamp, camera frame
    camera : camera of both, `FINER` times finer than the depth camera
    """

    image: np.ndarray
    depth: np.ndarray
    key: np.ndarray
    camera: Camera

    @classmethod
    def of_room(cls, hits: Hits, camera: Camera, view: PlacedCamera, rng: np.random.Generator) -> Backdrop:
        """Draw a room of boxes for `camera`: painted walls with pictures, a plank floor, furniture."""
        key_spread = 0.6  # largest deviation of the lamp from above and before the people, as the tangent of an angle
        aside, before = rng.uniform(-key_spread, key_spread), rng.uniform(0.2, 0.2 + key_spread)
        lamp = np.array([aside, 1.0, before])
        key = lamp / np.linalg.norm(lamp) @ view.R_level_camera
        rays = np.concatenate([camera.rays(), np.ones((*camera.shape, 1))], axis=-1)
        seen = hits.depth > 0
        points = (rays * hits.depth[..., None])[seen] @ view.R_level_camera.T + view.position
        normals = hits.normals[seen].astype(np.float64)
        normals *= np.where((normals * rays[seen]).sum(axis=1) > 0, -1.0, 1.0)[:, None]
        light = LIGHTS[0] + LIGHTS[1] * np.maximum((normals * key).sum(axis=1), 0.0) + 0.5 * LIGHTS[2]
        image = np.zeros((*camera.shape, 3))
        box_faces = 12  # triangles of a box; the first box of a room is its shell
        image[seen] = _paint(points, hits.triangles[seen] // box_faces, rng) * light[:, None]
        return cls(image, np.where(seen, hits.depth, np.inf).astype(np.float64), key, camera)

    def with_people(self, people: Sequence[Mesh], rng: np.random.Generator) -> np.ndarray:
        """Return an image of people in the room, uint8 (h, w, 3), RGB, of the depth camera's size, with noise."""
        image = np.clip(self.image, 0, 255).astype(np.uint8)
        draw(image, people, self.camera, LIGHTS, self.key, self.depth)
        fine = image.reshape(len(image) // FINER, FINER, -1, FINER, 3)
        coarse = fine.mean(axis=(1, 3), dtype=np.float32)
        image_noise = 2.5  # standard deviation of an image's noise, grey levels
        return np.clip(np.rint(coarse + rng.normal(0.0, image_noise, coarse.shape)), 0, 255).astype(np.uint8)


def _paint(points: np.ndarray, box: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the colours (N, 3) of points (N, 3) on the boxes of a room, on the floor plan."""
    palette = rng.uniform(60.0, 190.0, (int(box.max()) + 1, 3))
    palette[0] = rng.uniform(150.0, 215.0) + rng.normal(0.0, 10.0, 3)
    colors = palette[box]
    x, y, z = points.T
    blotches = np.zeros(len(points))
    for frequency in (0.7, 1.5, 3.0, 6.0):
        blotches += np.sin((points * rng.normal(0.0, frequency, 3)).sum(axis=1) + rng.uniform(0.0, 6.0))
    colors += 4.0 * blotches[:, None]
    floor = (y < 0.01) & (box == 0)
    plank = np.sin(12.9898 * np.floor(x / 0.12) + 3.1 * np.floor(z / 1.1 + 0.37 * np.floor(x / 0.12)))
    colors[floor] = np.array([140.0, 104.0, 70.0]) + 14.0 * plank[floor, None] + 3.0 * blotches[floor, None]
    for _ in range(3):  # pictures on the far wall
        left, low, width, height = rng.uniform((-2.0, 1.0, 0.3, 0.3), (1.5, 1.5, 0.8, 0.7))
        hung = (box == 0) & ~floor & (z < z.min() + 0.05)
        hung &= (x > left) & (x < left + width) & (y > low) & (y < low + height)
        colors[hung] = rng.uniform(40.0, 220.0, 3) + 25.0 * np.sin(9.0 * x[hung] + 7.0 * y[hung])[:, None]
    return colors
