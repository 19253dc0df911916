"""Joint trees of exported files: that of the body, or of a common rig."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.errors import RigError
from toolkit.io.files import shipped
from toolkit.io.yaml_reader import read_yaml

OWN = "toolkit"
"""Name of the body's own rig."""
SITE_NAMES = tuple(name for name, _ in skeleton.SITES)


@dataclass(frozen=True, eq=False)
class JointTree:
    """Joints in file order, parents first; all are aligned with the body frame at rest.

    Attributes
    ----------
    names : the N joints
    parents : int64 (N,), -1 for the root
    turns : int64 (N,), body joint with the rotation of each joint, -1 for a joint without own rotation
    rest : float64 (N, 3), rest positions in the body frame, metres
    tips : joint number -> rest position (3,) of the tip of its bone, for joints without children
    """

    names: tuple[str, ...]
    parents: np.ndarray
    turns: np.ndarray
    rest: np.ndarray
    tips: dict[int, np.ndarray]

    @property
    def offsets(self) -> np.ndarray:
        """Return the offset of each joint from its parent at rest, the root's from the body's root: float64 (N, 3)."""
        return np.where(self.parents[:, None] < 0, self.rest, self.rest - self.rest[self.parents])

    def vectors(self, poses: np.ndarray) -> np.ndarray:
        """Return the joints' rotation vectors relative to their parents for poses (T, P): float64 (T, N, 3)."""
        own = np.zeros((len(poses), len(skeleton.JOINTS), 3))
        own[:, skeleton.DOF_JOINT, skeleton.DOF_AXIS] = poses[:, 3:]
        return np.where((self.turns >= 0)[:, None], own[:, self.turns], 0.0)


def tree_of(body: Body, rig: str = OWN) -> JointTree:
    """Return the joints of a body under the names of a rig.

    Parameters
    ----------
    body : gives the bone lengths
    rig : one of `export_rigs()`

    Raises
    ------
    RigError
        The rig is unknown.
    """
    return _own_tree(body) if rig == OWN else _rig_tree(body, rig)


def export_rigs() -> tuple[str, ...]:
    """Return the names of the rigs for export."""
    return (OWN, *sorted(_shipped_rigs()))


def _shipped_rigs() -> dict[str, Path]:
    files = {path.stem.removesuffix("_bvh"): path for path in shipped("rigs").glob("*.yaml")}
    return {name: path for name, path in files.items() if "\nexport:" in path.read_text(encoding="utf-8")}


def _own_tree(body: Body) -> JointTree:
    order: list[int] = []

    def visit(joint: int) -> None:
        order.append(joint)
        for child in np.flatnonzero(skeleton.PARENTS == joint):
            visit(int(child))

    visit(0)
    place = {joint: i for i, joint in enumerate(order)}
    return JointTree(
        names=tuple(skeleton.JOINT_NAMES[j] for j in order),
        parents=np.array([place.get(int(skeleton.PARENTS[j]), -1) for j in order]),
        turns=np.array(order),
        rest=body.joints[order],
        tips={place[int(joint)]: site for joint, site in zip(skeleton.SITE_PARENTS, body.sites, strict=True)},
    )


def _rig_tree(body: Body, rig: str) -> JointTree:
    known = _shipped_rigs()
    if rig not in known:
        raise RigError(f"there is no rig {rig!r} to export; there are {', '.join(export_rigs())}")
    bones: dict[str, tuple[str | None, Any]] = read_yaml(known[rig], f"the rig {rig}", RigError, "")["export"]
    names = tuple(bones)
    places = [place for _, place in bones.values()]
    turns = np.array([skeleton.JOINT_NAMES.index(p) if p in skeleton.JOINT_NAMES else -1 for p in places])
    parents = np.array([names.index(parent) if parent else -1 for parent, _ in bones.values()])
    points = dict(zip((*skeleton.JOINT_NAMES, *SITE_NAMES), (*body.joints, *body.sites), strict=True))
    parts = [[place] if isinstance(place, str) else place for place in places]
    rest = np.array([np.mean([points[part] for part in named], axis=0) for named in parts])
    return JointTree(names, parents, turns, rest, _tips(body, parents, turns))


def _tips(body: Body, parents: np.ndarray, turns: np.ndarray) -> dict[int, np.ndarray]:
    """Return finger tips, toe tips and crown for the joints without children, by body joint."""
    carried = turns.copy()
    for i in range(len(parents)):
        if carried[i] < 0:
            carried[i] = carried[parents[i]]
    ends = dict(zip(skeleton.END_EFFECTORS, body.vertices[body.end_effectors], strict=True))
    tips = {int(joint): ends[name] for joint, name in zip(skeleton.SITE_PARENTS, SITE_NAMES, strict=True)}
    leaves = sorted(set(range(len(parents))) - set(parents.tolist()))
    return {i: tips[int(carried[i])] for i in leaves if int(carried[i]) in tips}
