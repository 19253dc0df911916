"""Evidence of repeated samples that a track is a person, not furniture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from typing import Annotated, Any

import numpy as np

from toolkit.io.archives import Column
from toolkit.io.checkpoint import check_state
from toolkit.io.typed_values import Range

COLUMNS = {"id": int, "looks": int, "score": float, "rested": int}
"""Columns of the evidence of many tracks in a file."""


@dataclass(frozen=True)
class Evidence:
    """Accumulated evidence of one track.

    Attributes
    ----------
    looks : number of samples
    score : sum of the person scores of the head, see `hypothesis.person_score`
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
