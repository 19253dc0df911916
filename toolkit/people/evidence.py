"""Evidence that a head candidate or a track is a person: the person network, and motion over the frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Annotated, Any

import numpy as np

from toolkit.io.archives import Column
from toolkit.io.checkpoint import check_state
from toolkit.io.typed_values import Range

HEAD_HEIGHT = (0.5, 2.4)
"""Height of a head's centre above the floor, metres: a squatting child of 0.8 m, an adult of 2.2 m on a step."""
COLUMNS = {"id": int, "looks": int, "score": float, "rested": int}
"""Columns of the evidence of many tracks in a file."""


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


@dataclass(frozen=True)
class Evidence:
    """Accumulated evidence of one track.

    Attributes
    ----------
    looks : number of samples
    score : sum of the person scores of the head, see `person_score`
    rested : samples with a head at which nothing ever moves
    """

    looks: Annotated[int, Range(0)] = 0
    score: Annotated[float, Range(-1e12, 1e12)] = 0.0
    rested: Annotated[int, Range(0)] = 0

    def after(self, score: float, rests: bool) -> Evidence:
        """Return the evidence with one more sample."""
        return replace(self, looks=self.looks + 1, score=self.score + score, rested=self.rested + rests)

    @property
    def log_odds(self) -> float:
        """Person score: log odds of a person against furniture."""
        moving = 2.0  # log-odds of a track that moved in all samples
        if self.looks == 0:
            return moving
        moved = 1 - self.rested / self.looks
        return self.score / self.looks + moving * moved

    def text(self) -> str:
        """Return the score with its evidence, for people."""
        if self.looks == 0:
            return "no evidence sampled"
        return f"person score {self.log_odds:+.1f} ({self.looks} sampled frames, {self.rested} of them motionless)"


def furniture(evidence: Mapping[int, Evidence]) -> frozenset[int]:
    """Return the ids of tracks that score as furniture."""
    return frozenset(person for person, own in evidence.items() if own.log_odds <= 0)


def export_evidence(evidence: Mapping[int, Evidence]) -> dict[str, Any]:
    """Return evidence by id as columns."""
    rows = [(person, *astuple(own)) for person, own in sorted(evidence.items())]
    return {name: np.array([row[k] for row in rows], dtype=kind) for k, (name, kind) in enumerate(COLUMNS.items())}


def restore_evidence(state: Mapping[str, Any]) -> dict[int, Evidence]:
    """Restore evidence by id from what `export_evidence` returned; raises TrackError for anything else."""
    whole, number = Column("i", ("n",), 0, 1e9), Column("f", ("n",), -1e12, 1e12)
    check_state(state, {name: number if kind is float else whole for name, kind in COLUMNS.items()}, (), "evidence")
    rows = zip(*(state[name].tolist() for name in COLUMNS), strict=True)
    return {person: Evidence(*row) for person, *row in rows}
