"""Poses of our body as AMASS files: for tests, and for corpora of AMASS's size."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit import skeleton
from toolkit.mocap.amass import JOINTS, PELVIS_HEIGHT, Y_UP
from toolkit.mocap.clip import PoseClip

OURS = {"pelvis": "root", "spine2": "lumbar", "spine3": "thorax", "neck": "cervical"}
"""SMPL joints whose rotation is one of ours under another name."""
SMPL_H = 52
"""Joints of a body with hands, 156 numbers a frame."""


def write_amass(path: Path, clip: PoseClip, **changes: object) -> Path:
    """Write our poses as an AMASS file of SMPL-H, z up, feet where they are.

    Parameters
    ----------
    changes : arrays by name that replace those of the file; None leaves one out
    """
    from scipy.spatial.transform import Rotation

    poses = np.zeros((len(clip), SMPL_H, 3))
    vectors = np.zeros((len(clip), len(skeleton.JOINT_NAMES), 3))
    vectors[:, skeleton.DOF_JOINT, skeleton.DOF_AXIS] = clip.poses[:, 3:]
    for j, (name, _) in enumerate(JOINTS):
        ours = OURS.get(name, name.replace("collar", "clavicle"))
        if ours in skeleton.JOINT_NAMES:
            poses[:, j] = vectors[:, skeleton.JOINT_NAMES.index(ours)]
    z_up = Rotation.from_matrix(Y_UP.T)
    root = Rotation.from_rotvec(poses[:, 0])
    poses[:, 0] = (z_up * root).as_rotvec()
    pelvis = clip.poses[:, :3] + PELVIS_HEIGHT * root.apply([0.0, 1.0, 0.0])
    arrays = {
        "poses": poses.reshape(len(clip), -1), "trans": z_up.apply(pelvis),
        "mocap_framerate": np.array(clip.frame_rate), "betas": np.zeros(16),
        "gender": np.array("neutral"), "dmpls": np.zeros((len(clip), 8)),
    }  # fmt: skip
    np.savez(path, **{name: value for name, value in {**arrays, **changes}.items() if value is not None})
    return path
