"""Canonical frame: poses and clouds without position and facing (Baak 2013, 5.3.3 and 5.3.4).

A canonical pose has its root at the origin and faces +z. A canonical cloud has its centre at the origin and faces +z.
They differ by the offset of a pose: centre and facing as a tracker estimates them on a view of it, see `origin.py`.
Facing yaw is the angle about +y from +z.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.kernels import quaternions
from toolkit.landmarks.facing import camera_yaw

TRUNK_RADIUS = 0.11
"""Metres, amplitude of the movement of a cloud's centre with the yaw, fitted on views of mocap poses at yaws of 20 to
60 degrees."""
_CHEST_CHAIN: np.ndarray = np.array(
    [[skeleton.POSE_NAMES.index(f"{joint}_r{axis}") for axis in "xyz"] for joint in ("root", "lumbar", "thorax")]
)
"""Pose entries of the rotation vectors from the root to the chest."""


def about_up(yaw: np.ndarray | float) -> np.ndarray:
    """Return rotations by `yaw` (...), radians, about +y: float64 (..., 3, 3)."""
    yaw = np.asarray(yaw, dtype=np.float64)
    out = np.zeros((*yaw.shape, 3, 3))
    out[..., 0, 0] = out[..., 2, 2] = np.cos(yaw)
    out[..., 0, 2] = np.sin(yaw)
    out[..., 2, 0] = -np.sin(yaw)
    out[..., 1, 1] = 1.0
    return out


def body_facing(poses: np.ndarray) -> np.ndarray:
    """Return the facing yaw of poses (..., P): float64 (...), radians in (-pi, pi].

    The horizontal direction perpendicular to the mean left axis of hips and chest. It follows the torso's front, and
    keeps its direction in a deep bend forwards or backwards.
    """
    poses = skeleton.check_pose(poses)
    flat = np.ascontiguousarray(poses.reshape(-1, skeleton.POSE_SIZE), dtype=np.float64)
    lateral = np.empty((len(flat), 3))
    quaternions.lateral_axes(flat, _CHEST_CHAIN, lateral)
    return np.arctan2(-lateral[:, 2], lateral[:, 0]).reshape(poses.shape[:-1])


def canonicalise(poses: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Remove position and facing from poses (..., P) of any y-up frame.

    Returns
    -------
    canonical : float64 (..., P), root at the origin, facing yaw 0
    positions : float64 (..., 3), metres, positions of the roots
    yaws : float64 (...), radians, facing yaws
    """
    poses = skeleton.check_pose(poses)
    yaws = body_facing(poses)
    positions = poses[..., skeleton.ROOT_POSITION].copy()
    canonical = _turned(poses, -yaws)
    canonical[..., skeleton.ROOT_POSITION] = 0.0
    return canonical, positions, yaws


def place(poses: np.ndarray, offsets: np.ndarray, centre: np.ndarray, yaw: np.ndarray | float) -> np.ndarray:
    """Place canonical poses at the centre and facing of a cloud, the inverse of the common origin.

    Parameters
    ----------
    poses : (..., P), canonical
    offsets : (..., 4), of each pose: centre (metres) and facing yaw (radians) in the canonical frame
    centre : (..., 3), metres, centre of the cloud in a y-up frame
    yaw : (...), radians, facing of the cloud

    Returns
    -------
    float64 (..., P) in the frame of `centre`: each pose has its centre at `centre` and faces `yaw`
    """
    offsets = np.asarray(offsets, dtype=np.float64)
    turn = np.asarray(yaw, dtype=np.float64) - offsets[..., 3]
    placed = _turned(skeleton.check_pose(poses), turn)
    placed[..., skeleton.ROOT_POSITION] += centre - np.einsum("...ab,...b->...a", about_up(turn), offsets[..., :3])
    return placed


def normalise(points: np.ndarray, centre: np.ndarray, yaw: np.ndarray | float) -> np.ndarray:
    """Return points (..., K, 3) of a y-up frame relative to `centre` (..., 3), rotated so that `yaw` (...) becomes
    +z.
    """
    shifted = np.asarray(points, dtype=np.float64) - np.asarray(centre)[..., None, :]
    return np.einsum("...ab,...kb->...ka", about_up(-np.asarray(yaw)), shifted)


def frontal_centre(centre: np.ndarray, yaw: float, size: float = 1.0) -> np.ndarray:
    """Return the centre of a cloud as seen from the front of the person: float64 (3,), metres, level frame.

    A camera sees only the near side of the torso, so the centre moves around the trunk with the person's yaw. Its
    lateral part is corrected as on an upright cylinder; the part along the facing is small.

    Parameters
    ----------
    centre : (3,), metres, level frame (origin at the camera), from `cloud_centre`
    yaw : radians, facing of the cloud
    size : stature of the person relative to an adult
    """
    turn = yaw - camera_yaw(centre)
    return centre + size * TRUNK_RADIUS * np.sin(turn) * np.array([np.cos(yaw), 0.0, -np.sin(yaw)])


def feature_vectors(end_effectors: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return the 15-dimensional features (`E^5`) of canonical poses: end effectors relative to the pose's centre.

    Parameters
    ----------
    end_effectors : (..., 5, 3), metres, canonical frame
    offsets : (..., 4), centre and facing yaw

    Returns
    -------
    float64 (..., 15), metres
    """
    features = normalise(end_effectors, offsets[..., :3], offsets[..., 3])
    return features.reshape(*features.shape[:-2], -1)


def mirrored(poses: np.ndarray) -> np.ndarray:
    """Return poses (..., P) mirrored at x = 0: left becomes right."""
    poses = skeleton.check_pose(poses)
    return poses[..., _MIRROR_SOURCE] * _MIRROR_SIGN


@lru_cache(maxsize=4)
def torso_length(body: Body) -> float:
    """Return the distance of neck and pelvis in the rest pose, metres: the scale of offsets between bodies."""
    joints = body.joint_positions(np.zeros(skeleton.POSE_SIZE))
    reported = skeleton.REPORTED.index
    return math.dist(joints[reported("neck")], joints[reported("pelvis")])


def _turned(poses: np.ndarray, yaws: np.ndarray) -> np.ndarray:
    """Rotate poses (..., P) by `yaws` (...) about +y through the origin."""
    yaws = np.broadcast_to(yaws, poses.shape[:-1])
    rotvecs = poses[..., skeleton.ROOT_ROTATION].reshape(-1, 3)
    turned = np.empty(rotvecs.shape)
    quaternions.turned_vectors(np.ascontiguousarray(yaws.ravel()), np.ascontiguousarray(rotvecs), turned)
    out = poses.copy()
    out[..., skeleton.ROOT_POSITION] = np.einsum("...ab,...b->...a", about_up(yaws), poses[..., skeleton.ROOT_POSITION])
    out[..., skeleton.ROOT_ROTATION] = turned.reshape(*poses.shape[:-1], 3)
    return out


def _mirror_table() -> tuple[np.ndarray, np.ndarray]:
    """Return the source entry of each entry of a mirrored pose, and its sign.

    A mirror at x = 0 negates x of a position, and y and z of a rotation vector.
    """
    swap = {"left": "right", "right": "left"}
    sources, signs = [], []
    for name in skeleton.POSE_NAMES:
        side, _, rest = name.partition("_")
        sources.append(skeleton.POSE_NAMES.index(f"{swap[side]}_{rest}" if side in swap else name))
        signs.append(-1.0 if name == "root_tx" or name.endswith(("_ry", "_rz")) else 1.0)
    return np.array(sources), np.array(signs)


_MIRROR_SOURCE, _MIRROR_SIGN = _mirror_table()
