"""Labelings of the extrema for the database lookup, and the score of its answers (Baak 2013, 5.4.3)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import Literal

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import SettingsError

EFFECTORS = len(skeleton.END_EFFECTORS)
PERMUTATIONS: np.ndarray = np.array(list(permutations(range(EFFECTORS))), dtype=np.int64)
"""The symmetric group S_5, int64 (120, 5): row sigma gives, per end effector n, the extremum sigma(n)."""

_DIGITS: np.ndarray = EFFECTORS ** np.arange(EFFECTORS)[::-1]
"""Base that maps a permutation to a number, in the order of the permutations."""
_LEFT_FOOT, _RIGHT_FOOT = skeleton.END_EFFECTORS.index("left_foot"), skeleton.END_EFFECTORS.index("right_foot")


@dataclass(frozen=True)
class LookupSettings:
    """Settings of the lookup (Baak 2013, 5.4.3); lengths in metres.

    Attributes
    ----------
    search : "scan" searches the database with compiled code, "open3d" by Open3D's kd-tree, as in the paper; the
        answers are the same to the bit
    neighbours : K, poses retrieved per labeling; 5 take the time of 1
    label_distance : metres, mu of Eq. 5.4, the paper's
    jump_speed : metres per second; an extremum that is farther from every extremum of the frame before than this lets
        it come has jumped. The paper leaves it open; a fast hand
    balance : lambda of Eq. 5.6, the paper's
    candidate_distance : metres; an extremum within this distance of an expected end effector is a candidate for it; 0
        = queries by the first five extrema only, as in the paper
    """

    search: Literal["scan", "open3d"] = "scan"
    neighbours: int = 5
    label_distance: float = 0.5
    jump_speed: float = 6.0
    balance: float = 0.5
    candidate_distance: float = 0.25

    def __post_init__(self) -> None:
        if self.search not in ("scan", "open3d"):
            raise SettingsError(f"lookup.search is {self.search!r}; choose scan or open3d")
        if self.neighbours < 1:
            raise SettingsError(f"lookup.neighbours is {self.neighbours}; ask for at least 1 pose per labeling")
        if not 0.0 <= self.balance <= 1.0:
            raise SettingsError(f"lookup.balance is {self.balance}; it weighs two distances and lies in [0, 1]")


def admissible_labelings(extrema: np.ndarray, effectors: np.ndarray, label_distance: float) -> np.ndarray:
    """Return the permutations that put each extremum near the end effector of its label (`S`, Baak 2013, Eq. 5.4).

    extrema, effectors : float64 (5, 3), metres, the same frame; effectors of the previous pose
    Returns int64 (S, 5), rows of `PERMUTATIONS`.
    """
    near = np.linalg.norm(effectors[:, None] - extrema[None, :], axis=2) < label_distance
    return PERMUTATIONS[near[np.arange(EFFECTORS), PERMUTATIONS].all(axis=1)]


def feet_below_labelings(extrema: np.ndarray) -> np.ndarray:
    """Return the 12 labelings that label the two lowest extrema as feet (Baak 2013, 5.4.3).

    extrema : float64 (5, 3), metres, y up. Returns int64 (12, 5).
    """
    lowest = np.argsort(extrema[:, 1], kind="stable")[:2]
    feet = PERMUTATIONS[:, [_LEFT_FOOT, _RIGHT_FOOT]]
    return PERMUTATIONS[np.isin(feet, lowest).all(axis=1)]


def extrema_jumped(extrema: np.ndarray, previous: np.ndarray | None, jump_distance: float) -> bool:
    """Return True if an extremum is far from all of the previous frame, or there was none; (5, 3), metres."""
    if previous is None:
        return True
    gaps = np.linalg.norm(extrema[:, None] - previous[None, :], axis=2).min(axis=1)
    return bool((gaps > jump_distance).any())


def labelings(
    extrema: np.ndarray,
    effectors: np.ndarray | None,
    previous_extrema: np.ndarray | None,
    elapsed: float,
    settings: LookupSettings,
) -> np.ndarray:
    """Return the labelings to query, each once: Eq. 5.4, and the 12 extra ones after a jump; int64 (S, 5).

    `elapsed` seconds have passed since the frame before.
    """
    rows = [] if effectors is None else [admissible_labelings(extrema, effectors, settings.label_distance)]
    if effectors is None or extrema_jumped(extrema, previous_extrema, elapsed * settings.jump_speed):
        rows.append(feet_below_labelings(extrema))
    if len(rows) == 1:
        return rows[0]
    both = np.concatenate(rows)
    return both[np.unique((both * _DIGITS).sum(axis=1), return_index=True)[1]]


def label_candidates(extrema: np.ndarray, expected: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Assign extrema to expected end effectors.

    Pairs of an expected end effector and an extremum at most `reach` metres apart are taken nearest first; each point
    occurs in at most one pair. End effectors that merge with the body have no extremum near them and stay unlabelled:
    the query leaves them out.

    extrema : float64 (E, 3), expected : float64 (5, 3), metres, the same frame
    Returns float64 (5, 3) points (0 where absent) and bool (5,), which are present.
    """
    points, present = np.zeros((EFFECTORS, 3)), np.zeros(EFFECTORS, dtype=np.bool_)
    gaps = np.linalg.norm(expected[:, None] - extrema[None], axis=2)
    for _ in range(min(EFFECTORS, len(extrema))):
        effector, extremum = np.unravel_index(int(gaps.argmin()), gaps.shape)
        if gaps[effector, extremum] > reach:
            break
        points[effector], present[effector] = extrema[extremum], True
        gaps[effector, :] = np.inf
        gaps[:, extremum] = np.inf
    return points, present


def fused_scores(delta: np.ndarray, joints: np.ndarray, previous_joints: np.ndarray, balance: float) -> np.ndarray:
    """Return Eq. 5.6 for each candidate: `lambda delta + (1 - lambda) d_P`, metres, float64 (C,).

    delta : float64 (C,), Eq. 5.5
    joints : float64 (C, 20, 3), previous_joints : float64 (20, 3), the same frame; Eq. 5.1 divides by 20
    """
    difference = (joints - previous_joints).reshape(len(joints), -1)
    return balance * delta + (1.0 - balance) * np.linalg.norm(difference, axis=1) / len(skeleton.REPORTED)
