"""Which way a person walks, by where they were before and after: it tells front from back where the depth does not.

People walk forwards. In real rooms a body seen from behind explains the depth nearly as well as one that faces the
camera, and a regressor trained on clean bodies takes both for the latter.
"""

from __future__ import annotations

import numpy as np

from toolkit import skeleton
from toolkit.database import canonical
from toolkit.kernels import linear
from toolkit.track import TRACKED

WINDOW = 0.75
"""Seconds before and after a moment, over which the way is measured: a person who bends, sits down or rises does not
get far in twice as long."""
LONGEST = 1.2
"""Seconds to the nearest frame on either side, at most."""
STANDS, WALKS = 0.4, 0.8
"""Metres a second: slower than the first counts nothing, faster than the second in full."""
BACKWARDS = 0.006
"""Metres that a frame costs in which the person walks backwards, and gains where they walk forwards."""
PLACED = [skeleton.REPORTED.index(name) for name in ("neck", "pelvis")]
"""Joints whose mean is the place of a person."""


def directions_walked(rows: np.ndarray, timestamps: np.ndarray, level_rotation: np.ndarray) -> np.ndarray:
    """Directions in which a person walks, by their track.

    Parameters
    ----------
    rows : (T,) of the track, with its columns `joints`, metres, camera frame, and `state`
    timestamps : float64 (T,), seconds
    level_rotation : R_level_camera, float64 (3, 3)

    Returns
    -------
    float64 (T, 2): x and z in the level frame, as long as it is sure that they walk, 0 to 1
    """
    known = np.flatnonzero(rows["state"] == TRACKED)
    walked = np.zeros((len(timestamps), 2))
    places = linear.rotated(rows["joints"][known][:, PLACED].mean(axis=1), level_rotation.T)[:, [0, 2]]
    times = timestamps[known]
    for k, moment in enumerate(times):
        first, last = np.searchsorted(times, [moment - WINDOW, moment + WINDOW])
        first, last = min(first, max(k - 1, 0)), max(last - 1, min(k + 1, len(times) - 1))
        if max(moment - times[first], times[last] - moment) > LONGEST or first == last:
            continue
        velocity = (places[last] - places[first]) / (times[last] - times[first])
        speed = float(np.hypot(*velocity))
        walked[known[k]] = velocity / max(speed, 1e-9) * np.clip((speed - STANDS) / (WALKS - STANDS), 0.0, 1.0)
    return walked


def forwards(walked: np.ndarray, pose: np.ndarray) -> float:
    """How far a person of pose (P,), level frame, walks forwards, -1 to 1; `walked` (2,) is a direction as above."""
    if not walked.any():
        return 0.0
    yaw = float(canonical.body_facing(pose))
    return float(walked[0] * np.sin(yaw) + walked[1] * np.cos(yaw))
