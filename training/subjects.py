"""Simulated people of the training images: bodies, poses, clothes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.body.body import Body, vertex_normals
from toolkit.body.shape import ShapeSpace
from toolkit.database.prior import SITUATIONS, situations, variables

STATURES = (0.72, 1.3)
"""Metres: children that the population of the shape space lacks."""
TORSO, HEAD = ("root", "lumbar", "thorax", "clavicle"), ("cervical",)
ARMS, LEGS, THIGHS = ("shoulder", "elbow"), ("hip", "knee"), ("hip",)
"""Ends of the names of the joints whose parts a layer of clothes covers."""
ERECT, STANDING = 0.52, 0.62
"""Metres from the pelvis up to the head, and from the higher ankle up to the pelvis, of an upright pose."""


def is_seated(poses: np.ndarray, body: Body) -> np.ndarray:
    """Return bool (N,): canonical poses (N, P) of people who sit."""
    return np.asarray(situations(variables(poses, body)) == SITUATIONS.index("seated"))


def row_of(sits: np.ndarray, share: float, rng: np.random.Generator) -> int:
    """Draw a row of poses that are seated (`sits`, bool (N,)) with probability `share`, if both kinds exist."""
    rows = np.flatnonzero(sits == (rng.random() < share))
    return int(rows[rng.integers(len(rows))] if len(rows) else rng.integers(len(sits)))


def draw_body(space: ShapeSpace, small: float, rng: np.random.Generator) -> Body:
    """Draw a person of the shape space, a child with probability `small`."""
    coefficients = np.clip(rng.normal(0.0, 0.9, space.size), -2.0, 2.0)
    if rng.random() < small:
        coefficients = 0.6 * coefficients + space.typical(rng.uniform(*STATURES))
    else:
        coefficients[0] = np.clip(1.3 * coefficients[0], -3.4, 2.6)
    return space.body(coefficients)


def turned_pose(pose: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """Return a canonical pose at the origin with a random yaw, and that yaw in radians."""
    yaw = rng.uniform(-np.pi, np.pi)
    out = np.array(pose, dtype=np.float64)
    out[skeleton.ROOT_POSITION] = 0.0
    root = Rotation.from_rotvec([0.0, yaw, 0.0]) * Rotation.from_rotvec(out[skeleton.ROOT_ROTATION])
    out[skeleton.ROOT_ROTATION] = root.as_rotvec()
    return out, yaw


def is_upright(poses: np.ndarray, body: Body) -> np.ndarray:
    """Return bool (N,): canonical poses (N, P) of people who stand or walk."""
    height = body.joint_positions(poses)[..., 1]
    head, pelvis, *ankles = (
        height[:, skeleton.REPORTED.index(name)] for name in ("head", "pelvis", "left_ankle", "right_ankle")
    )
    return np.asarray((head - pelvis > ERECT) & (pelvis - np.maximum(*ankles) > STANDING))


def thickened(body: Body, vertices: np.ndarray, faces: np.ndarray, layers: dict[tuple[str, ...], float]) -> np.ndarray:
    """Return the vertices (V, 3) moved along their normals by the thickness in metres of each layer."""
    names = np.array(skeleton.JOINT_NAMES)[body.part]
    thickness = np.zeros(len(names))
    for parts, metres in layers.items():
        thickness[np.any([np.char.endswith(names, part) for part in parts], axis=0)] = metres
    return np.asarray(vertices + thickness[:, None] * vertex_normals(vertices, faces))
