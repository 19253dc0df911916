"""Pinhole camera with lens distortion, and the level frame.

Camera frame: x right, y down, z forward (OpenCV), metres. Integer pixel (u, v) is the centre of a pixel: `x = (u - cx)
z / fx` and `y = (v - cy) z / fy`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from toolkit.io.errors import RecordingError

DEFAULT_UP = (0.0, -1.0, 0.0)
"""Vertical in the camera frame of a horizontal camera."""


@dataclass(frozen=True)
class Camera:
    """Intrinsics of a pinhole camera with optional lens distortion.

    Attributes
    ----------
    fx, fy : focal lengths, pixels
    cx, cy : principal point, pixels; 0 is the centre of the first pixel
    width, height : pixels
    distortion : k1, k2, p1, p2, k3, or these and k4, k5, k6 of the rational model, in OpenCV's order; None for an
        ideal lens

    Raises
    ------
    RecordingError
        The intrinsics are implausible for a depth camera of this size.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    distortion: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise RecordingError(f"an image of {self.width}x{self.height} pixels is empty; check the recording")
        if not np.isfinite(self.intrinsics).all():
            raise RecordingError(f"intrinsics {self._text} are not finite; give fx, fy, cx, cy in pixels")
        for focal, size in ((self.fx, self.width), (self.fy, self.height)):
            if not 0.1 * size <= focal <= 20 * size:
                raise RecordingError(
                    f"intrinsics {self._text} are implausible at {self.width}x{self.height} pixels: a focal length of "
                    f"{focal:g} pixels; give fx, fy, cx, cy in pixels"
                )
        if not (
            -0.5 * self.width <= self.cx <= 1.5 * self.width and -0.5 * self.height <= self.cy <= 1.5 * self.height
        ):
            raise RecordingError(
                f"intrinsics {self._text} are implausible at {self.width}x{self.height} pixels: the principal point "
                "lies far outside; give fx, fy, cx, cy in pixels"
            )
        if self.distortion is None:
            return
        if len(self.distortion) not in (5, 8) or not np.isfinite(self.distortion).all():
            raise RecordingError(
                f"distortion {self.distortion} is not five finite numbers k1, k2, p1, p2, k3, or eight with k4, k5, k6"
            )
        # Smallest plausible radial factor of a lens at a corner of the image; fisheye lenses, which this model does
        # not fit, are below it.
        least_stretch = 0.3
        if not least_stretch <= self._stretch() <= 1 / least_stretch:
            raise RecordingError(
                f"distortion {self.distortion} moves the corners of the image {self._stretch():.3g} times as far from "
                "its centre; give the numbers of this lens, or none"
            )

    def _stretch(self) -> float:
        """Return the factor by which the lens moves the farthest corner of the image away from the centre."""
        k1, k2, p1, p2, k3, *rational = self.distortion or (0.0,) * 5
        k4, k5, k6 = rational or (0.0,) * 3
        x = max(self.cx, self.width - 1 - self.cx) / self.fx
        y = max(self.cy, self.height - 1 - self.cy) / self.fy
        r = x * x + y * y
        radial = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)))
        return abs(radial) + 4 * (abs(p1) + abs(p2)) * np.sqrt(r)

    @property
    def _text(self) -> str:
        return f"fx={self.fx:g}, fy={self.fy:g}, cx={self.cx:g}, cy={self.cy:g}"

    @classmethod
    def from_intrinsics(
        cls, intrinsics: np.ndarray, shape: tuple[int, int], distortion: np.ndarray | None = None
    ) -> Camera:
        """Return a camera of `fx, fy, cx, cy` (4,), an image shape (height, width) and optional distortion."""
        values = np.asarray(intrinsics, dtype=np.float64).ravel()
        if values.shape != (4,):
            raise RecordingError(f"intrinsics hold {values.size} numbers; give the four fx, fy, cx, cy in pixels")
        fx, fy, cx, cy = (float(v) for v in values)
        bent = None if distortion is None or not np.size(distortion) else tuple(float(d) for d in np.ravel(distortion))
        return cls(fx, fy, cx, cy, int(shape[1]), int(shape[0]), bent)

    @property
    def intrinsics(self) -> np.ndarray:
        """Float64 (4,): fx, fy, cx, cy, pixels."""
        return np.array([self.fx, self.fy, self.cx, self.cy], dtype=np.float64)

    @property
    def matrix(self) -> np.ndarray:
        """Float64 (3, 3): the camera matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the image."""
        return (self.height, self.width)

    def project(self, points_camera: np.ndarray) -> np.ndarray:
        """Return pixels (u, v) of points (..., 3) in the camera frame, without lens distortion: float64 (..., 2).

        Points at or behind the camera plane give NaN.
        """
        points = np.asarray(points_camera, dtype=np.float64)
        z = np.where(points[..., 2] > 0, points[..., 2], np.nan)
        return np.stack([points[..., 0] / z * self.fx + self.cx, points[..., 1] / z * self.fy + self.cy], axis=-1)

    def rays(self) -> np.ndarray:
        """Return slopes x/z and y/z of every pixel's ray, lens distortion removed: float64 (H, W, 2)."""
        return self._rays

    @cached_property
    def _rays(self) -> np.ndarray:
        u, v = np.meshgrid(np.arange(self.width, dtype=np.float64), np.arange(self.height, dtype=np.float64))
        if self.distortion is None:
            return np.stack([(u - self.cx) / self.fx, (v - self.cy) / self.fy], axis=-1)
        import cv2

        pixels = np.stack([u, v], axis=-1).reshape(-1, 1, 2)
        slopes = cv2.undistortPoints(pixels, self.matrix, np.asarray(self.distortion))
        return np.asarray(slopes, dtype=np.float64).reshape(self.height, self.width, 2)

    def scaled(self, factor: float) -> Camera:
        """Return the camera of the image resized by `factor` (> 0), with OpenCV's convention for pixel areas."""
        return replace(
            self,
            fx=self.fx * factor,
            fy=self.fy * factor,
            cx=(self.cx + 0.5) * factor - 0.5,
            cy=(self.cy + 0.5) * factor - 0.5,
            width=round(self.width * factor),
            height=round(self.height * factor),
        )

    def subsampled(self, step: int) -> Camera:
        """Return the camera of the image `depth[::step, ::step]`."""
        return replace(
            self,
            fx=self.fx / step,
            fy=self.fy / step,
            cx=self.cx / step,
            cy=self.cy / step,
            width=-(-self.width // step),
            height=-(-self.height // step),
        )

    def mirrored(self) -> Camera:
        """Return the camera of the image flipped left to right (u' = width - 1 - u)."""
        bent = self.distortion
        if bent is not None:  # the tangential term along x changes sign with x
            bent = (*bent[:3], -bent[3], *bent[4:])
        return replace(self, cx=self.width - 1 - self.cx, distortion=bent)

    def rotated(self, turns: int) -> Camera:
        """Return the camera of the image rotated clockwise by `turns` quarters (one: u' = height - 1 - v, v' = u)."""
        turned = self
        for _ in range(turns % 4):
            bent = turned.distortion
            if bent is not None:
                bent = (*bent[:2], bent[3], -bent[2], *bent[4:])
            turned = Camera(
                fx=turned.fy,
                fy=turned.fx,
                cx=turned.height - 1 - turned.cy,
                cy=turned.cx,
                width=turned.height,
                height=turned.width,
                distortion=bent,
            )
        return turned

    def undistorted(self) -> Camera:
        """Return the camera with an ideal lens."""
        return replace(self, distortion=None)


def rotated_points(points_camera: np.ndarray, turns: int) -> np.ndarray:
    """Return points or directions (..., 3) of a camera in the frame of that camera `rotated` by `turns` quarters."""
    x, y, z = np.moveaxis(np.asarray(points_camera), -1, 0)
    for _ in range(turns % 4):
        x, y = -y, x
    return np.stack([x, y, z], axis=-1)


def level_rotation(up_camera: np.ndarray) -> np.ndarray:
    """Return `R_level_camera`, float64 (3, 3): y up along gravity, z horizontally towards the camera, x = y x z.

    `up_camera` (3,) is the vertical in the camera frame, of any length. For a camera that points straight up or down, z
    is the image's vertical, the limit of tilting the camera there.

    Raises
    ------
    RecordingError
        `up_camera` has no direction.
    """
    up = np.asarray(up_camera, dtype=np.float64)
    length = math.hypot(*up) if up.shape == (3,) else 0.0
    if not np.isfinite(length) or length < 1e-6:
        raise RecordingError(f"the vertical (--up) {up.tolist()} is no direction; give three numbers such as 0, -1, 0")
    y = up / length
    looking_down = y[2] < 0
    towards = np.array([0.0, 0.0, -1.0]) if abs(y[2]) < 0.999 else np.array([0.0, 1.0 if looking_down else -1.0, 0.0])
    z = towards - np.sum(towards * y) * y
    z /= math.hypot(*z)
    return np.stack([np.cross(y, z), y, z])
