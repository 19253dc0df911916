"""Agreement with another system's skeleton, which is a reference and no truth.

Two skeletons place their joints differently inside the same body, by an offset that hardly changes. So agreement is
given plain, and with one constant offset per joint, expressed in the frame of the torso and fitted on recordings of
*other* subjects.
"""

from __future__ import annotations

import re

import numpy as np

from toolkit.body import skeleton
from toolkit.errors import UsageError
from toolkit.evaluation.joints import HANDS_AND_FEET, NEAR

UTD_SUBJECT = r"_s(\d+)_"
"""Where a UTD-MHAD file name holds its subject: `a27_s1_t1_depth`."""

COMPARED = np.setdiff1d(np.arange(len(skeleton.REPORTED)), HANDS_AND_FEET)
"""Joints that agreement counts: all but hands and feet, which the Kinect SDK itself loses."""

_NECK, _PELVIS = skeleton.REPORTED.index("neck"), skeleton.REPORTED.index("pelvis")
_LEFT_HIP, _RIGHT_HIP = skeleton.REPORTED.index("left_hip"), skeleton.REPORTED.index("right_hip")


def subject_of(name: str, pattern: str = UTD_SUBJECT) -> str | None:
    """The subject named in a recording's stem by the first group of a regular expression, None if it does not match.

    Raises
    ------
    UsageError
        `pattern` is no regular expression with a group.
    """
    try:
        compiled = re.compile(pattern)
    except re.error as error:
        raise UsageError(f"subject pattern {pattern!r} is no regular expression: {error}") from error
    if compiled.groups < 1:
        raise UsageError(f"subject pattern {pattern!r} has no group; put parentheses around the subject")
    match = compiled.search(name)
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


def fit_offsets(tracks: list[np.ndarray], references: list[np.ndarray]) -> np.ndarray:
    """Median offset of each joint from the tracked to the reference one, torso's frame: float64 (20, 3), metres."""
    local = [
        np.einsum("tca,tjc->tja", torso_frames(track), reference - track)
        for track, reference in zip(tracks, references, strict=True)
    ]
    return np.nan_to_num(np.nanmedian(np.concatenate(local), axis=0))


def apply_offsets(joints: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Joints (T, 20, 3) moved by offsets (20, 3) that are given in the torso's frame."""
    return np.asarray(joints, dtype=np.float64) + np.einsum("tac,jc->tja", torso_frames(joints), offsets)


def agreement(joints: np.ndarray, reference: np.ndarray) -> float:
    """Share of joints, hands and feet left out, that lie within 100 mm of the reference; NaN if none is known."""
    distances = np.linalg.norm(np.asarray(joints, np.float64)[:, COMPARED] - reference[:, COMPARED], axis=-1)
    known = np.isfinite(distances)
    return float((distances[known] <= NEAR).mean()) if known.any() else float("nan")


def agreement_with_offsets(
    tracks: list[np.ndarray], references: list[np.ndarray], subjects: list[str | None]
) -> list[float]:
    """Agreement of each track after the offsets fitted on the tracks of all other subjects; NaN where there is none."""
    scores = []
    for track, reference, subject in zip(tracks, references, subjects, strict=True):
        others = [i for i, other in enumerate(subjects) if subject is not None and other not in (None, subject)]
        if not others:
            scores.append(float("nan"))
            continue
        offsets = fit_offsets([tracks[i] for i in others], [references[i] for i in others])
        scores.append(agreement(apply_offsets(track, offsets), reference))
    return scores
