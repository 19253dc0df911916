"""Evidence of repeated samples that a track is a person, not furniture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from typing import Annotated, Any

import numpy as np

from toolkit.io.archives import Column
from toolkit.io.checkpoint import check_state
from toolkit.io.typed_values import Range

NOBODYS = 0.035
"""Median energy of the pose prior over a track that fewer than one person in a hundred exceeds."""

COLUMNS = {"id": int, "looks": int, "shaped": int, "judged": float, "rested": int, "unlikely": float}
"""Columns of the evidence of many tracks in a file."""


@dataclass(frozen=True)
class Evidence:
    """Accumulated evidence of one track.

    Attributes
    ----------
    looks : number of samples
    shaped : samples with a person's shape
    judged : sum of the classifier's mean log odds over the head's pixels
    rested : samples with a head at which nothing ever moves
    unlikely : median energy of the pose prior over the tracked poses; 0 before tracking, and for people with detected
        joints
    """

    looks: Annotated[int, Range(0)] = 0
    shaped: Annotated[int, Range(0)] = 0
    judged: Annotated[float, Range(-1e12, 1e12)] = 0.0
    rested: Annotated[int, Range(0)] = 0
    unlikely: Annotated[float, Range(0, 1e12)] = 0.0

    def after(self, shaped: bool, judged: float, rests: bool) -> Evidence:
        """Return the evidence with one more sample."""
        looks, shapes, rested = self.looks + 1, self.shaped + shaped, self.rested + rests
        return replace(self, looks=looks, shaped=shapes, judged=self.judged + judged, rested=rested)

    @property
    def lifeless(self) -> bool:
        """True if nothing of it ever moves and its pose is improbable."""
        still_looks = 4  # samples, a few a second, before stillness counts: people keep still for a moment
        return self.looks == self.rested >= still_looks and self.unlikely > NOBODYS

    @property
    def log_odds(self) -> float:
        """Person score: log odds of a person against furniture."""
        followed = 2.0  # prior log odds of a track: it moved, or had a person's shape in the room
        if self.looks == 0:
            return followed
        shaped = 6.0  # log odds between a track that never has a person's shape and one that always has it
        lifeless = 7.0  # log odds against a motionless track in an improbable pose: less than a sure network adds
        pixel_weight = 0.8  # weight of the classifier's mean log odds, whose pixels are correlated
        pixels = pixel_weight * self.judged / self.looks
        return followed + shaped * (self.shaped / self.looks - 0.5) + pixels - lifeless * self.lifeless

    def text(self) -> str:
        """Return the score with its evidence, for people."""
        if self.looks == 0:
            return "no evidence sampled"
        pixels = f", pixels {self.judged / self.looks:+.1f}" if self.judged else ""
        shape = f"shape matched in {self.shaped} of {self.looks} sampled frames"
        still = ", motionless in an improbable pose" if self.lifeless else ""
        return f"person score {self.log_odds:+.1f} ({shape}{pixels}{still})"


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
