"""Agreement with the skeleton of another system, which is a reference and not the truth.

Two skeletons place their joints differently inside the same body, by a nearly constant offset. Agreement is therefore
given without offsets, and with one offset per joint in the torso frame, fitted on recordings of *other* subjects.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.evaluation.joint_errors import CORRECT_WITHIN, HANDS_AND_FEET

UTD_SUBJECT = re.compile(r"_s(\d+)_")
"""Pattern of the subject in a UTD-MHAD file name: `a27_s1_t1_depth`."""

COMPARED = np.setdiff1d(np.arange(len(skeleton.REPORTED)), HANDS_AND_FEET)
"""Joints that count for agreement: all but hands and feet, which the Kinect SDK itself loses."""

_NECK, _PELVIS = skeleton.REPORTED.index("neck"), skeleton.REPORTED.index("pelvis")
_LEFT_HIP, _RIGHT_HIP = skeleton.REPORTED.index("left_hip"), skeleton.REPORTED.index("right_hip")


def subject_of(name: str) -> str | None:
    """Return the subject in a UTD-MHAD file name, or None."""
    match = UTD_SUBJECT.search(name)
    return match.group(1) if match else None


def torso_frames(joints: np.ndarray) -> np.ndarray:
    """Return the axes left, up and forward of the torso of joints (T, 20, 3) as columns: float64 (T, 3, 3)."""
    joints = np.asarray(joints, dtype=np.float64)
    up = joints[:, _NECK] - joints[:, _PELVIS]
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    left = joints[:, _LEFT_HIP] - joints[:, _RIGHT_HIP]
    left -= (left * up).sum(axis=1, keepdims=True) * up
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    return np.stack([left, up, np.cross(left, up)], axis=-1)


def local_differences(joints: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return the differences of joints (T, 20, 3) to the reference in the torso frame, without hands and feet.

    Returns
    -------
    float32 (F, 16, 3), metres, of at most 1,000 evenly spaced frames
    """
    most = 1000  # frames of a run (190 kB)
    rows = np.unique(np.linspace(0, len(joints) - 1, min(most, len(joints))).astype(np.int64))
    tracked = np.asarray(joints, dtype=np.float64)[rows]
    apart = reference[rows] - tracked
    return np.einsum("tca,tjc->tja", torso_frames(tracked), apart)[:, COMPARED].astype(np.float32)


def agreement(joints: np.ndarray, reference: np.ndarray, compared: Sequence[int] | np.ndarray = COMPARED) -> float:
    """Return the share of the compared joints that lie within 100 mm of the reference; NaN if none is known."""
    difference = np.asarray(joints, np.float64)[:, compared] - reference[:, compared]
    return _share_near(np.linalg.norm(difference, axis=-1))


def agreement_with_offsets(differences: Sequence[np.ndarray], subjects: Sequence[str | None]) -> list[float]:
    """Return the agreement of each run after offsets fitted on all other subjects; NaN without other subjects.

    `differences` holds the result of `local_differences` for each run. An offset is the median of its differences.
    """
    offsets: dict[str, np.ndarray] = {}
    for subject in {subject for subject in subjects if subject is not None}:
        others = [d for d, other in zip(differences, subjects, strict=True) if other not in (None, subject)]
        if others:  # joint by joint, to avoid a second copy of thousands of runs
            medians = [np.nanmedian(np.concatenate([d[:, j] for d in others]), axis=0) for j in range(len(COMPARED))]
            offsets[subject] = np.nan_to_num(np.stack(medians))
    return [
        _share_near(np.linalg.norm(run - offsets[subject], axis=-1)) if subject in offsets else float("nan")
        for run, subject in zip(differences, subjects, strict=True)
    ]


def _share_near(distances: np.ndarray) -> float:
    """Return the fraction of known distances, metres, within 100 mm; NaN if none is known."""
    known = np.isfinite(distances)
    return float((distances[known] <= CORRECT_WITHIN).mean()) if known.any() else float("nan")
