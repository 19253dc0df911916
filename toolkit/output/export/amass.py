"""Export as AMASS motion: joint rotations of SMPL-H, without the licensed body model."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.io.files import save_npz
from toolkit.mocap.amass import JOINTS, PELVIS_HEIGHT, Y_UP
from toolkit.tracks.runs import Person

OURS = {"pelvis": "root", "spine2": "lumbar", "spine3": "thorax", "neck": "cervical"}
"""SMPL joint -> our joint with the same rotation."""


def export_amass(path: str | Path, person: Person) -> None:
    """Write a track as an AMASS motion (`.npz`): `poses`, `trans`, `betas` 0, `gender` neutral, `mocap_framerate`.

    z up, metres, ground at z = 0. The joint rotations are those of the track; hands, toes and soft tissue are 0, and so
    is the shape, because the licensed body model cannot be shipped. The extra arrays `state` and `timestamps` mark
    frames without the person, in which the nearest pose is held.

    Raises
    ------
    UsageError
        The track has too few frames for a frame rate.
    OutputError
        The file cannot be written.
    """
    arrays = amass_arrays(person.held_poses, person.frame_rate())
    arrays |= {"state": person.track.state, "timestamps": person.track.timestamps}
    save_npz(path, arrays)


def amass_arrays(poses: np.ndarray, frame_rate: float) -> dict[str, np.ndarray]:
    """Return the arrays of an AMASS file with hands for poses (T, P) in a y-up frame."""
    from scipy.spatial.transform import Rotation

    vectors = np.zeros((len(poses), len(skeleton.JOINT_NAMES), 3))
    vectors[:, skeleton.DOF_JOINT, skeleton.DOF_AXIS] = poses[:, 3:]
    smpl_h = 52  # number of joints of a body with hands (156 values per frame)
    rotations = np.zeros((len(poses), smpl_h, 3))
    for j, (name, _) in enumerate(JOINTS):
        ours = OURS.get(name, name.replace("collar", "clavicle"))
        if ours in skeleton.JOINT_NAMES:
            rotations[:, j] = vectors[:, skeleton.JOINT_NAMES.index(ours)]
    z_up, root = Rotation.from_matrix(Y_UP.T), Rotation.from_rotvec(rotations[:, 0])
    rotations[:, 0] = (z_up * root).as_rotvec()
    pelvis = poses[:, skeleton.ROOT_POSITION] + PELVIS_HEIGHT * root.apply([0.0, 1.0, 0.0])
    betas, dmpls = 16, 8
    return {
        "poses": rotations.reshape(len(poses), -1),
        "trans": z_up.apply(pelvis),
        "mocap_framerate": np.array(float(frame_rate)),
        "betas": np.zeros(betas),
        "gender": np.array("neutral"),
        "dmpls": np.zeros((len(poses), dmpls)),
    }
