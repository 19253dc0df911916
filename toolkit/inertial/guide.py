"""Guide of the tracker by calibrated sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.body.body import BONE_AXIS
from toolkit.fitting.guide import Guide
from toolkit.fitting.orientation import DISAGREEMENT, FrameEvidence, OrientationTerm
from toolkit.inertial.calibration import Calibration, TakeClock
from toolkit.inertial.sensor_limbs import PARTS, joint_of
from toolkit.inertial.stream import Sensors
from toolkit.io.errors import InertialError

TWISTLESS = ("elbow", "wrist")
"""Joints whose tracked frame does not turn about the bone with the limb: only the bone's direction counts."""


class InertialGuide(Guide):
    """Guide by orientations of calibrated sensors (thesis, Chapter 7; as evidence for the tracker beyond the thesis).

    Parameters
    ----------
    sensors : named after the parts of the body, each with an orientation
    calibration : calibration of these sensors
    recording : name of the recording, which selects one of several clocks

    Raises
    ------
    InertialError
        The calibration has other sensors, none is usable, or no clock belongs to the recording.
    """

    def __init__(self, sensors: Sensors, calibration: Calibration, recording: str) -> None:
        calibration.check_placement(sensors)
        self._clock = clock_of(calibration, recording)
        chosen = [s for s in sensors if s.name in calibration.usable and s.name in self._clock.worlds]
        if not chosen:
            raise InertialError(f"no sensor of {', '.join(sensors.names)} is calibrated; calibrate them on more motion")
        self._parts = [
            (stream, self._clock.world(stream.name).inv(), calibration.mounting(stream.name).inv()) for stream in chosen
        ]

    def evidence(self, timestamp: float, level_rotation: np.ndarray) -> Sequence[FrameEvidence]:
        """Return the orientation terms, see `Guide.evidence`; none for a sensor without packets around that time."""
        time = np.array([timestamp + self._clock.offset])
        turn = Rotation.from_matrix(level_rotation).inv()
        found = []
        for stream, world, mounting in self._parts:
            measured, known = stream.at(time)
            if known[0]:
                limb = turn * world * measured[0] * mounting
                found.append(self._term(stream.name, limb.as_matrix()))
        return found

    def _term(self, limb: str, rotation: np.ndarray) -> OrientationTerm:
        kind = PARTS[limb][0].removeprefix("left_").removeprefix("right_")
        axis = BONE_AXIS[kind] if kind in TWISTLESS else -1
        return OrientationTerm(joint_of(limb), rotation, axis, DISAGREEMENT / len(self._parts))


def clock_of(calibration: Calibration, recording: str) -> TakeClock:
    """Return the clock of a recording in a calibration with one or several clocks.

    Raises
    ------
    InertialError
        There are several clocks and none has that name.
    """
    takes = calibration.takes
    if len(takes) == 1:
        return next(iter(takes.values()))
    if recording in takes:
        return takes[recording]
    raise InertialError(
        f"the calibration has the clocks of {', '.join(takes)}, not that of {recording}; calibrate on a run of this "
        "recording, in a folder of its name"
    )
