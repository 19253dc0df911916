"""Placement of sensors on the body: `placement.yaml`, or sensor names that identify the part."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from toolkit.inertial.sensor_limbs import PARTS
from toolkit.inertial.stream import Sensors, SensorStream
from toolkit.io.errors import InertialError
from toolkit.io.yaml_reader import read_yaml

_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}
_PARTS = {
    "head": "head", "skull": "head", "chest": "chest", "sternum": "chest", "torso": "chest", "thorax": "chest",
    "t8": "chest", "pelvis": "pelvis", "sacrum": "pelvis", "abdomen": "pelvis",
    "upperarm": "upper_arm", "uparm": "upper_arm", "humerus": "upper_arm", "upper_arm": "upper_arm",
    "forearm": "forearm", "lowarm": "forearm", "lowerarm": "forearm", "ulna": "forearm", "radius": "forearm",
    "hand": "hand",
    "upperleg": "thigh", "upleg": "thigh", "thigh": "thigh", "femur": "thigh",
    "lowerleg": "shin", "lowleg": "shin", "shin": "shin", "shank": "shin", "tibia": "shin",
    "foot": "foot", "calcn": "foot",
}  # fmt: skip
"""Names of parts of the body in MVN, TotalCapture and OpenSim. A wrist is ambiguous: hand or forearm."""


def limb_named(name: str) -> str | None:
    """Return the part of the body of a foreign name (`R_LowArm`, `RightForeArm`, `femur_r_imu`), or None."""
    text = name.strip().lower().removesuffix("_imu")
    if text in PARTS:
        return text
    for mark, side in _SIDES.items():
        for rest in (text.removeprefix(f"{mark}_"), text.removesuffix(f"_{mark}"), text.removeprefix(side)):
            part = _PARTS.get(rest.strip("_"))
            if rest != text and part is not None and f"{side}_{part}" in PARTS:
                return f"{side}_{part}"
    part = _PARTS.get(text)
    return part if part in PARTS else None


def load_placement(path: str | Path) -> dict[str, str]:
    """Read `placement.yaml`: sensor or device id -> part of the body.

    Raises
    ------
    InertialError
        The file cannot be read, is no table of names, or has an unknown or repeated part.
    """
    hint = "write lines such as 00B421AF: left_shin"
    table = read_yaml(path, f"the placement {path}", InertialError, hint)
    if not isinstance(table, dict) or not table:
        raise InertialError(f"{path} is no table of sensors; {hint}")
    placement = {str(device): str(limb) for device, limb in table.items()}
    check_limbs(placement.values())
    return placement


def check_limbs(limbs: Iterable[str]) -> None:
    """Raise InertialError for an unknown or repeated part of the body."""
    seen: set[str] = set()
    for limb in limbs:
        if limb not in PARTS:
            raise InertialError(f"no part of the body is called {limb!r}; use one of: {', '.join(PARTS)}")
        if limb in seen:
            raise InertialError(f"two sensors are placed on {limb}; place one sensor on each part")
        seen.add(limb)


def placed(sensors: Sensors, placement: Mapping[str, str] | None = None) -> Sensors:
    """Return the sensors renamed by their parts of the body; those outside the placement are dropped.

    Without a placement the sensors' names must identify their parts.

    Raises
    ------
    InertialError
        A sensor has no part, two have the same part, or the placement names an unknown sensor.
    """
    pairs: list[tuple[SensorStream, str]] = []
    if placement is None:
        for stream in sensors:
            if (limb := limb_named(stream.name)) is None:
                raise InertialError(
                    f"sensor {stream.name!r} has no part of the body in its name; "
                    f"give --placement with a line such as {stream.name}: left_shin"
                )
            pairs.append((stream, limb))
    else:
        pairs = [(stream, placement[stream.name]) for stream in sensors if stream.name in placement]
        if missing := sorted(set(placement) - set(sensors.names)):
            raise InertialError(
                f"the placement names {', '.join(missing)}, but the sensors are {', '.join(sensors.names)}; correct it"
            )
    check_limbs(limb for _, limb in pairs)
    devices = {limb: sensors.devices.get(stream.name, stream.name) for stream, limb in pairs}
    streams = tuple(replace(stream, name=limb) for stream, limb in pairs)
    return replace(sensors, streams=streams, source={**sensors.source, "devices": devices})
