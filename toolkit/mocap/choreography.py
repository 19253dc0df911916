"""Procedural motions: cycles of key poses in named controls, from `choreography.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolkit.io.errors import MocapError
from toolkit.io.yaml_reader import read_yaml

FILE = Path(__file__).with_suffix(".yaml")


@dataclass(frozen=True)
class PoseCycle:
    """Cycle of key poses.

    Attributes
    ----------
    keys : fraction of the cycle in [0, 1), ascending -> the controls that differ from `hold`
    seconds : length of one cycle
    cycles : number of repetitions
    hold : controls that differ from the base pose during the whole motion
    sided : may also be performed by the other side
    settled : begins and ends in the pose of `hold`, instead of standing at ease
    on_floor : the lowest vertex of the body is on the floor, instead of the feet
    """

    keys: dict[float, dict[str, float]]
    seconds: float = 2.0
    cycles: int = 2
    hold: dict[str, float] = field(default_factory=dict)
    sided: bool = False
    settled: bool = False
    on_floor: bool = False


def controls_of(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return controls by their full names; those within `left`, `right` and `both` belong to limbs of these sides.

    >>> controls_of({"bend": 4, "both": {"knee": 90}, "left": {"knee": 60}})
    {'bend': 4, 'left_knee': 60, 'right_knee': 90}
    """
    found: dict[str, Any] = {}
    for name, value in entry.items():
        sides = {"left": ("left",), "right": ("right",), "both": ("left", "right")}.get(name)
        if sides is None:
            found[name] = value
            continue
        for side in sides:
            found |= {f"{side}_{control}": angle for control, angle in value.items()}
    return found


def _motion(entry: Mapping[str, Any]) -> PoseCycle:
    poses = {
        "keys": {share: controls_of(key) for share, key in entry["keys"].items()},
        "hold": controls_of(entry.get("hold", {})),
    }
    return PoseCycle(**{**entry, **poses})


_LISTED: dict[str, Any] = read_yaml(FILE, str(FILE), MocapError, "install the package again")
BASE: dict[str, float] = controls_of(_LISTED.pop("base"))
"""Controls of standing at ease."""
RANGES: dict[str, list[float]] = controls_of(_LISTED.pop("ranges"))
"""Ranges of random poses; the other controls keep their base values (knees follow the hips)."""
KINDS: dict[str, tuple[str, ...]] = {kind: tuple(motions) for kind, motions in _LISTED.items()}
"""Names of the motions for a pose database (`database`, `seated`) and for test subjects (the others)."""
MOTIONS: dict[str, PoseCycle] = {
    name: _motion(entry) for motions in _LISTED.values() for name, entry in motions.items()
}
"""Motions with key poses, by name."""
