"""What a calibration found, and its file `calibration.json`."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from toolkit.inertial.stream import Sensors
from toolkit.io.errors import InertialError
from toolkit.io.files import save_json
from toolkit.io.typed_values import TypedReader
from toolkit.io.yaml_reader import read_json

GOOD, WEAK, REFUSED = "good", "weak", "refused"


@dataclass(frozen=True)
class Mounting:
    """How one sensor sits on its part of the body.

    Attributes
    ----------
    mounting : `q_L`: sensor to the part's frame, w x y z
    status : `good`, `weak` (the motion hardly determines it) or `refused` (it does not)
    reason : of a status that is not good
    spread : degrees, how far the vertical, seen from the limb, moved about; what the heading is known by
    median, p90 : degrees, of the residuals over the frames
    inliers : share of the frames with a weight above one half
    device : id of the sensor, if it is known
    """

    mounting: tuple[float, float, float, float]
    status: str
    reason: str = ""
    spread: float = 0.0
    median: float = 0.0
    p90: float = 0.0
    inliers: float = 1.0
    device: str = ""


@dataclass(frozen=True)
class TakeClock:
    """What belongs to one take only.

    Attributes
    ----------
    offset, rate : `t_sensor = rate * t_camera + offset`
    worlds : part of the body -> `q_G`: level frame to inertial world, w x y z
    """

    offset: float
    rate: float
    worlds: dict[str, tuple[float, float, float, float]]


@dataclass(frozen=True)
class Calibration:
    """The offsets of all sensors.

    Attributes
    ----------
    method : `robust` or `thesis`
    heading : `shared` (one magnetic world) or `own` (each sensor and take has its heading)
    sensors : part of the body -> how its sensor sits
    takes : name of the run -> its clock and worlds
    notes : sentences about what looks wrong
    """

    method: str
    heading: str
    sensors: dict[str, Mounting]
    takes: dict[str, TakeClock]
    notes: tuple[str, ...] = field(default=())

    @property
    def usable(self) -> tuple[str, ...]:
        """Parts of the body whose calibration was not refused."""
        return tuple(limb for limb, sensor in self.sensors.items() if sensor.status != REFUSED)

    def mounting(self, limb: str) -> np.ndarray:
        """`q_L` (4,) of a sensor."""
        return np.array(self.sensors[limb].mounting)

    def check_placement(self, sensors: Sensors) -> None:
        """Raise InertialError where the sensors are not those that were calibrated, each on its part of the body."""
        if missing := sorted(set(sensors.names) - set(self.sensors)):
            raise InertialError(
                f"the calibration is of another placement: it knows {', '.join(self.sensors)}, not "
                f"{', '.join(missing)}; calibrate these sensors"
            )
        for limb, device in sensors.devices.items():
            known = self.sensors[limb].device if limb in self.sensors else ""
            if limb in sensors.names and known and device and known != device:
                raise InertialError(
                    f"the calibration is of another placement: {limb} carried sensor {known}, now {device}; "
                    "calibrate these sensors"
                )

    def save(self, path: str | Path) -> None:
        """Write `calibration.json`, whole or not at all."""
        save_json(path, asdict(self))

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read `calibration.json`.

        Raises
        ------
        InertialError
            It is missing, damaged or something else.
        """
        hint = "write it with `depthmocap inertial calibrate`"
        reader = TypedReader(InertialError, hint, loose=True, source=str(path))
        found = reader.read(read_json(path, InertialError, hint), cls, "")
        turns = [sensor.mounting for sensor in found.sensors.values()]
        turns += [q for take in found.takes.values() for q in take.worlds.values()]
        if any(abs(np.dot(q, q) - 1.0) >= 1e-3 for q in turns):
            raise InertialError(f"{path} holds a quaternion that is not of length 1; {hint}")
        return found
