"""A body of joints with the least possible mesh, and small mocap files, for the mocap tests."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body

LEFT_REST = {
    "clavicle": (0.03, 0.42, 0.0),
    "shoulder": (0.18, 0.46, -0.02),
    "elbow": (0.46, 0.455, -0.035),
    "wrist": (0.71, 0.455, 0.0),
    "hip": (0.09, 0.0, 0.0),
    "knee": (0.10, -0.42, 0.02),
    "ankle": (0.11, -0.84, -0.02),
}
SPINE_REST = {
    "root": (0.0, 0.0, 0.0),
    "lumbar": (0.0, 0.1, -0.02),
    "thorax": (0.0, 0.25, -0.02),
    "cervical": (0.0, 0.5, -0.01),
}
SITES_REST = {
    "head": (0.0, 0.66, 0.02),
    "left_hand": (0.80, 0.45, 0.01),
    "right_hand": (-0.80, 0.45, 0.01),
    "left_foot": (0.13, -0.89, 0.12),
    "right_foot": (-0.13, -0.89, 0.12),
}


def stick_body() -> Body:
    """An adult whose mesh is two triangles around each end effector: enough for joints, sites and tips."""
    rest = dict(SPINE_REST)
    for name, (x, y, z) in LEFT_REST.items():
        rest[f"left_{name}"] = (x, y, z)
        rest[f"right_{name}"] = (-x, y, z)
    joints = np.array([rest[name] for name in skeleton.JOINT_NAMES])
    sites = np.array([SITES_REST[name] for name, _ in skeleton.SITES])
    tips = [SITES_REST[name] for name in skeleton.END_EFFECTORS]
    carriers = {name: skeleton.JOINT_NAMES.index(parent) for name, parent in skeleton.SITES}
    vertices = np.array([np.add(tip, step) for tip in tips for step in 0.01 * np.vstack([np.zeros(3), np.eye(3)])])
    faces = np.array(
        [[4 * i + a for a in face] for i in range(5) for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))]
    )
    skin = np.repeat([carriers[name] for name in skeleton.END_EFFECTORS], 4)[:, None]
    return Body(
        name="stick",
        vertices=vertices,
        faces=faces.astype(np.int32),
        skin_joints=skin.astype(np.int64),
        skin_weights=np.ones((len(vertices), 1)),
        joints=joints,
        sites=sites,
        end_effectors=np.arange(5, dtype=np.int64) * 4,
        shape=np.zeros(0),
    )
