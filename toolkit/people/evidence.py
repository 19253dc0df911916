"""Evidence that a head candidate or a track is a person: the person network, and motion over the frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from toolkit.io.typed_values import Range

HEAD_HEIGHT = (0.5, 2.4)
"""Height of a head's centre above the floor, metres: a squatting child of 0.8 m, an adult of 2.2 m on a step."""


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
class Evidence:
    """Accumulated evidence of one head candidate or track.

    Attributes
    ----------
    looks : number of samples
    score : sum of the person scores of the head, see `person_score`
    moved : sum of the fractions of the head's pixels before a known background
    """

    looks: Annotated[int, Range(0)] = 0
    score: Annotated[float, Range(-1e12, 1e12)] = 0.0
    moved: Annotated[float, Range(0.0, 1e12)] = 0.0

    def after(self, score: float, moved: float) -> Evidence:
        """Return the evidence with one more sample."""
        return Evidence(self.looks + 1, self.score + score, self.moved + moved)

    @property
    def log_odds(self) -> float:
        """Log odds of a person against furniture; without a sample those of a person who moves."""
        per_motion = 4.0  # log-odds of a head that moved in all samples
        return per_motion if self.looks == 0 else (self.score + per_motion * self.moved) / self.looks

    def text(self) -> str:
        """Return the score with its evidence, for people."""
        if self.looks == 0:
            return "no evidence sampled"
        moved = f"{self.moved / self.looks:.0%} of the head moved"
        return f"person score {self.log_odds:+.1f} ({self.looks} sampled frames, {moved})"


def furniture(evidence: Mapping[int, Evidence]) -> frozenset[int]:
    """Return the ids of tracks that score as furniture."""
    return frozenset(person for person, own in evidence.items() if own.log_odds <= 0)
