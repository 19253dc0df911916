"""What is known of the frames of a recording besides their depth, as the tracker asks for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from toolkit.body.body import BONE_AXIS
from toolkit.body.rotations import quaternions as quat
from toolkit.fitting.orientation import FrameEvidence, OrientationSettings, OrientationTerm
from toolkit.fitting.priors import PoseTerm
from toolkit.inertial.calibration import Calibration, TakeClock
from toolkit.inertial.sensor_limbs import PARTS, joint_of
from toolkit.inertial.stream import Sensors, SensorStream
from toolkit.io.errors import InertialError

TWISTLESS = ("elbow", "wrist")
"""Joints whose tracked frame does not turn about the bone with the limb: only the bone's direction counts."""


class Guide(Protocol):
    """What is known about every frame."""

    def evidence(self, timestamp: float, level_rotation: np.ndarray) -> Sequence[FrameEvidence]:
        """What is known at `timestamp` seconds of the placed body; `level_rotation` is R_level_camera, (3, 3)."""
        ...

    def priors(self, timestamp: float) -> Sequence[PoseTerm]:
        """What is known at `timestamp` seconds of the pose."""
        ...


class NoGuide:
    """Nothing is known but the depth. Guides that know some things only extend it."""

    def evidence(self, timestamp: float, level_rotation: np.ndarray) -> Sequence[FrameEvidence]:
        """See `Guide.evidence`."""
        return ()

    def priors(self, timestamp: float) -> Sequence[PoseTerm]:
        """See `Guide.priors`."""
        return ()


class InertialGuide(NoGuide):
    """Orientations of calibrated sensors (thesis 7; as evidence for the tracker it is beyond the thesis).

    Parameters
    ----------
    sensors : named after the parts of the body, each with an orientation
    calibration : of these sensors
    recording : name of the recording, which says whose clock counts where the calibration knows several
    settings : how they pull

    Raises
    ------
    InertialError
        The calibration is of other sensors, none of them is usable, or no clock is that of the recording.
    """

    def __init__(
        self,
        sensors: Sensors,
        calibration: Calibration,
        recording: str,
        settings: OrientationSettings | None = None,
    ) -> None:
        calibration.check_placement(sensors)
        self._clock = clock_of(calibration, recording)
        settings = settings or OrientationSettings()
        chosen = [s for s in sensors if s.name in calibration.usable and s.name in self._clock.worlds]
        if not chosen:
            raise InertialError(f"no sensor of {', '.join(sensors.names)} is calibrated; calibrate them on more motion")
        self._parts: list[tuple[SensorStream, np.ndarray, np.ndarray]] = [
            (stream, quat.conjugate(np.array(self._clock.worlds[stream.name])),
             quat.conjugate(calibration.mounting(stream.name)))
            for stream in chosen
        ]  # fmt: skip
        self._settings = settings

    def evidence(self, timestamp: float, level_rotation: np.ndarray) -> Sequence[FrameEvidence]:
        """See `Guide.evidence`: a sensor that lost its packets around that time says nothing."""
        time = np.array([self._clock.rate * timestamp + self._clock.offset])
        turn = quat.conjugate(quat.from_matrices(level_rotation))
        found = []
        for stream, world, mounting in self._parts:
            measured, known = stream.at(time)
            if known[0]:
                limb = quat.multiply(quat.multiply(quat.multiply(turn, world), measured[0]), mounting)
                found.append(self._term(stream.name, quat.matrices(limb)))
        return found

    def _term(self, limb: str, rotation: np.ndarray) -> OrientationTerm:
        s = self._settings
        kind = PARTS[limb][0].removeprefix("left_").removeprefix("right_")
        axis = BONE_AXIS[kind] if kind in TWISTLESS else -1
        return OrientationTerm(joint_of(limb), rotation, axis, s.weight, s.sigma, s.disagreement / len(self._parts))


def clock_of(calibration: Calibration, recording: str) -> TakeClock:
    """The clock of a recording in a calibration that may know several.

    Raises
    ------
    InertialError
        It knows several, and none by that name.
    """
    takes = calibration.takes
    if len(takes) == 1:
        return next(iter(takes.values()))
    if recording in takes:
        return takes[recording]
    raise InertialError(
        f"the calibration knows the clocks of {', '.join(takes)}, not that of {recording}; calibrate on a run of this "
        "recording, in a folder of its name"
    )
