"""Coordinates of OpenSim's generic full-body model (Rajagopal 2016)."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.motion.angles import ISB_AXES, SAGITTAL, segment_rotations, sequence_angles
from toolkit.tracks.runs import Person


def coordinates(person: Person, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Compute the coordinates of frames `rows` (N,) of a person: name -> float64 (N,), degrees or metres."""
    poses = person.track.pose[rows]
    turned, known = segment_rotations(person.body, poses), np.ones(len(rows), dtype=bool)

    def angles(parent: str, child: str, *, left: bool = False) -> np.ndarray:
        relative = turned[child] if not parent else turned[parent].transpose(0, 2, 1) @ turned[child]
        if left:
            relative = SAGITTAL @ relative @ SAGITTAL
        return np.degrees(sequence_angles(relative, "ZXY", known)[0])

    pelvis = angles("", "root")
    hips = poses[:, skeleton.ROOT_POSITION] @ ISB_AXES
    generic_stature = 1.70  # metres, of that model (Rajagopal 2016)
    # Metres, ISB axes: from the origin of the generic model's pelvis (between its spines) to the middle of its hips.
    pelvis_to_hips = np.array([-0.0563, -0.0786, 0.0])
    place = hips - turned["root"] @ pelvis_to_hips * person.body.height / generic_stature
    found = dict(zip(("pelvis_tilt", "pelvis_list", "pelvis_rotation"), pelvis.T, strict=True))
    found |= dict(zip(("pelvis_tx", "pelvis_ty", "pelvis_tz"), place.T, strict=True))
    for side in ("right", "left"):
        s, left = side[0], side == "left"
        hip, shoulder = angles("root", f"{side}_hip", left=left), angles("thorax", f"{side}_shoulder", left=left)
        ankle = angles(f"{side}_knee", f"{side}_ankle", left=left)
        found |= dict(zip((f"hip_flexion_{s}", f"hip_adduction_{s}", f"hip_rotation_{s}"), hip.T, strict=True))
        found[f"knee_angle_{s}"] = -angles(f"{side}_hip", f"{side}_knee", left=left)[:, 0]
        found |= dict(zip((f"ankle_angle_{s}", f"subtalar_angle_{s}"), ankle[:, :2].T, strict=True))
        found |= dict(zip((f"arm_flex_{s}", f"arm_add_{s}", f"arm_rot_{s}"), shoulder.T, strict=True))
        found[f"elbow_flex_{s}"] = angles(f"{side}_shoulder", f"{side}_elbow", left=left)[:, 0]
    found |= dict(
        zip(("lumbar_extension", "lumbar_bending", "lumbar_rotation"), angles("root", "thorax").T, strict=True)
    )
    return found
