"""Finder of one person, segmented by the settings, as cleaned depth (Baak 2013, 5.3.1).

Steps: undistort, subtract the background or segment the person, delete mixed pixels at contours, 3x3 median.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from toolkit.people.evidence import Evidence
from toolkit.people.segmentation import Segmenter
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.people.visibility import hole_sizes, unobserved_pixels
from toolkit.sensing.camera import DEFAULT_UP, Camera
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings


class SinglePersonSegmenter:
    """Finder of the one person that the settings select; each frame is a sighting, empty where the person is absent.

    Parameters
    ----------
    camera : camera of the raw frames, lens distortion included
    background : uint16 (H, W), depth of the empty scene, millimetres, or None
    settings : segmentation and cleaning
    up_camera : (3,), the vertical in the camera frame

    Attributes
    ----------
    camera : camera of the cleaned frames: without lens distortion, half as large if so set

    Raises
    ------
    SegmentationError
        The settings ask for a background and there is none.
    """

    CHECKPOINT: tuple[str, ...] = ("_segmenter",)
    evidence: Mapping[int, Evidence] = MappingProxyType({})

    def __init__(
        self,
        camera: Camera,
        background: np.ndarray | None = None,
        settings: SensingSettings | None = None,
        up_camera: np.ndarray | None = None,
    ) -> None:
        settings = settings or SensingSettings()
        self._filter = DepthFilter(camera, settings)
        self.camera = self._filter.camera
        flat = None
        if background is not None:
            flat = self._filter.undistort(np.ascontiguousarray(background, dtype=np.uint16))
        up = np.array(DEFAULT_UP) if up_camera is None else np.asarray(up_camera, dtype=np.float64)
        self._segmenter = Segmenter(self._filter.flat_camera, flat, settings, up)

    @classmethod
    def of(cls, recording: Recording, settings: SensingSettings | None = None) -> SinglePersonSegmenter:
        """Return a finder with the camera, background and vertical of `recording`."""
        return cls(recording.camera, recording.background, settings, recording.up_camera)

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        """Find the person, see `PeopleFinder.find`; raises as `clean`."""
        depth, whole_mm = self._cut(depth_mm)
        holes = None if self._segmenter.cut_out else hole_sizes(whole_mm)
        return (Sighting(1, depth, unobserved_pixels(whole_mm, depth, holes), self.camera),)

    def redetect(self) -> None:
        """Return None, see `PeopleFinder.redetect`."""

    def clean(self, depth_mm: np.ndarray) -> np.ndarray:
        """Return the person's depth in a frame.

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
            The person cannot be separated from the scene, or there are several; the message names an option.
        """
        return self._cut(depth_mm)[0]

    def _cut(self, depth_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the result of `clean` and the whole frame, uint16 (H', W') of `self.camera`, millimetres."""
        flat = self._filter.checked(depth_mm)
        step = self._filter.step
        person, box = self._segmenter.person(flat)
        if box is None:
            return np.zeros(self.camera.shape, dtype=np.float32), flat[::step, ::step]
        return self._filter.filtered(person, box), flat[::step, ::step]
