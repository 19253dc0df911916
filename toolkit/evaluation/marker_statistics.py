"""Agreement of a track with a marker system: joints, angles and strides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from toolkit.body.skeleton import REPORTED

LIMITS = 1.96
"""Standard deviations on either side of the bias: 95 % limits of agreement (Bland and Altman 1986)."""

ANGLES: dict[str, tuple[str, str, str, float]] = {
    f"{side}_{name}": (f"{side}_{a}" if a != "neck" else a, f"{side}_{b}", f"{side}_{c}", offset)
    for side in ("left", "right")
    for name, (a, b, c, offset) in {
        "knee_flexion": ("hip", "knee", "ankle", 180.0),
        "hip_flexion": ("neck", "hip", "knee", 180.0),
        "ankle_dorsiflexion": ("knee", "ankle", "foot", 90.0),
        "elbow_flexion": ("shoulder", "elbow", "wrist", 180.0),
        "shoulder_elevation": ("hip", "shoulder", "elbow", 0.0),
    }.items()
}
"""Angle at the middle of three joints; an offset of 180 or 90 degrees counts from the straight or upright limb."""


@dataclass(frozen=True)
class JointAgreement:
    """Distances of one joint from the marker system's, millimetres.

    Attributes
    ----------
    joint : reported joint
    frames : number of frames in which both have it
    mean, rms, median, p95 : of the distance
    bias : mean difference (track minus markers), axes of the level frame: x right, y up, z towards the camera
    limits : half width of the 95 % limits of agreement on each axis
    on_skin : True where one marker on the skin stands for the joint centre
    """

    joint: str
    frames: int
    mean: float
    rms: float
    median: float
    p95: float
    bias: tuple[float, float, float]
    limits: tuple[float, float, float]
    on_skin: bool


@dataclass(frozen=True)
class AngleAgreement:
    """Differences of one angle (track minus reference), degrees.

    Attributes
    ----------
    angle : name
    frames : number of frames in which both have it
    bias, sd, rms : mean, standard deviation and root mean square of the difference
    lower, upper : 95 % limits of agreement
    correlation : Pearson's r, NaN where the angle does not move
    range_track, range_reference : ranges of motion, 1st to 99th percentile
    """

    angle: str
    frames: int
    bias: float
    sd: float
    rms: float
    lower: float
    upper: float
    correlation: float
    range_track: float
    range_reference: float


@dataclass(frozen=True)
class StrideAgreement:
    """Strides by both systems.

    Attributes
    ----------
    side : "left" or "right"
    count_track, count_reference : strides found
    time_track, time_reference : mean stride time, seconds
    length_track, length_reference : mean stride length, metres
    """

    side: str
    count_track: int
    count_reference: int
    time_track: float
    time_reference: float
    length_track: float
    length_reference: float


def joint_agreement(track: np.ndarray, reference: np.ndarray, on_skin: np.ndarray) -> list[JointAgreement]:
    """Compare joints (T, 20, 3), metres, level frame, NaN where unknown."""
    rows = []
    for j, name in enumerate(REPORTED):
        difference = 1000.0 * (track[:, j] - reference[:, j])
        difference = difference[np.isfinite(difference).all(axis=1)]
        if not len(difference):
            continue
        distance = np.linalg.norm(difference, axis=1)
        bias, spread = difference.mean(axis=0), LIMITS * difference.std(axis=0)
        rows.append(
            JointAgreement(
                name, len(distance), float(distance.mean()), float(np.sqrt((distance**2).mean())),
                float(np.median(distance)), float(np.percentile(distance, 95)),
                _three(bias), _three(spread), bool(on_skin[j]),
            )
        )  # fmt: skip
    return rows


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = map(float, values)
    return x, y, z


def three_point_angles(joints: np.ndarray) -> dict[str, np.ndarray]:
    """Compute `ANGLES` of joints (T, 20, 3): name -> float64 (T,), degrees, NaN where a joint is unknown."""
    found = {}
    for name, (a, b, c, offset) in ANGLES.items():
        first, middle, last = (joints[:, REPORTED.index(joint)] for joint in (a, b, c))
        u, v = first - middle, last - middle
        with np.errstate(invalid="ignore", divide="ignore"):
            cosine = (u * v).sum(axis=1) / (np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1))
        inner = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        found[name] = offset - inner if offset else inner
    return found


def angle_agreement(track: dict[str, np.ndarray], reference: dict[str, np.ndarray]) -> list[AngleAgreement]:
    """Compare angles (T,), degrees, that have the same name."""
    rows = []
    for name in (name for name in track if name in reference):
        known = np.isfinite(track[name]) & np.isfinite(reference[name])
        if known.sum() < 2:
            continue
        own, other = track[name][known], reference[name][known]
        difference = own - other
        bias, sd = float(difference.mean()), float(difference.std(ddof=1))
        moving = own.std() > 0 and other.std() > 0
        rows.append(
            AngleAgreement(
                name, int(known.sum()), bias, sd, float(np.sqrt((difference**2).mean())), bias - LIMITS * sd,
                bias + LIMITS * sd, float(np.corrcoef(own, other)[0, 1]) if moving else float("nan"), _range(own),
                _range(other),
            )
        )  # fmt: skip
    return rows


def _range(values: np.ndarray) -> float:
    low, high = np.percentile(values, [1, 99])
    return float(high - low)


def stride_agreement(times: np.ndarray, track: np.ndarray, reference: np.ndarray) -> list[StrideAgreement]:
    """Compare strides of joints (T, 20, 3), level frame; empty for a person who does not walk.

    A foot touches down where its ankle is farthest ahead of the pelvis (Zeni 2008, Gait & Posture 27).
    """
    rows = []
    for side in ("left", "right"):
        (n, time, length), (m, other_time, other_length) = (_strides(times, own, side) for own in (track, reference))
        if n or m:
            rows.append(StrideAgreement(side, n, m, time, other_time, length, other_length))
    return rows


def _strides(times: np.ndarray, joints: np.ndarray, side: str) -> tuple[int, float, float]:
    pelvis, ankle = joints[:, REPORTED.index("pelvis")], joints[:, REPORTED.index(f"{side}_ankle")]
    known = np.isfinite(pelvis).all(axis=1) & np.isfinite(ankle).all(axis=1)
    walked = np.ptp(pelvis[known][:, [0, 2]], axis=0) if known.any() else np.zeros(2)
    if known.sum() < 10 or np.linalg.norm(walked) < 1.0:
        return 0, float("nan"), float("nan")
    at, pelvis, ankle = times[known], pelvis[known], ankle[known]
    velocity = np.gradient(pelvis[:, [0, 2]], at, axis=0)
    heading = velocity / np.maximum(np.linalg.norm(velocity, axis=1, keepdims=True), 1e-6)
    ahead = ((ankle - pelvis)[:, [0, 2]] * heading).sum(axis=1)
    apart = max(1, round(0.5 / float(np.median(np.diff(at)))))
    peaks, _ = find_peaks(ahead, distance=apart, prominence=0.15)
    if len(peaks) < 2:
        return 0, float("nan"), float("nan")
    lengths = np.linalg.norm(np.diff(ankle[peaks][:, [0, 2]], axis=0), axis=1)
    return len(peaks) - 1, float(np.diff(at[peaks]).mean()), float(lengths.mean())
