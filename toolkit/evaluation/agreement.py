"""Agreement with another system's skeleton, which is a reference and no truth.

Two skeletons place their joints differently inside the same body, by an offset that hardly changes. So agreement is
given plain, and with one constant offset per joint, expressed in the frame of the torso and fitted on recordings of
*other* subjects.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.evaluation.joint_errors import HANDS_AND_FEET, NEAR

UTD_SUBJECT = re.compile(r"_s(\d+)_")
"""Where a UTD-MHAD file name holds its subject: `a27_s1_t1_depth`."""

COMPARED = np.setdiff1d(np.arange(len(skeleton.REPORTED)), HANDS_AND_FEET)
"""Joints that agreement counts: all but hands and feet, which the Kinect SDK itself loses."""

FRAMES = 1000
"""Of a longer run, agreement with offsets counts so many frames, evenly spaced: 190 kB."""

_NECK, _PELVIS = skeleton.REPORTED.index("neck"), skeleton.REPORTED.index("pelvis")
_LEFT_HIP, _RIGHT_HIP = skeleton.REPORTED.index("left_hip"), skeleton.REPORTED.index("right_hip")


def subject_of(name: str) -> str | None:
    """The subject named in a recording's stem as UTD-MHAD does, None where none is."""
    match = UTD_SUBJECT.search(name)
    return match.group(1) if match else None


def torso_frames(joints: np.ndarray) -> np.ndarray:
    """Left, up and forward of the torso as columns: float64 (T, 3, 3) for joints (T, 20, 3) in the camera frame."""
    joints = np.asarray(joints, dtype=np.float64)
    up = joints[:, _NECK] - joints[:, _PELVIS]
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    left = joints[:, _LEFT_HIP] - joints[:, _RIGHT_HIP]
    left -= (left * up).sum(axis=1, keepdims=True) * up
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    return np.stack([left, up, np.cross(left, up)], axis=-1)


def local_differences(joints: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """From tracked joints (T, 20, 3) to the reference's, in the torso's frame, hands and feet left out.

    Returns
    -------
    float32 (F, 16, 3), metres, of at most `FRAMES` frames, evenly spaced: what is kept of one run among thousands
    """
    rows = np.unique(np.linspace(0, len(joints) - 1, min(FRAMES, len(joints))).astype(np.int64))
    tracked = np.asarray(joints, dtype=np.float64)[rows]
    apart = reference[rows] - tracked
    return np.einsum("tca,tjc->tja", torso_frames(tracked), apart)[:, COMPARED].astype(np.float32)


def agreement(joints: np.ndarray, reference: np.ndarray, compared: Sequence[int] | np.ndarray = COMPARED) -> float:
    """Return the share of the compared joints that lie within 100 mm of the reference; NaN if none is known."""
    difference = np.asarray(joints, np.float64)[:, compared] - reference[:, compared]
    return _share_near(np.linalg.norm(difference, axis=-1))


def agreement_with_offsets(differences: Sequence[np.ndarray], subjects: Sequence[str | None]) -> list[float]:
    """Agreement of each run after the offsets fitted on the runs of all other subjects; NaN where there is none.

    `differences` : of each run, see `local_differences`. An offset of a joint is the median of its differences.
    """
    offsets: dict[str, np.ndarray] = {}
    for subject in {subject for subject in subjects if subject is not None}:
        others = [d for d, other in zip(differences, subjects, strict=True) if other not in (None, subject)]
        if others:  # joint by joint, so that thousands of runs need no second copy
            medians = [np.nanmedian(np.concatenate([d[:, j] for d in others]), axis=0) for j in range(len(COMPARED))]
            offsets[subject] = np.nan_to_num(np.stack(medians))
    return [
        _share_near(np.linalg.norm(run - offsets[subject], axis=-1)) if subject in offsets else float("nan")
        for run, subject in zip(differences, subjects, strict=True)
    ]


def _share_near(distances: np.ndarray) -> float:
    """Share of the known distances, metres, that are within 100 mm; NaN if none is known."""
    known = np.isfinite(distances)
    return float((distances[known] <= NEAR).mean()) if known.any() else float("nan")
