"""MakeHuman's CC0 data for the asset script: base mesh, macro targets, joint cubes, weights, and the T-pose.

Lengths are in metres; the base mesh is stored in decimetres: y up, facing +z, the subject's left at +x, arms and legs
spread (A-pose).
"""

from __future__ import annotations

import gzip
import itertools
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from toolkit.body import skeleton

METRES = 0.1
SKIN_VERTICES = 13380
"""Number of skin vertices, which come first in the base mesh; the others are helpers and joint cubes."""

MACRO_ANCHORS: dict[str, dict[str, float]] = {
    "gender": {"female": 0.0, "male": 1.0},
    "age": {"baby": 0.0, "child": 0.1875, "young": 0.5, "old": 1.0},
    "muscle": {"minmuscle": 0.0, "averagemuscle": 0.5, "maxmuscle": 1.0},
    "weight": {"minweight": 0.0, "averageweight": 0.5, "maxweight": 1.0},
    "height": {"minheight": 0.0, "": 0.5, "maxheight": 1.0},
    "proportions": {"uncommonproportions": 0.0, "": 0.5, "idealproportions": 1.0},
}
"""Parameter values with a modelled body for each macro parameter, between which MakeHuman interpolates linearly."""

RACES = ("african", "asian", "caucasian")


@dataclass(frozen=True)
class Macro:
    """A person in MakeHuman's macro parameters, each in [0, 1]; age 0.1875 is a child, 0.5 is 25 years, 1 is 90."""

    gender: float = 0.5
    age: float = 0.5
    muscle: float = 0.5
    weight: float = 0.5
    height: float = 0.5
    proportions: float = 0.5

    def blend(self, parameter: str) -> dict[str, float]:
        """Return the weights of the anchors on both sides of the parameter's value."""
        anchors = list(MACRO_ANCHORS[parameter].items())
        value = getattr(self, parameter)
        for (low_name, low), (high_name, high) in itertools.pairwise(anchors):
            if value <= high:
                share = (value - low) / (high - low)
                return {low_name: 1.0 - share, high_name: share}
        return {anchors[-1][0]: 1.0}


def _fractions() -> dict[str, dict[str, float]]:
    """Return the weights of each rig bone on the 18 joints; a bone between two of ours is split,
    so that the spine bends evenly."""
    table: dict[str, dict[str, float]] = {
        "root": {"root": 1.0},
        "spine05": {"root": 1.0},
        "spine04": {"root": 0.5, "lumbar": 0.5},
        "spine03": {"lumbar": 1.0},
        "spine02": {"lumbar": 0.5, "thorax": 0.5},
        "spine01": {"thorax": 1.0},
        "neck01": {"thorax": 0.3, "cervical": 0.7},
    }
    for side, tag in (("left", ".L"), ("right", ".R")):
        table |= {
            f"pelvis{tag}": {"root": 1.0},
            f"breast{tag}": {"thorax": 1.0},
            f"clavicle{tag}": {f"{side}_clavicle": 1.0},
            f"shoulder01{tag}": {f"{side}_clavicle": 1.0},
        }
        for bone, joint in (
            ("upperarm", "shoulder"), ("lowerarm", "elbow"), ("wrist", "wrist"), ("metacarpal", "wrist"),
            ("finger", "wrist"), ("upperleg", "hip"), ("lowerleg", "knee"), ("foot", "ankle"), ("toe", "ankle"),
        ):  # fmt: skip
            table[f"{bone}*{tag}"] = {f"{side}_{joint}": 1.0}
    return table


BONE_SHARES = _fractions()


def joints_of_bone(bone: str) -> dict[str, float]:
    """Return the weights of a rig bone on the 18 joints; bones of the face and the upper neck belong to `cervical`."""
    if bone in BONE_SHARES:
        return BONE_SHARES[bone]
    for pattern, shares in BONE_SHARES.items():
        stem, star, tag = pattern.partition("*")
        if star and bone.startswith(stem) and bone.endswith(tag):
            return shares
    return {"cervical": 1.0}


JOINT_CUBES: dict[str, tuple[str, ...]] = {
    "lumbar": ("spine-3",),
    "thorax": ("spine-1", "spine-2"),
    "cervical": ("neck",),
    "clavicle": ("clavicle",),
    "shoulder": ("shoulder",),
    "elbow": ("elbow",),
    "wrist": ("hand",),
    "hip": ("upper-leg",),
    "knee": ("knee",),
    "ankle": ("ankle",),
    "hand": tuple(f"finger-{k}-1" for k in (2, 3, 4, 5)),
    "foot": tuple(f"toe-{k}-1" for k in (1, 2, 3, 4, 5)),
}
"""MakeHuman's joint cubes whose centres define each joint or site; those of a limb have the prefix `l-` or `r-`."""


