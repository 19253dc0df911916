"""Depth images of people made of ellipsoids, in a room or alone, by analytic ray casting."""

from __future__ import annotations

import numpy as np

from toolkit.sensing.camera import Camera, level_rotation

TOF = Camera(220.0, 220.0, 87.5, 71.5, 176, 144)
KINECT = Camera(285.63, 285.63, 159.5, 119.5, 320, 240)

# Centre and half axes, metres, y up from the floor, x to the person's left, z to its front.
PERSON = (
    ((0.0, 1.15, 0.0), (0.17, 0.33, 0.11)),
    ((0.0, 1.62, 0.0), (0.085, 0.13, 0.1)),
    ((0.0, 1.45, 0.0), (0.06, 0.1, 0.06)),
    ((0.25, 1.15, 0.03), (0.045, 0.33, 0.045)),
    ((-0.25, 1.15, 0.03), (0.045, 0.33, 0.045)),
    ((0.1, 0.47, 0.0), (0.07, 0.5, 0.07)),
    ((-0.1, 0.47, 0.0), (0.07, 0.5, 0.07)),
)


def up_of_tilt(tilt: float) -> np.ndarray:
    """The vertical in the frame of a camera tilted downwards by `tilt` radians."""
    return np.array([0.0, -np.cos(tilt), -np.sin(tilt)])


def scene(
    camera: Camera,
    people: tuple[tuple[float, float], ...] = ((0.0, 3.0),),
    *,
    tilt: float = 0.0,
    height: float = 1.2,
    wall: float | None = None,
    floor: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """A depth image, uint16 (H, W) millimetres, and who is where: int (H, W), 0 room, 1.. the people.

    `people` stand at (x, distance) in front of a camera `height` metres above the floor; the wall is at a distance too.
    """
    rotation = level_rotation(up_of_tilt(tilt))
    rays = np.dstack([camera.rays(), np.ones(camera.shape)]) @ rotation.T  # level frame, per metre of z
    depth = np.full(camera.shape, np.inf)
    who = np.zeros(camera.shape, dtype=int)
    planes = ([((0.0, 1.0, 0.0), -height)] if floor else []) + ([((0.0, 0.0, 1.0), -wall)] if wall else [])
    with np.errstate(divide="ignore", invalid="ignore"):
        for normal, offset in planes:
            t = offset / (rays @ np.array(normal))
            depth = np.where((t > 0) & (t < depth), t, depth)
        for k, (x, distance) in enumerate(people, start=1):
            for centre, axes in PERSON:
                c = (np.array(centre) + (x, -height, -distance)) / axes
                r = rays / np.array(axes)
                a, b, e = (r**2).sum(-1), r @ c, (c**2).sum() - 1
                t = (b - np.sqrt(b * b - a * e)) / a
                hit = (t > 0) & (t < depth)
                depth, who = np.where(hit, t, depth), np.where(hit, k, who)
    depth = np.where(np.isfinite(depth) & (depth < 60), depth, 0.0)
    return np.rint(depth * 1000).astype(np.uint16), who


def person_alone(camera: Camera, x: float = 0.0, distance: float = 3.0) -> np.ndarray:
    """Depth of one person and nothing else, uint16 (H, W), millimetres."""
    return scene(camera, ((x, distance),))[0]
