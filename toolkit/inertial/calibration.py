"""Result of a calibration, and its file `calibration.json`."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.inertial.stream import Sensors
from toolkit.io.errors import InertialError
from toolkit.io.files import save_json
from toolkit.io.typed_values import TypedReader
from toolkit.io.yaml_reader import read_json

GOOD, WEAK, REFUSED = "good", "weak", "refused"


@dataclass(frozen=True)
class Mounting:
    """Orientation of one sensor on its part of the body.

    Attributes
    ----------
    mounting : `q_L`: sensor to the part's frame, w x y z
    status : `good`, `weak` (poorly determined by the motion) or `refused` (not determined)
    reason : reason of a status other than good
    spread : degrees, motion of the vertical in the limb's frame, which determines the heading
    median, p90 : degrees, of the residuals over the frames
    inliers : fraction of the frames with a weight above one half
    device : id of the sensor, if known
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
    """Clock and worlds of one sequence.

    Attributes
    ----------
    offset : `t_sensor = t_camera + offset`, seconds
    worlds : part of the body -> `q_G`: level frame to inertial world, w x y z
    """

    offset: float
    worlds: dict[str, tuple[float, float, float, float]]

    def world(self, limb: str) -> Rotation:
        """Return `q_G` of a sensor."""
        return Rotation.from_quat(self.worlds[limb], scalar_first=True)


@dataclass(frozen=True)
class Calibration:
    """Offsets of all sensors.

    Attributes
    ----------
    method : `robust` or `thesis`
    heading : `shared` (one magnetic world) or `own` (one heading per sensor and sequence)
    sensors : part of the body -> mounting of its sensor
    takes : name of the run -> its clock and worlds
    notes : reasons of skipped runs
    """

    method: str
    heading: str
    sensors: dict[str, Mounting]
    takes: dict[str, TakeClock]
    notes: tuple[str, ...] = field(default=())

    @property
    def usable(self) -> tuple[str, ...]:
        """Parts of the body with an accepted calibration."""
        return tuple(limb for limb, sensor in self.sensors.items() if sensor.status != REFUSED)

    def mounting(self, limb: str) -> Rotation:
        """Return `q_L` of a sensor."""
        return Rotation.from_quat(self.sensors[limb].mounting, scalar_first=True)

    def check_placement(self, sensors: Sensors) -> None:
        """Raise InertialError if the sensors are not the calibrated ones, each on its part of the body."""
        if missing := sorted(set(sensors.names) - set(self.sensors)):
            raise InertialError(
                f"the calibration is of another placement: it has {', '.join(self.sensors)}, not "
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
        """Write `calibration.json`, atomically."""
        save_json(path, asdict(self))

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read `calibration.json`.

        Raises
        ------
        InertialError
            The file is missing, damaged or another file.
        """
        hint = "write it with `depthmocap inertial calibrate`"
        reader = TypedReader(InertialError, hint, loose=True, source=str(path))
        found = reader.read(read_json(path, InertialError, hint), cls, "")
        turns = [sensor.mounting for sensor in found.sensors.values()]
        turns += [q for take in found.takes.values() for q in take.worlds.values()]
        if any(abs(np.dot(q, q) - 1.0) >= 1e-3 for q in turns):
            raise InertialError(f"{path} holds a quaternion that is not of length 1; {hint}")
        return found
