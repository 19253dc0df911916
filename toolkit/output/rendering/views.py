"""Views of a film: a crop of the recording's image, a camera at the subject's left, and one above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.sensing.camera import Camera

WINDOW_MARGIN = 0.18  # margin relative to the extent of the person

R_LEVEL_VIEW = {
    "side": np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "plan": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Rotations from these cameras to the level frame. The side camera looks along -x with the depth camera at the left;
the plan camera looks along -y with the depth camera below."""


@dataclass(frozen=True)
class Window:
    """An enlarged crop of the recording's image.

    Attributes
    ----------
    camera : camera of the enlarged picture
    u, v : upper left corner in the recording's image, pixels (may lie outside)
    scale : pixels of the picture per pixel of the image
    """

    camera: Camera
    u: float
    v: float
    scale: float

    def cut(self, image: np.ndarray, beyond: tuple[int, int, int]) -> np.ndarray:
        """Return the crop of an RGB image (H, W, 3), enlarged without smoothing, `beyond` outside the image."""
        import cv2

        # Pixel centres are integers: picture pixel p shows image pixel (p + 0.5) / scale - 0.5 + corner.
        shift = 0.5 / self.scale - 0.5
        back = np.array([[1 / self.scale, 0, self.u + shift], [0, 1 / self.scale, self.v + shift]])
        size = (self.camera.width, self.camera.height)
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(image, back, size, flags=flags, borderValue=beyond))


def window_on(joints: np.ndarray, camera: Camera, size: tuple[int, int]) -> Window:
    """Return the crop of `size` (width, height) pixels with all joints (..., 3), metres, camera frame."""
    pixels = camera.project(joints).reshape(-1, 2)
    pixels = pixels[np.isfinite(pixels).all(axis=1)]
    if not len(pixels):
        pixels = np.array([[0.0, 0.0], [camera.width, camera.height]])
    low, high = np.percentile(pixels, (0.5, 99.5), axis=0)
    low, high = np.clip(low, 0, (camera.width, camera.height)), np.clip(high, 0, (camera.width, camera.height))
    extent = (high - low) * (1 + 2 * WINDOW_MARGIN)
    least_window = 0.35  # relative to the image height
    height = max(extent[1], extent[0] * size[1] / size[0], least_window * camera.height)
    scale = size[1] / height
    u, v = (low + high) / 2 - np.array(size) / scale / 2
    picture = Camera(
        camera.fx * scale,
        camera.fy * scale,
        (camera.cx - u + 0.5) * scale - 0.5,
        (camera.cy - v + 0.5) * scale - 0.5,
        *size,
    )
    return Window(picture, float(u), float(v), float(scale))


@dataclass(frozen=True)
class OutsideView:
    """A camera that is placed in the level frame.

    Attributes
    ----------
    camera : camera of the picture
    centre : float64 (3,), its position, metres, level frame
    rotation : float64 (3, 3), takes its frame to the level frame
    """

    camera: Camera
    centre: np.ndarray
    rotation: np.ndarray

    def to_camera(self, points_level: np.ndarray) -> np.ndarray:
        """Return points (..., 3) of the level frame in the frame of this camera."""
        return (points_level - self.centre) @ self.rotation

    def project(self, points_level: np.ndarray) -> np.ndarray:
        """Return the pixels (..., 2) of points (..., 3), NaN behind the camera."""
        return self.camera.project(self.to_camera(points_level))


def outside_view_of(joints_level: np.ndarray, size: tuple[int, int], view: str) -> OutsideView:
    """Return the view "side" or "plan" of `size` (width, height) pixels with all joints (..., 3), level frame."""
    rotation = R_LEVEL_VIEW[view]
    low, high = np.percentile(joints_level.reshape(-1, 3) @ rotation, (0.5, 99.5), axis=0)
    extent = (high - low) * (1 + 2 * WINDOW_MARGIN)
    least_span = 2.0  # m of height in these views
    span = max(extent[1], extent[0] * size[1] / size[0], least_span)
    distance = 8.0  # m: far enough for a weak perspective
    focal = size[1] * distance / span
    camera = Camera(focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2, *size)
    return OutsideView(camera, rotation @ ((low + high) / 2 - (0.0, 0.0, distance)), rotation)
