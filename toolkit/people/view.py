"""Coarse frames for people detection: downsampled depth, points in the level frame, foreground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.kernels import linear
from toolkit.people.person_network import PersonNetwork, person_network
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.sensing_settings import SensingSettings


@dataclass(frozen=True, eq=False)
class View:
    """One coarse frame.

    Attributes
    ----------
    depth : float32 (h, w), metres along z, 0 = no measurement or out of range
    points : float32 (h, w, 3), level frame, metres
    foreground : bool (h, w), measured and not background
    still : bool (h, w), pixels without motion while the background was learnt
    """

    depth: np.ndarray
    points: np.ndarray
    foreground: np.ndarray
    still: np.ndarray


class CoarseCamera:
    """Camera of the coarse frames.

    Parameters
    ----------
    camera : camera of the full frames, without lens distortion
    up_camera : (3,), the vertical in the camera frame
    sensing : its `near` and `far` bound measured depth
    width : approximate width of the coarse frames, pixels
    network : finds people in them; None = the network of the package

    Attributes
    ----------
    step : every `step`-th pixel is kept
    camera : camera of the coarse frames
    rays : float64 (h, w, 2), x/z and y/z
    up : float64 (3,), of length 1
    rotation : `R_level_camera`
    quantisation : metres at 1 m, growing with the square of the distance
    """

    def __init__(
        self,
        camera: Camera,
        up_camera: np.ndarray,
        sensing: SensingSettings,
        width: int = 160,
        network: PersonNetwork | None = None,
    ) -> None:
        self.step = max(1, round(camera.width / width))
        self.camera = camera.subsampled(self.step)
        self.rays = self.camera.rays()
        self.rotation = level_rotation(up_camera)
        self.up = self.rotation[1].copy()
        self._network = network
        self._last: tuple[np.ndarray, tuple[np.ndarray, np.ndarray]] | None = None
        self._near, self._far = sensing.near, sensing.far
        self.quantisation = sensing.quantisation
        ones = np.ones((*self.camera.shape, 1))
        rays = np.concatenate([self.rays, ones], axis=2)
        self._directions = self.to_level(rays).astype(np.float32)

    def to_level(self, vectors: np.ndarray) -> np.ndarray:
        """Rotate vectors (N, 3) from the camera frame to the level frame."""
        return linear.rotated(vectors, self.rotation.T)

    def from_level(self, vectors: np.ndarray) -> np.ndarray:
        """Rotate vectors (N, 3) from the level frame to the camera frame."""
        return linear.rotated(vectors, self.rotation)

    def shows(self, place: np.ndarray, margin: float = 0.0) -> bool:
        """Return True if a point (3,), level frame, lies in the image, `margin` from its border; in metres."""
        x, y, z = self.from_level(place[None])[0]
        if z <= 0:
            return False
        u, v = self.camera.fx * x / z + self.camera.cx, self.camera.fy * y / z + self.camera.cy
        aside, above = self.camera.fx * margin / z, self.camera.fy * margin / z
        return bool(aside <= u < self.camera.width - aside and above <= v < self.camera.height - above)

    def downsampled(self, depth_mm: np.ndarray) -> np.ndarray:
        """Downsample a frame (H, W), millimetres: float32 (h, w), metres, 0 out of range."""
        z = depth_mm[:: self.step, :: self.step].astype(np.float32) * np.float32(1e-3)
        z[(z < self._near) | (z > self._far)] = 0.0
        return z

    def view(self, depth: np.ndarray, foreground: np.ndarray, still: np.ndarray) -> View:
        """Return a coarse frame with its points."""
        return View(depth, self._directions * depth[..., None], foreground, still)

    def person_odds(self, depth: np.ndarray) -> np.ndarray:
        """Return the log-odds of a person in the pixels of a coarse frame, see `PersonNetwork.odds`."""
        return self._odds(depth)[0]

    def head_odds(self, depth: np.ndarray) -> np.ndarray:
        """Return the log-odds of a head in the pixels of a coarse frame, see `PersonNetwork.odds`."""
        return self._odds(depth)[1]

    def _odds(self, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return both; those of the last frame are kept."""
        if self._last is None or self._last[0] is not depth:
            self._last = depth, (self._network or person_network()).odds(depth, self.camera)
        return self._last[1]

    def area(self, depth: np.ndarray) -> float:
        """Return the area of coarse pixels with these depths, square metres, as if each faced the camera."""
        return float((depth.astype(np.float64) ** 2).sum() / (self.camera.fx * self.camera.fy))
