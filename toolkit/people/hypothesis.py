"""Person score of a head candidate: the sum of log odds over the frames of a recording.

Each head above shoulders is a hypothesis. Motion, a person's shape and the classifier's log odds of its pixels are
evidence for it; their absence is evidence against it. A single frame decides only where there is no other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.people.detection import near_head
from toolkit.people.view import CoarseCamera, View
from toolkit.sensing.camera import Camera

HEAD_HEIGHT = (0.5, 2.4)
"""Height of a head's centre above the floor, metres: a squatting child of 0.8 m, an adult of 2.2 m on a step."""
SEATED, LOWEST = 1.0, 0.75
"""Metres above the floor: heads of seated adults are above the first; below the second a head counts as fully low."""


class PersonClassifier(Protocol):
    """Classifier of single pixels as person or room, independent of motion."""

    def log_odds(self, depth: np.ndarray, camera: Camera) -> np.ndarray:
        """Return the log odds that pixels show a person and not a room: float32 (h, w), 0 without measurement.

        They are multiples of 1/64, so that their sums are exact in any order.

        Parameters
        ----------
        depth : float32 (h, w), metres along z, 0 = no measurement; the whole image
        camera : camera of that image
        """
        ...


def possible_height(place: np.ndarray, floor: float | None) -> bool:
    """Return True if a head at `place` (3,), level frame, has a possible height above `floor` (y, metres or None)."""
    return floor is None or HEAD_HEIGHT[0] <= place[1] - floor <= HEAD_HEIGHT[1]


def lowness(place: np.ndarray, floor: float | None) -> float:
    """Return how low a head at `place` (3,), level frame, metres, is: 0 (sitting or standing, or no floor) to 1."""
    return 0.0 if floor is None else float(np.clip((SEATED - (place[1] - floor)) / (SEATED - LOWEST), 0.0, 1.0))


def head_log_odds(view: View, coarse: CoarseCamera, place: np.ndarray, classifier: PersonClassifier) -> float | None:
    """Return the mean log odds of a person around a head (3,), level frame; None without a pixel."""
    near = near_head(view, place) & view.foreground
    if not near.any():
        return None
    return float(classifier.log_odds(view.depth, coarse.camera)[near].mean(dtype=np.float64))


@dataclass(frozen=True)
class EvidenceSample:
    """Evidence of one frame for a head candidate.

    Attributes
    ----------
    shaped : True with a person's shape
    moved : fraction of the head's pixels before the lasting background
    judged : mean log odds of the classifier over the head's pixels; None without a pixel
    low : see `lowness`
    """

    shaped: bool
    moved: float
    judged: float | None = None
    low: float = 0.0


def log_odds(samples: Sequence[EvidenceSample]) -> float:
    """Return the log odds of a person against furniture from at least one sample."""

    def mean(values: list[float]) -> float:
        return float(np.mean(values))

    # Mean log odds without evidence: a head candidate looks more like a person than the walls of the training images.
    undecided = 1.3
    judged = [g.judged - undecided for g in samples if g.judged is not None]
    # Log odds:
    prior = -1.8  # of a head candidate without other evidence: rooms hold more candidates than people
    moved = 4.0  # weight of the fraction of frames in which the candidate stood elsewhere
    shaped = 3.0  # difference between a candidate with a person's shape in all frames and in none
    low = 2.0  # against a low head: chairs, boxes and low cupboards end there
    pixel_weight = 0.9  # of the classifier's mean log odds
    return float(
        prior
        + moved * mean([g.moved for g in samples])
        + shaped * (mean([g.shaped for g in samples]) - 0.5)
        - low * mean([g.low for g in samples])
        + pixel_weight * mean(judged or [0.0])
    )


def alone_log_odds(shaped: bool, judged: float | None, low: float = 0.0) -> float:
    """Return the log odds of a person from the only frame of a recording."""
    alone = 0.7  # in a single frame: no later frame finds a missed person
    return alone + log_odds([EvidenceSample(shaped, 0.0, judged=judged, low=low)])
