"""AMASS motions (`.npz`): poses of the SMPL family as rotation vectors, without the licensed body.

A file holds `poses` (T, 66 or more: pelvis and 21 body joints first, then hands and face), `trans` (T, 3) and the frame
rate. Every SMPL body rests in a T-pose with the axes of the project's body, so its rotations apply to the neutral
proportions; the shape (`betas`) is ignored. AMASS has z up, a clip has y up.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.body.rotations.matrices import matrices
from toolkit.body.shape import load_body
from toolkit.io.archives import Column, archive_names, check_columns, load_archive
from toolkit.io.errors import MocapError
from toolkit.io.files import is_file
from toolkit.mocap.clip import Clip

JOINTS: tuple[tuple[str, str], ...] = (
    ("pelvis", ""), ("left_hip", "pelvis"), ("right_hip", "pelvis"), ("spine1", "pelvis"), ("left_knee", "left_hip"),
    ("right_knee", "right_hip"), ("spine2", "spine1"), ("left_ankle", "left_knee"), ("right_ankle", "right_knee"),
    ("spine3", "spine2"), ("left_foot", "left_ankle"), ("right_foot", "right_ankle"), ("neck", "spine3"),
    ("left_collar", "spine3"), ("right_collar", "spine3"), ("head", "neck"), ("left_shoulder", "left_collar"),
    ("right_shoulder", "right_collar"), ("left_elbow", "left_shoulder"), ("right_elbow", "right_shoulder"),
    ("left_wrist", "left_elbow"), ("right_wrist", "right_elbow"),
)  # fmt: skip
"""Joints of an SMPL body and their parents, in the order of `poses`."""
PELVIS_HEIGHT = 0.09
"""Height of SMPL's pelvis above its hips, metres."""
Y_UP: np.ndarray = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation from a world with z up to a world with y up."""
RATES = ("mocap_framerate", "mocap_frame_rate")
COLUMNS = {
    "poses": Column("f", ("frames", "numbers"), -1e4, 1e4),
    "root_orient": Column("f", ("frames", 3), -1e4, 1e4),
    "pose_body": Column("f", ("frames", 63), -1e4, 1e4),
    "trans": Column("f", ("frames", 3), -1e4, 1e4),
    **{name: Column("iuf", (), 1.0, 1000.0) for name in RATES},
}


def is_amass(path: Path) -> bool:
    """Return True if `path` is an NPZ file with the arrays of an AMASS motion."""
    if not (path.suffix.lower() == ".npz" and is_file(path)):
        return False
    try:
        names = set(archive_names(path, MocapError, ""))
    except MocapError:
        return False
    return "trans" in names and ("poses" in names or {"root_orient", "pose_body"} <= names)


def read_amass(path: str | Path) -> Clip:
    """Read one motion with the bone lengths of the neutral body.

    Raises
    ------
    MocapError
        The file is missing or damaged, or an array is missing, has another shape, or is not finite.
    """
    file, hint = Path(path), "download it again"
    stored = load_archive(file, MocapError, hint, only=COLUMNS)
    check_columns(stored, COLUMNS, MocapError, file.name, hint)
    rate = next((float(stored[name]) for name in RATES if name in stored), None)
    if "poses" not in stored and {"root_orient", "pose_body"} <= stored.keys():
        stored["poses"] = np.concatenate([stored["root_orient"], stored["pose_body"]], axis=1)
    if rate is None or not {"poses", "trans"} <= stored.keys():
        raise MocapError(f"{file.name} lacks poses, trans or {RATES[0]}; give a motion of AMASS, not a shape")
    vectors = stored["poses"].astype(np.float64)
    if vectors.shape[1] < 3 * len(JOINTS) or len(vectors) == 0:
        raise MocapError(f"{file.name} has poses of shape {vectors.shape}; expected {3 * len(JOINTS)} numbers or more")
    local = matrices(vectors[:, : 3 * len(JOINTS)].reshape(-1, 3)).reshape(len(vectors), len(JOINTS), 3, 3)
    local[:, 0] = Y_UP @ local[:, 0]
    rest = _rest()
    names = tuple(name for name, _ in JOINTS)
    parents = np.array([names.index(parent) if parent else -1 for _, parent in JOINTS], dtype=np.int64)
    offsets = np.stack([rest[name] - rest[parent] if parent else np.zeros(3) for name, parent in JOINTS])
    return Clip(
        name=file.stem,
        joint_names=names,
        parents=parents,
        offsets=offsets,
        rotations=local,
        root_positions=stored["trans"].astype(np.float64) @ Y_UP.T,
        frame_rate=rate,
        end_sites={
            "head": 2.0 * (rest["skull"] - rest["head"]),  # a clip's head bone ends at the crown; the skull is half-way
            "left_wrist": rest["left_hand"] - rest["left_wrist"],
            "right_wrist": rest["right_hand"] - rest["right_wrist"],
        },
    )


@cache
def _rest() -> dict[str, np.ndarray]:
    """Return the rest position of every SMPL joint, and of hands and skull, in our neutral body, metres."""
    body = load_body("neutral")
    ours = dict(zip(skeleton.JOINT_NAMES, body.joints, strict=True))
    ours |= {name: site for (name, _), site in zip(skeleton.SITES, body.sites, strict=True)}
    rest = {name: ours[name] for name, _ in JOINTS if name in ours and name != "head"}
    rest |= {"spine1": ours["lumbar"], "spine3": ours["thorax"], "neck": ours["cervical"]}
    rest |= {"spine2": 0.5 * (ours["lumbar"] + ours["thorax"]), "pelvis": np.array([0.0, PELVIS_HEIGHT, 0.0])}
    rest |= {f"{side}_collar": ours[f"{side}_clavicle"] for side in ("left", "right")}
    rest |= {name: ours[name] for name in ("left_hand", "right_hand")}
    rest["skull"] = ours["head"]
    # Position of SMPL's head joint between the base of the neck (0) and the centre of the skull (1).
    smpl_head_fraction = 0.35
    rest["head"] = ours["cervical"] + smpl_head_fraction * (ours["head"] - ours["cervical"])
    return rest
