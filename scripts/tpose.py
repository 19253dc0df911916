"""From MakeHuman's A-pose to the T-pose of `toolkit.body`, by inverse linear blend skinning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from makehuman import SKIN_VERTICES, MakeHuman
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton


@dataclass(frozen=True)
class Rest:
    """One person in the T-pose: skin (13380, 3), joints (18, 3) and sites (5, 3), metres, mid-hips at the origin."""

    skin: np.ndarray
    joints: np.ndarray
    sites: np.ndarray


def turning(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the smallest rotation (3, 3) from direction a to direction b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    if sine < 1e-12:
        return np.eye(3)
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, a @ b)).as_matrix()


@dataclass(frozen=True)
class Straightening:
    """Rigid motions from the T-pose back to the A-pose: p_A = turns[j] (p_T - joints_t[j]) + joints_a[j]."""

    turns: np.ndarray
    joints_t: np.ndarray
    joints_a: np.ndarray

    def blended(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return blended matrices (V, 3, 3) and offsets (V, 3) of the skinning T-pose -> A-pose."""
        offsets = self.joints_a - np.einsum("jab,jb->ja", self.turns, self.joints_t)
        return np.einsum("vj,jab->vab", weights, self.turns), weights @ offsets

    def undo(self, points_a: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the T-pose points that skinning maps exactly to `points_a`, so that arms at 45 degrees look as
        modelled."""
        matrices, offsets = self.blended(weights)
        return np.linalg.solve(matrices, (points_a - offsets)[..., None])[..., 0]


def straightening(source: MakeHuman, mesh: np.ndarray) -> tuple[Straightening, dict[str, np.ndarray]]:
    """Return the motions that straighten one person, and the A-pose centres of all joints, hands and feet.

    Arms lie exactly along +-x and legs along -y, each bone turned by the smallest rotation relative to its parent;
    trunk and feet keep their orientation, so the soles stay flat.
    """
    names = [*skeleton.JOINT_NAMES[1:], "left_hand", "right_hand", "left_foot", "right_foot"]
    centres = {name: source.centre(mesh, name) for name in names}
    for left in [name for name in names if name.startswith("left")]:
        right = left.replace("left", "right")
        mean = 0.5 * (centres[left] + centres[right] * (-1, 1, 1))
        centres[left], centres[right] = mean, mean * (-1, 1, 1)
    for name in ("lumbar", "thorax", "cervical"):
        centres[name] = centres[name] * (0, 1, 1)
    centres["root"] = 0.5 * (centres["left_hip"] + centres["right_hip"])

    joints_a = np.array([centres[name] for name in skeleton.JOINT_NAMES])
    joints_t = joints_a.copy()
    turns = np.tile(np.eye(3), (len(joints_a), 1, 1))
    for side, outward in (("left", 1.0), ("right", -1.0)):
        for limb, rest in (
            (("shoulder", "elbow", "wrist", "hand"), np.array([outward, 0.0, 0.0])),
            (("hip", "knee", "ankle"), np.array([0.0, -1.0, 0.0])),
        ):
            turn = np.eye(3)
            for upper, lower in zip(limb[:-1], limb[1:], strict=True):
                bone = centres[f"{side}_{lower}"] - centres[f"{side}_{upper}"]
                turn = turning(turn @ rest, bone) @ turn
                j = skeleton.JOINT_NAMES.index(f"{side}_{upper}")
                turns[j] = turn
                if lower != "hand":
                    joints_t[skeleton.JOINT_NAMES.index(f"{side}_{lower}")] = joints_t[j] + np.linalg.norm(bone) * rest
    return Straightening(turns, joints_t, joints_a), centres


def rest_pose(source: MakeHuman, mesh: np.ndarray) -> Rest:
    """Bring one A-pose person (19158, 3) into the T-pose."""
    straight, centres = straightening(source, mesh)
    skin = straight.undo(mesh[:SKIN_VERTICES], source.weights)
    skull = skin[source.skull]
    sites = np.zeros((len(skeleton.SITES), 3))
    sites[0] = 0.5 * (skull.min(axis=0) + skull.max(axis=0)) * (0, 1, 1)
    for i, (name, parent) in enumerate(skeleton.SITES[1:], start=1):
        j = skeleton.JOINT_NAMES.index(parent)
        sites[i] = straight.turns[j].T @ (centres[name] - straight.joints_a[j]) + straight.joints_t[j]
    origin = straight.joints_t[0]
    return Rest(skin - origin, straight.joints_t - origin, sites - origin)