class MakeHuman:
    """The data folder `mpfb2`, read on demand."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._targets: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    @cached_property
    def base(self) -> np.ndarray:
        """Return the base mesh with helpers and joint cubes, float64 (19158, 3), A-pose, metres."""
        lines = (self.folder / "3dobjs/base.obj").read_text().splitlines()
        return METRES * np.array([line.split()[1:4] for line in lines if line.startswith("v ")], dtype=np.float64)

    @cached_property
    def faces(self) -> np.ndarray:
        """Return the triangles of the skin, int32 (F, 3), each quad cut along its first diagonal."""
        quads, group = [], ""
        for line in (self.folder / "3dobjs/base.obj").read_text().splitlines():
            if line.startswith("g "):
                group = line[2:].strip()
            elif line.startswith("f ") and group == "body":
                quads.append([int(corner.split("/")[0]) - 1 for corner in line.split()[1:]])
        quad = np.array(quads, dtype=np.int32)
        return np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])

    @cached_property
    def groups(self) -> dict[str, np.ndarray]:
        """Return the vertex indices of each named group."""
        table = json.loads((self.folder / "mesh_metadata/basemesh_vertex_groups.json").read_text())
        return {name: np.concatenate([np.arange(a, b + 1) for a, b in spans]) for name, spans in table.items()}

    @cached_property
    def weights(self) -> np.ndarray:
        """Return the weights of the finest rig, float64 (13380, 18), its 163 bones merged into the 18 joints; rows sum
        to 1."""
        rig = json.loads((self.folder / "rigs/standard/weights.default.json").read_text())["weights"]
        weights = np.zeros((len(self.base), len(skeleton.JOINTS)))
        for bone, pairs in rig.items():
            for joint, share in joints_of_bone(bone).items():
                for vertex, weight in pairs:
                    weights[int(vertex), skeleton.JOINT_NAMES.index(joint)] += share * weight
        skin = weights[:SKIN_VERTICES]
        return skin / skin.sum(axis=1, keepdims=True)

    @cached_property
    def skull(self) -> np.ndarray:
        """Return the vertices of the head and face bones, whose bounding box is that of the skull."""
        rig = json.loads((self.folder / "rigs/standard/weights.default.json").read_text())["weights"]
        share = np.zeros(len(self.base))
        for bone, pairs in rig.items():
            if joints_of_bone(bone) == {"cervical": 1.0} and not bone.startswith("neck"):
                for vertex, weight in pairs:
                    share[int(vertex)] += weight
        return np.flatnonzero(share[:SKIN_VERTICES] > 0.5)

    def target(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return vertex indices and offsets (metres) of one morph target; a neutral one has no file."""
        if name not in self._targets:
            path = self.folder / "targets" / f"{name}.target.gz"
            rows = [line.split() for line in gzip.open(path, "rt") if line[0].isdigit()] if path.exists() else []
            index = np.array([int(row[0]) for row in rows], dtype=np.int64)
            offsets = np.array([[float(x) for x in row[1:4]] for row in rows]).reshape(-1, 3)
            self._targets[name] = (index, METRES * offsets)
        return self._targets[name]

    def person(self, macro: Macro, extra: dict[str, float] | None = None) -> np.ndarray:
        """Return the A-pose base mesh of a person (19158, 3), plus `extra` morph targets by name and amount."""
        mesh = self.base.copy()
        amounts: dict[str, float] = dict(extra or {})
        share = {name: macro.blend(name) for name in MACRO_ANCHORS}
        for gender, age in itertools.product(share["gender"], share["age"]):
            young = share["gender"][gender] * share["age"][age]
            for race in RACES:
                amounts[f"macrodetails/{race}-{gender}-{age}"] = young / len(RACES)
            for muscle, weight in itertools.product(share["muscle"], share["weight"]):
                amount = young * share["muscle"][muscle] * share["weight"][weight]
                stem = f"{gender}-{age}-{muscle}-{weight}"
                amounts[f"macrodetails/universal-{stem}"] = amount
                for kind in ("height", "proportions"):
                    for level, part in share[kind].items():
                        if level:
                            amounts[f"macrodetails/{kind}/{stem}-{level}"] = amount * part
        for name, amount in amounts.items():
            if amount != 0.0:
                index, offsets = self.target(name)
                mesh[index] += amount * offsets
        return mesh

    def centre(self, mesh: np.ndarray, name: str) -> np.ndarray:
        """Return the centre of a joint or of a hand or foot site in an A-pose mesh."""
        side, _, joint = name.partition("_")
        prefix, key = ({"left": "l-", "right": "r-"}[side], joint) if joint else ("", name)
        return np.mean([mesh[self.groups[f"joint-{prefix}{cube}"]].mean(axis=0) for cube in JOINT_CUBES[key]], axis=0)
