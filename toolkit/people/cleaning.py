"""From a raw depth frame to the segmented, cleaned depth of one person (Baak 2013, 5.3.1).

Undistort, subtract the background or cut out the person, delete mixed pixels at contours, 3x3 median.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from toolkit.people.segmentation import Segmenter
from toolkit.sensing.camera import DEFAULT_UP, Camera
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.recording import Recording
from toolkit.sensing.settings import SensingSettings


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
        self._polisher = DepthFilter(camera, self.settings)
        self.camera = self._polisher.camera
        flat = None
        if background is not None:
            flat = self._polisher.undistort(np.ascontiguousarray(background, dtype=np.uint16))
        up = np.array(DEFAULT_UP) if up_camera is None else np.asarray(up_camera, dtype=np.float64)
        self._segmenter = Segmenter(self._polisher.flat_camera, flat, self.settings, up)

    @property
    def cut_out(self) -> bool:
        """Whether the frames hold nobody but the person, so that nobody is where nothing was measured."""
        return self._segmenter.cut_out

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
        return self.cut(depth_mm)[0]

    def cut(self, depth_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `clean`, and beside it all that was measured: uint16 (H', W') of `self.camera`, millimetres."""
        flat = self._polisher.checked(depth_mm)
        step = self._polisher.step
        person, box = self._segmenter.person(flat)
        if box is None:
            return np.zeros(self.camera.shape, dtype=np.float32), flat[::step, ::step]
        return self._polisher.filtered(person, box), flat[::step, ::step]

    def export_state(self) -> dict[str, Any]:
        """What the next frame depends on, see `PeopleFinder.export_state`."""
        return self._segmenter.export_state()

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `export_state` gave."""
        self._segmenter.restore_state(state)
