"""Depth pictures of a recording without detected people."""

from __future__ import annotations

import numpy as np

from toolkit.output.rendering import style
from toolkit.output.rendering.overlay import color_depth
from toolkit.output.rendering.painter import RenderSettings
from toolkit.sensing.recording import Recording


class DepthPainter:
    """Painter of frames without people.

    Parameters
    ----------
    recording : whose frames are painted in order
    settings : height of the picture; panels of people are left out
    """

    def __init__(self, recording: Recording, settings: RenderSettings) -> None:
        self._height = settings.height
        self._name, self._times = recording.name, recording.timestamps
        self._range: tuple[float, float] | None = None

    def paint(self, i: int, depth_mm: np.ndarray) -> np.ndarray:
        """Return the picture of frame `i` from its depth, uint16 (H, W) millimetres: RGB, uint8."""
        import cv2

        near, far = self._near_and_far(depth_mm)
        colored = color_depth(depth_mm, np.ones(depth_mm.shape, dtype=bool), near, far)
        width = 2 * round(self._height * depth_mm.shape[1] / depth_mm.shape[0] / 2)  # even, for film codecs
        image = cv2.resize(colored, (width, self._height), interpolation=cv2.INTER_NEAREST)
        size = max(9, self._height // 30)
        bar = np.full((2 * size, width, 3), style.BAR, dtype=np.uint8)
        x = style.write(bar, f"{self._name}   frame {i + 1}/{len(self._times)}", 10, size // 3, size)
        x = style.write(bar, f"{self._times[i]:.2f} s", x + size, size // 3, size, style.FAINT)
        style.write(bar, "no person", x + size, size // 3, size, style.ALARM)
        return np.vstack([bar, image])

    def _near_and_far(self, depth_mm: np.ndarray) -> tuple[float, float]:
        """Return the range of the colour scale in metres, the same for all frames."""
        measured = depth_mm[depth_mm > 0]
        # Percentiles of the depth of the first measured frame at the ends of the colour scale.
        nearest_share, farthest_share = 2.0, 98.0
        if self._range is None and len(measured):
            near, far = np.percentile(measured, [nearest_share, farthest_share]) / 1000.0
            self._range = float(near), float(far)
        return self._range or (0.0, 1.0)
