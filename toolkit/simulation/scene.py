"""Position of the camera and surroundings of the people.

All objects are on a floor plan: x to the right in the image, y up from the floor, z towards the camera. The origin is
in front of the camera at its distance. The level frame is the floor plan relative to the camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import UsageError
from toolkit.sensing.camera import Camera
from toolkit.simulation.furniture import Box, boxes_mesh
from toolkit.simulation.interiors.mesh import Mesh, box, joined
from toolkit.simulation.interiors.pieces import PLAIN
from toolkit.simulation.interiors.room import furnished, named_room

FURNITURE_DISTANCE = 0.22
"""Metres from people's joints to the furniture of a room, which may touch their clothes."""
SIGHT = np.linspace(0.1, 1.0, 10)
"""Fractions of the line from the camera to the centre of the people that are kept free."""


@dataclass(frozen=True)
class PlacedCamera:
    """Camera on the floor plan.

    Attributes
    ----------
    R_level_camera : float64 (3, 3)
    position : float64 (3,), on the floor plan, metres
    """

    R_level_camera: np.ndarray
    position: np.ndarray

    @property
    def up_camera(self) -> np.ndarray:
        """Vertical in the camera frame, float64 (3,)."""
        return self.R_level_camera.T @ np.array([0.0, 1.0, 0.0])

    def to_level(self, points: np.ndarray) -> np.ndarray:
        """Return points (..., 3) of the floor plan in the level frame."""
        return points - self.position

    def to_camera(self, points: np.ndarray) -> np.ndarray:
        """Return points (..., 3) of the floor plan in the camera frame."""
        return self.to_level(points) @ self.R_level_camera


def place_camera(*, distance: float, height: float, tilt: float) -> PlacedCamera:
    """Return a camera with the origin of the floor plan in the middle image column.

    Parameters
    ----------
    distance : horizontally from the camera to the origin, metres (> 0)
    height : of the camera above the floor, metres (> 0)
    tilt : downwards from the horizontal, radians

    Raises
    ------
    UsageError
        Distance or height is not positive, or a value is not finite.
    """
    for name, value in {"distance": distance, "height": height, "tilt": tilt}.items():
        if not np.isfinite(value):
            raise UsageError(f"the camera's {name} {value} is not finite; give a number")
    if distance <= 0:
        raise UsageError(f"the camera's distance {distance} is not positive; give metres from camera to subject")
    if height <= 0:
        raise UsageError(f"the camera's height {height} is not above the floor; give metres")
    sine, cosine = np.sin(tilt), np.cos(tilt)
    return PlacedCamera(
        R_level_camera=np.array([[1.0, 0.0, 0.0], [0.0, -cosine, -sine], [0.0, sine, -cosine]]),
        position=np.array([0.0, height, distance]),
    )


@dataclass(frozen=True, eq=False)
class Scenery:
    """Surroundings of the people, camera frame.

    Attributes
    ----------
    mesh : all surfaces
    reflectance : float32 (F,), relative to a plain surface; None if all faces are plain
    """

    mesh: Mesh
    reflectance: np.ndarray | None

    def reflectance_of(self, triangles: np.ndarray) -> np.ndarray | None:
        """Return the reflectance of triangles (H, W), -1 = none, as `Surface.reflectance`."""
        if self.reflectance is None:
            return None
        return np.where(triangles >= 0, self.reflectance[triangles], 0.0).astype(np.float32)


def surroundings(name: str | None, used: Sequence[np.ndarray], furniture: Mesh, view: PlacedCamera) -> Scenery:
    """Return the room around people: a bare one, or a randomly furnished one.

    Parameters
    ----------
    name : kind and seed such as "office:7", or None
    used : points (N, 3) of the people, floor plan; furniture stays `FURNITURE_DISTANCE` metres away from them and from
        the line of sight of the camera
    furniture : furniture of the people
    view : position of the camera
    """
    points = np.concatenate([*used, furniture.vertices])
    reach = np.array([points.min(axis=0), points.max(axis=0)])
    if name is None:
        mesh = joined([room(reach, view.position), furniture])
        return Scenery(Mesh(view.to_camera(mesh.vertices), mesh.faces), None)
    kind, seed = named_room(name)
    reach[1, 1] = max(reach[1, 1], view.position[1] + 0.1)
    own = points[:, [0, 2]]
    sight = view.position[[0, 2]] + SIGHT[:, None] * (own.mean(axis=0) - view.position[[0, 2]])
    free = np.concatenate([np.unique(np.round(own, 1), axis=0), sight])
    camera = (float(view.position[0]), float(view.position[2]))
    rng = np.random.default_rng(seed)
    around = furnished(kind, rng, camera=camera, reach=reach, free=free, clearance=FURNITURE_DISTANCE).surfaces()
    mesh = joined([around.mesh, furniture])
    reflectance = np.concatenate([around.reflectance / PLAIN, np.ones(len(furniture.faces))])
    return Scenery(Mesh(view.to_camera(mesh.vertices), mesh.faces), np.minimum(reflectance, 1.0).astype(np.float32))


def room(reach: np.ndarray, camera: np.ndarray) -> Mesh:
    """Return a bare room around the space of the people, on the floor plan.

    Parameters
    ----------
    reach : (2, 3), lowest and highest corner of that space, metres
    camera : (3,), position of the camera, which is also inside the room

    Returns
    -------
    A shell with its faces inwards, and boxes along the far wall at least 0.9 m away from the people's space.
    """
    (left, _, back), (right, _, _) = reach
    left, right, back = left - 1.2, right + 1.2, back - 0.9
    shell = box((left, 0.0, back), (right, max(2.7, camera[1] + 0.2), camera[2] + 3.0))
    furniture = (
        Box((left, 0.0, back), (left + 0.5, 1.9, back + 0.45)),
        Box((right - 0.8, 0.0, back), (right - 0.1, 0.75, back + 0.6)),
        Box((right - 0.6, 0.75, back + 0.1), (right - 0.3, 1.1, back + 0.3)),
    )
    return joined([Mesh(shell.vertices, shell.faces[:, ::-1]), boxes_mesh(furniture)])


def cut_tilt(camera: Camera, height: float, distance: float, cut: float) -> float:
    """Return the tilt in radians downwards at which the lowest image row is at the height `cut`, metres.

    The camera is `height` metres above the floor and `distance` metres in front of the subject.
    """
    return float(np.arctan2(height - cut, distance) - np.arctan2(camera.height - 1 - camera.cy, camera.fy))
