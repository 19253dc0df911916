"""The joint regressor as a judge of people: how likely pixels of a whole image are of a person."""

from __future__ import annotations

import numpy as np

from toolkit.landmarks.regressor import JointRegressor
from toolkit.sensing.camera import Camera

SURE = 0.999
"""Probability beyond which a pixel is no surer."""


class RegressorJudge:
    """A `toolkit.people.hypothesis.PersonJudge`.

    Parameters
    ----------
    regressor : of a pose database
    """

    def __init__(self, regressor: JointRegressor) -> None:
        self._regressor = regressor

    def log_odds(self, depth: np.ndarray, camera: Camera, rotation: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """See `PersonJudge.log_odds`."""
        chances = self._regressor.person_probability(depth, camera.intrinsics, rotation, pixels)
        chances = np.clip(chances, 1.0 - SURE, SURE)
        return np.asarray(np.log(chances / (1.0 - chances)))
