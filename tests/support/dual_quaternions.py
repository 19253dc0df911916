"""Skinning by dual quaternions, which keeps the volume of a twist (Kavan 2008; Qammaz, 3.1)."""

import numpy as np

from toolkit.body.body import Body
from toolkit.body.rotations import quaternions as quat


def dual_skinning(body: Body, pose: np.ndarray) -> np.ndarray:
    """Return the mesh (V, 3) of a pose (P,): rigid motions of joints, blended as unit dual quaternions."""
    placed = body.place(pose)
    moves = placed.origins - (placed.rotations @ body.joints[..., None])[..., 0]
    real = quat.from_matrices(placed.rotations)
    dual = 0.5 * quat.multiply(np.insert(moves, 0, 0.0, axis=1), real)
    own = real[body.skin_joints]
    along = (own * own[:, :1]).sum(axis=2)  # q and -q are one rotation; blend along the shorter arc
    weights = (body.skin_weights * np.where(along < 0.0, -1.0, 1.0))[..., None]
    r, d = (weights * own).sum(axis=1), (weights * dual[body.skin_joints]).sum(axis=1)
    length = np.linalg.norm(r, axis=1, keepdims=True)
    r, d = r / length, d / length
    return quat.rotate(r, body.vertices) + 2.0 * quat.multiply(d, quat.conjugate(r))[:, 1:]
