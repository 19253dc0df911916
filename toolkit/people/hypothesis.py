"""Person score of a head candidate: log-odds by the person network, and by motion over the frames of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.sensing.camera import Camera

HEAD_HEIGHT = (0.5, 2.4)
"""Height of a head's centre above the floor, metres: a squatting child of 0.8 m, an adult of 2.2 m on a step."""


class PersonClassifier(Protocol):
    """Classifier of single pixels of a depth image, independent of motion.

    Log-odds are multiples of 1/64, so that their sums are exact in any order. The arguments are a whole image, float32
    (h, w), metres along z, 0 = no measurement, and its camera.
    """

    def log_odds(self, depth: np.ndarray, camera: Camera) -> np.ndarray:
        """Return the log-odds that pixels show a person and not a room: float32 (h, w), 0 without measurement."""
        ...

    def heads(self, depth: np.ndarray, camera: Camera) -> np.ndarray:
        """Return the log-odds of a head's centre at pixels, with a peak at each head: float32 (h, w)."""
        ...


def possible_height(place: np.ndarray, floor: float | None) -> bool:
    """Return True if a head at `place` (3,), level frame, has a possible height above `floor` (y, metres or None)."""
    return floor is None or HEAD_HEIGHT[0] <= place[1] - floor <= HEAD_HEIGHT[1]


def person_score(peak: float, odds: float) -> float:
    """Return the log-odds of a person at a head, of its largest log-odds of a head and its mean log-odds of a person.

    A logistic regression on held-out simulated images (`training.fit_person_score`), whose offset is 0. Motionless
    objects of real rooms have up to 0.2 (`um`, `lab1_cam1`, `lab1_cam2`).
    """
    per_peak, per_odds, offset = 1.7, 0.25, -0.25
    return per_peak * peak + per_odds * odds + offset


@dataclass(frozen=True)
class EvidenceSample:
    """Evidence of one frame for a head candidate.

    Attributes
    ----------
    score : see `person_score`
    moved : fraction of the head's pixels before the lasting background
    """

    score: float
    moved: float


def log_odds(samples: Sequence[EvidenceSample]) -> float:
    """Return the log odds of a person against furniture from at least one sample."""
    moved = 4.0  # weight of the fraction of frames in which the candidate stood elsewhere
    return float(np.mean([s.score for s in samples]) + moved * np.mean([s.moved for s in samples]))
