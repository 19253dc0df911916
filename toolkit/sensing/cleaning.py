"""From a raw depth frame to the segmented, cleaned depth of one person (Baak 2013, 5.3.1).

Undistort, subtract the background or cut out the person, delete mixed pixels at contours, 3x3 median.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.errors import RecordingError, SettingsError
from toolkit.kernels import depth as kernels
from toolkit.sensing.camera import DEFAULT_UP, Camera
from toolkit.sensing.recording import Recording
from toolkit.sensing.segmentation import SegmentationMode, Segmenter

CONTOURS = {"keep": 0, "mixed": 3, "delete": 8}
"""Neighbours (of 8) at its depth that a pixel needs in order to stay, by the setting `contour`."""


@dataclass(frozen=True)
class SensingSettings:
    """How depth is cleaned.

    Attributes
    ----------
    segment : "auto" (a background if there is one, else already segmented frames), "segmented", "background",
        "empty-frames:N" (background learnt from the first N frames), "range:NEAR,FAR" (metres), "person" (the one
        person-sized thing in the room), "seed:U,V" (the thing at this pixel of the first frame)
    subject : who is meant where there are several people: "only" (two are an error), "largest" or "nearest"
    near, far : metres; depth outside is not used. A Kinect starts at 0.4 m, and no person beyond 8 m has enough pixels
    background_margin : metres that a pixel must lie before the background, on top of the quantisation of both; a ToF
        camera's noise is 1 to 2 cm, and a sole is 4 cm above the floor
    contour : "mixed" deletes pixels that fewer than 3 of their 8 neighbours support, "delete" every pixel at an edge as
        the paper does, "keep" none. On simulated time-of-flight images "delete" leaves 61 % of a person, for a forearm
        is 3 to 4 pixels wide at 176x144; "mixed" leaves 91 %, with 0.1 % beside the body against 2.7 % of "keep"
    contour_tolerance : metres within which a neighbour supports a pixel, on top of the quantisation; the side of a
        forearm falls off by 2 cm a pixel at 3 m
    quantisation : metres at 1 m; grows with the square of the distance. A Kinect v1 has 2.5 cm at 3 m (Baak 2013,
        5.3.1)
    median : take the 3x3 median
    half_resolution : keep every second pixel of every second row
    """

    segment: str = "auto"
    subject: str = "only"
    near: float = 0.3
    far: float = 8.0
    background_margin: float = 0.03
    contour: str = "mixed"
    contour_tolerance: float = 0.03
    quantisation: float = 0.0028
    median: bool = True
    half_resolution: bool = False

    def __post_init__(self) -> None:
        SegmentationMode.parse(self.segment)
        if self.contour not in CONTOURS:
            raise SettingsError(f"contour {self.contour!r} is none of: {', '.join(CONTOURS)}")
        if self.subject not in ("only", "largest", "nearest"):
            raise SettingsError(f"subject {self.subject!r} is none of: only, largest, nearest")
        if not 0 <= self.near < self.far <= 65.0:
            raise SettingsError(f"near {self.near} and far {self.far} are no range; give metres, near first, up to 65")
        for name in ("background_margin", "contour_tolerance", "quantisation"):
            if not 0 <= getattr(self, name) <= 1:
                raise SettingsError(f"{name} {getattr(self, name)} is out of range; give metres between 0 and 1")


class Cleaner:
    """Cleans the frames of one recording, in order: it follows the person from frame to frame.

    Parameters
    ----------
    camera : of the raw frames, lens distortion included
    background : uint16 (H, W), depth of the empty scene, millimetres, or None
    settings : how to clean
    up_camera : (3,), the vertical in the camera frame

    Attributes
    ----------
    camera : of the cleaned frames: without lens distortion, half as large if so set

    Raises
    ------
    SegmentationError
        The settings ask for a background and there is none.
    """

    def __init__(
        self,
        camera: Camera,
        background: np.ndarray | None = None,
        settings: SensingSettings | None = None,
        up_camera: np.ndarray | None = None,
    ) -> None:
        self.settings = settings or SensingSettings()
        self._raw_camera = camera
        ideal = camera.undistorted()
        self.camera = ideal.subsampled(2) if self.settings.half_resolution else ideal
        self._maps = _undistortion_maps(camera)
        flat = None if background is None else self._undistort(np.ascontiguousarray(background, dtype=np.uint16))
        up = np.array(DEFAULT_UP) if up_camera is None else np.asarray(up_camera, dtype=np.float64)
        self._segmenter = Segmenter(ideal, flat, self.settings, up)
        self._kept = np.zeros((camera.height + 2, camera.width + 2), dtype=np.uint16)

    @classmethod
    def for_recording(cls, recording: Recording, settings: SensingSettings | None = None) -> Cleaner:
        """A cleaner with the camera, background and vertical of `recording`."""
        return cls(recording.camera, recording.background, settings, recording.up_camera)

    def clean(self, depth_mm: np.ndarray) -> np.ndarray:
        """Clean one frame.

        Parameters
        ----------
        depth_mm : uint16 (H, W), millimetres along z, 0 = no measurement

        Returns
        -------
        float32 (H', W') of `self.camera`, metres along z, 0 = nothing or not the person. A new array. All zero for a
        frame without a person.

        Raises
        ------
        RecordingError
            The frame has another size or type.
        SegmentationError
            The person cannot be told from the scene, or there are several; the message names the option that helps.
        """
        if depth_mm.shape != self._raw_camera.shape or depth_mm.dtype != np.uint16:
            raise RecordingError(
                f"a frame is {depth_mm.dtype} {depth_mm.shape}; expected uint16 {self._raw_camera.shape}, millimetres"
            )
        settings = self.settings
        out = np.zeros(self.camera.shape, dtype=np.float32)
        person, box = self._segmenter.person(self._undistort(np.ascontiguousarray(depth_mm)))
        if box is None:
            return out
        _clear_around(self._kept, box)
        kernels.delete_contour(
            person,
            box,
            1000 * settings.contour_tolerance,
            1000 * settings.quantisation,
            CONTOURS[settings.contour],
            self._kept,
        )
        kernels.median_to_metres(self._kept, box, 2 if settings.half_resolution else 1, settings.median, out)
        return out

    def export_state(self) -> dict[str, Any]:
        """What the next frame depends on, see `PeopleFinder.export_state`."""
        return self._segmenter.export_state()

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `export_state` gave."""
        self._segmenter.restore_state(state)

    def _undistort(self, depth: np.ndarray) -> np.ndarray:
        if self._maps is None:
            return depth
        import cv2

        # Nearest, because a mean of two depths at an edge is a point where nothing is.
        return np.asarray(cv2.remap(depth, *self._maps, cv2.INTER_NEAREST))


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
    """Zero the ring of pixels around the window, which the median looks at."""
    v0, v1, u0, u1 = box
    image[v0 - 1, u0 - 1 : u1 + 1] = 0
    image[v1, u0 - 1 : u1 + 1] = 0
    image[v0 - 1 : v1 + 1, u0 - 1] = 0
    image[v0 - 1 : v1 + 1, u1] = 0
