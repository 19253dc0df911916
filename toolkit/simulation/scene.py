"""Where the camera stands and what surrounds the subject."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.errors import UsageError


@dataclass(frozen=True)
class View:
    """A camera in the world of a clip.

    Attributes
    ----------
    R_level_world : float64 (3, 3), turns world directions into the level frame
    R_level_camera : float64 (3, 3)
    position_world : float64 (3,), metres
    """

    R_level_world: np.ndarray
    R_level_camera: np.ndarray
    position_world: np.ndarray

    @property
    def up_camera(self) -> np.ndarray:
        """Float64 (3,): the vertical in the camera frame."""
        return self.R_level_camera.T @ np.array([0.0, 1.0, 0.0])

    def to_level(self, points_world: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the world in the level frame."""
        return (points_world - self.position_world) @ self.R_level_world.T

    def to_camera(self, points_world: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the world in the camera frame."""
        return self.to_level(points_world) @ self.R_level_camera


def place_camera(
    centre_world: np.ndarray, facing_world: float, *, distance: float, height: float, tilt: float, yaw: float
) -> View:
    """A camera that has the subject in the middle of its image from left to right.

    Parameters
    ----------
    centre_world : (3,), point on the floor below the subject, metres
    facing_world : yaw of the subject's facing about +y from +z, radians
    distance : horizontally from the camera to the centre, metres (> 0)
    height : of the camera above the floor, metres
    tilt : downwards from the horizontal, radians
    yaw : of the subject's facing in the level frame, radians: 0 faces the camera, positive turns to the subject's left

    Raises
    ------
    UsageError
        The distance is not positive, or a value is not finite.
    """
    values = {"distance": distance, "height": height, "tilt": tilt, "yaw": yaw}
    for name, value in values.items():
        if not np.isfinite(value):
            raise UsageError(f"the camera's {name} {value} is not finite; give a number")
    if distance <= 0:
        raise UsageError(f"the camera's distance {distance} is not positive; give metres from camera to subject")
    back = facing_world - yaw
    z_level = np.array([np.sin(back), 0.0, np.cos(back)])
    y_level = np.array([0.0, 1.0, 0.0])
    sine, cosine = np.sin(tilt), np.cos(tilt)
    return View(
        R_level_world=np.stack([np.cross(y_level, z_level), y_level, z_level]),
        R_level_camera=np.array([[1.0, 0.0, 0.0], [0.0, -cosine, -sine], [0.0, sine, -cosine]]),
        position_world=centre_world + distance * z_level + height * y_level,
    )


def room(reach_level: np.ndarray, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """A furnished room around the space that the subject uses, in the level frame.

    Parameters
    ----------
    reach_level : (2, 3), lowest and highest corner of the subject's space, metres
    floor : height of the floor in the level frame (negative: below the camera), metres

    Returns
    -------
    vertices float64 (V, 3) and faces int32 (F, 3); the walls stand at least 0.9 m away from the subject's space.
    """
    (left, _, back), (right, _, _) = reach_level
    left, right, back = left - 1.2, right + 1.2, back - 0.9
    front, ceiling = 3.0, floor + 2.7
    boxes = [
        ((left, floor, back), (left + 0.5, floor + 1.9, back + 0.45)),
        ((right - 0.8, floor, back), (right - 0.1, floor + 0.75, back + 0.6)),
        ((right - 0.6, floor + 0.75, back + 0.1), (right - 0.3, floor + 1.1, back + 0.3)),
    ]
    shell, shell_faces = _box((left, floor, back), (right, ceiling, front))
    vertices, faces = [shell], [shell_faces[:, ::-1]]
    for low, high in boxes:
        corners, sides = _box(low, high)
        faces.append(sides + 8 * len(vertices))
        vertices.append(corners)
    return np.concatenate(vertices), np.concatenate(faces)


def _box(low: tuple[float, ...], high: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Corners (8, 3) and outward triangles (12, 3) of an upright box."""
    bits = np.array([[k >> 2 & 1, k >> 1 & 1, k & 1] for k in range(8)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    return np.where(bits == 0, low, high), triangles
