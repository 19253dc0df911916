"""Position of the camera and surroundings of the people.

All objects are on a floor plan: x to the right in the image, y up from the floor, z towards the camera. The origin is
in front of the camera at its distance. The level frame is the floor plan relative to the camera.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.sensing.camera import Camera
from toolkit.simulation.furniture import Box, boxes_mesh
from toolkit.simulation.mesh import Mesh, box, joined

RoomMaker = Callable[[np.ndarray, np.ndarray], tuple[Mesh, np.ndarray]]
"""Room around points (N, 3) of people and the position (3,) of a camera, floor plan: its surfaces, and their
reflectance (F,) relative to a plain surface."""


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

    def to_camera(self, points: np.ndarray) -> np.ndarray:
        """Return points (..., 3) of the floor plan in the camera frame."""
        return (points - self.position) @ self.R_level_camera


def place_camera(*, distance: float, height: float, tilt: float) -> PlacedCamera:
    """Return a camera with the origin of the floor plan in the middle image column.

    Parameters
    ----------
    distance : horizontally from the camera to the origin, metres (> 0)
    height : height of the camera above the floor, metres (> 0)
    tilt : downwards from the horizontal, radians
    """
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


def surroundings(maker: RoomMaker | None, used: Sequence[np.ndarray], furniture: Mesh, view: PlacedCamera) -> Scenery:
    """Return the room around people: a bare one, or that of a maker.

    Parameters
    ----------
    maker : None for a bare room
    used : points (N, 3) of the people, floor plan
    furniture : furniture of the people
    view : position of the camera
    """
    points = np.concatenate([*used, furniture.vertices])
    if maker is None:
        shell, reflectance = room(np.array([points.min(axis=0), points.max(axis=0)]), view.position), None
    else:
        shell, around = maker(points, view.position)
        both = np.concatenate([around, np.ones(len(furniture.faces))])
        reflectance = np.minimum(both, 1.0).astype(np.float32)
    mesh = joined([shell, furniture])
    return Scenery(Mesh(view.to_camera(mesh.vertices), mesh.faces), reflectance)


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
