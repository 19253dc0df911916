"""Joint maps from foreign skeletons to the project's body (`configs/rigs/`)."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

from toolkit.io.errors import RigError
from toolkit.io.files import shipped
from toolkit.io.yaml_reader import read_yaml
from toolkit.mocap.clip import Clip

SIDED = ("clavicle", "shoulder", "elbow", "wrist", "hand", "hip", "knee", "ankle", "foot")
KEYS: tuple[str, ...] = (
    "root", "lumbar", "thorax", "cervical", "head",
    *(f"{side}_{part}" for side in ("left", "right") for part in SIDED),
)  # fmt: skip
"""Keys of a joint map: joints of the body, and head, hands and feet for the tips of their bones."""

OPTIONAL = frozenset(
    {"lumbar", "cervical", *(f"{side}_{part}" for side in ("left", "right") for part in ("clavicle", "hand", "foot"))}
)
"""Keys that a skeleton may lack: the joint stays at rest, or the tip is the end site of its bone."""


@dataclass(frozen=True)
class Rig:
    """Joint map of one skeleton: `joints` maps each available key of `KEYS` to the clip's joint name."""

    name: str
    joints: dict[str, str]


def load_rig(clip: Clip) -> Rig:
    """Return the joint map in `configs/rigs` that fits most joint names of a clip.

    Raises
    ------
    RigError
        No map fits; the message names the nearest one and the missing joints.
    """
    fits = [(name, _fit(names, clip.joint_names)) for name, names in _shipped_maps().items()]
    name, joints = max(fits, key=lambda fit: (not _missing(fit[1]), len(fit[1])))
    if missing := _missing(joints):
        wanted = _shipped_maps()[name]
        lacking = ", ".join(
            f"{key} ({' or '.join(wanted[key]) if key in wanted else 'not in the map'})" for key in missing
        )
        raise RigError(
            f"no joint map fits the skeleton of {clip.name!r}; the nearest, {name}, lacks {lacking}; "
            "rename its joints, or add a map to configs/rigs"
        )
    return Rig(name, joints)


def _missing(joints: dict[str, str]) -> list[str]:
    return [key for key in KEYS if key not in joints and key not in OPTIONAL]


@cache
def _shipped_maps() -> dict[str, dict[str, list[str]]]:
    """Return the maps: for each key the joint names in a motion, of which the first existing one is used."""
    hint = "write `joints:` with a name or a list of names per joint"
    maps = {}
    for path in sorted(shipped("rigs").glob("*.yaml")):
        joints = read_yaml(path, f"the joint map {path.name}", RigError, hint)["joints"]
        maps[path.stem] = {key: [names] if isinstance(names, str) else names for key, names in joints.items()}
    return maps


def _plain(name: str) -> str:
    """Return a joint name without namespace, case and separators; Mixamo's namespace may lack its colon."""
    return re.sub(r"^mixamorig\d*|^bip\d+(?=.)|[\s_-]", "", name.rsplit(":", 1)[-1].lower())


def _fit(maps: dict[str, list[str]], names: Iterable[str]) -> dict[str, str]:
    present = {_plain(name): name for name in reversed(tuple(names))}
    fitted = {}
    for key, alternatives in maps.items():
        found = next((present[_plain(a)] for a in alternatives if _plain(a) in present), None)
        if found is not None:
            fitted[key] = found
    return fitted
