"""Filtering of depth images before and after the segmentation of a person (Baak 2013, 5.3.1)."""

from __future__ import annotations

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.kernels.image import depth as kernels
from toolkit.sensing.camera import Camera
from toolkit.sensing.sensing_settings import SUPPORT, SensingSettings


class DepthFilter:
    """Filter that removes lens distortion from raw frames, and mixed pixels and noise from people.

    Parameters
    ----------
    camera : camera of the raw frames, lens distortion included
    settings : filter settings

    Attributes
    ----------
    flat_camera : camera of undistorted frames
    camera : camera of filtered depth: without lens distortion, at half resolution if so set
    """

    def __init__(self, camera: Camera, settings: SensingSettings) -> None:
        self._raw, self._settings = camera, settings
        self.flat_camera = camera.undistorted()
        self.step = 2 if settings.half_resolution else 1
        self.camera = self.flat_camera.subsampled(self.step) if self.step > 1 else self.flat_camera
        self._maps = _undistortion_maps(camera)
        self._kept = np.zeros((camera.height + 2, camera.width + 2), dtype=np.uint16)

    def checked(self, depth_mm: np.ndarray) -> np.ndarray:
        """Return a raw frame, undistorted.

        Raises
        ------
        RecordingError
            Its size or type differs from the recording's camera.
        """
        if depth_mm.shape != self._raw.shape or depth_mm.dtype != np.uint16:
            raise RecordingError(
                f"a frame is {depth_mm.dtype} {depth_mm.shape}; expected uint16 {self._raw.shape}, millimetres"
            )
        return self.undistort(np.ascontiguousarray(depth_mm))

    def undistort(self, depth: np.ndarray) -> np.ndarray:
        """Return a depth image (H, W) of `flat_camera`."""
        if self._maps is None:
            return depth
        import cv2

        # Nearest neighbour, because the mean of two depths at an edge is a point in free space.
        return np.asarray(cv2.remap(depth, *self._maps, cv2.INTER_NEAREST))

    def filtered(self, padded: np.ndarray, box: np.ndarray) -> np.ndarray:
        """Delete contour pixels and apply the 3x3 median: float32 (H', W') of `camera`, metres, a new array.

        `padded` is the person's depth, uint16 (H + 2, W + 2), millimetres, and `box` its window (v0, v1, u0, u1, ends
        excluded, padded indices).
        """
        settings = self._settings
        out = np.zeros(self.camera.shape, dtype=np.float32)
        _clear_around(self._kept, box)
        if settings.contour == "silhouette":
            kernels.delete_silhouette(padded, box, self._kept)
        else:
            tolerances = 1000 * settings.contour_tolerance, 1000 * settings.quantisation
            kernels.delete_contour(padded, box, *tolerances, SUPPORT[settings.contour], self._kept)
        kernels.median_to_metres(self._kept, box, self.step, settings.median, out)
        return out


def _undistortion_maps(camera: Camera) -> tuple[np.ndarray, np.ndarray] | None:
    if camera.distortion is None:
        return None
    import cv2

    size = (camera.width, camera.height)
    maps = cv2.initUndistortRectifyMap(
        camera.matrix, np.asarray(camera.distortion), np.eye(3), camera.matrix, size, cv2.CV_32FC1
    )
    return np.asarray(maps[0]), np.asarray(maps[1])


def _clear_around(image: np.ndarray, box: np.ndarray) -> None:
    """Zero the ring of pixels around the window, which the median reads."""
    v0, v1, u0, u1 = box
    image[v0 - 1, u0 - 1 : u1 + 1] = 0
    image[v1, u0 - 1 : u1 + 1] = 0
    image[v0 - 1 : v1 + 1, u0 - 1] = 0
    image[v0 - 1 : v1 + 1, u1] = 0
