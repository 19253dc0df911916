"""Poses by the names of their entries."""

from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.kernels.fit import placing
from toolkit.sensing.camera import Camera


def entry(name: str) -> int:
    """Return the index of an entry of a pose."""
    return skeleton.POSE_NAMES.index(name)


def pose_at(place: tuple[float, float, float] = (0.0, 0.0, 0.0), **entries: float) -> np.ndarray:
    """Return a pose (P,) at a place, metres, with some entries changed."""
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[skeleton.ROOT_POSITION] = place
    for name, value in entries.items():
        pose[entry(name)] += value
    return pose


def upper_body_depth(
    body: Body, pose: np.ndarray, camera: Camera, level_rotation: np.ndarray, left_out: Sequence[str] = skeleton.LEGS
) -> np.ndarray:
    """Return the depth image, float32 (H, W), metres, of a body in a pose (P,), by default without legs."""
    missing = [skeleton.JOINT_NAMES.index(name) for name in left_out]
    faces = body.faces[~np.isin(body.part, missing)[body.faces].any(axis=1)].astype(np.int64)
    vertices, intrinsics = body.vertex_positions(pose) @ level_rotation, np.array(camera.intrinsics, dtype=np.float64)
    part, _, own = placing.draw(vertices, faces, intrinsics, *camera.shape)
    left, top = np.rint(intrinsics[2:] - own[2:]).astype(int)
    depth = np.zeros(camera.shape, dtype=np.float32)
    depth[top : top + part.shape[0], left : left + part.shape[1]] = part
    return depth
