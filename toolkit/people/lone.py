"""One person: cut out of every frame by the settings, as cleaned depth. The simplest people finder."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from toolkit.people.cleaning import Cleaner
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.people.visibility import hole_sizes, unobserved_pixels
from toolkit.sensing.camera import Camera
from toolkit.sensing.settings import SensingSettings

ID = 1


class LonePerson:
    """Finds the one person whom the settings mean; every frame is a sighting, an empty one where nobody is.

    Parameters
    ----------
    camera, background, settings, up_camera : see `Cleaner`
    """

    furniture: frozenset[int] = frozenset()

    def __init__(
        self, camera: Camera, background: np.ndarray | None, settings: SensingSettings, up_camera: np.ndarray
    ) -> None:
        self._cleaner = Cleaner(camera, background, settings, up_camera)
        self.camera = self._cleaner.camera

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        """See `PeopleFinder.find`."""
        depth, whole_mm = self._cleaner.cut(depth_mm)
        unobserved = unobserved_pixels(whole_mm, depth, hole_sizes(whole_mm), cut_out=self._cleaner.cut_out)
        return (Sighting(ID, depth, unobserved, self.camera),)

    def export_state(self) -> dict[str, Any]:
        """See `PeopleFinder.export_state`."""
        return self._cleaner.export_state()

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """See `PeopleFinder.restore_state`."""
        self._cleaner.restore_state(state)
