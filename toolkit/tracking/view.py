"""What a tracker knows of the present frame before it decides: the cloud and its landmarks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.fitting.scene import Scene
from toolkit.landmarks.extrema import Extrema
from toolkit.landmarks.parts import JointEstimate
from toolkit.sensing.cloud import Cloud


@dataclass(frozen=True, eq=False)
class View:
    """One frame, normalised.

    Attributes
    ----------
    cloud : the person's points, level frame
    centre : float64 (3,), metres, level frame (Baak 2013, 5.3.4)
    yaw : radians, facing of the person
    extrema : the geodesic extrema (`E_I^20`)
    votes : the joints as the regressor sees them; None without a regressor
    scene : the frame as the fitter needs it
    """

    cloud: Cloud
    centre: np.ndarray
    yaw: float
    extrema: Extrema
    votes: JointEstimate | None
    scene: Scene
