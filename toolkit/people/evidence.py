"""The evidence of repeated looks at a track: of a person, or of furniture that looked like one for a while."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from typing import Annotated, Any

import numpy as np

from toolkit.io.archives import Column
from toolkit.io.checkpoint import check_state
from toolkit.io.typed_values import Range

SHAPED = 6.0
"""Log odds between what never has a person's shape and what is seen with it in all frames."""
JUDGED, MOST_JUDGED = 1.5, 4.0
"""Log odds for each of the mean that the judge gives, for its pixels tell more of one another than of other frames; and
the mean beyond which it is not believed."""
FOLLOWED = 2.0
"""Prior log odds of a followed track, before its shape and the judge are asked: it moved, or had a person's shape in
the room."""

LIFELESS = 12.0
"""Log odds against what never moves and has a body that stands as nobody does: more than shape and pixels can say."""
NOBODYS = 0.035
"""Energy of the pose prior, in the median over the frames, that fewer than one person in a hundred has."""
STILL_LOOKS = 4
"""Looks, a few a second, before it counts that nothing moves: anybody keeps still for a moment."""

COLUMNS = {"id": int, "looks": int, "shaped": int, "judged": float, "rested": int, "unlikely": float}
"""Columns of the evidence of many tracks in a file."""


@dataclass(frozen=True)
class Evidence:
    """The evidence of the looks at one track.

    Attributes
    ----------
    looks : their number
    shaped : how many of the looks showed a person's shape
    judged : sum of the mean log odds that the judge gave for the head's pixels
    rested : how many of the looks showed a head at which nothing ever moves
    unlikely : energy of the pose prior, in the median over the frames, of the body that was followed; 0 before, and of
        whom a detector saw in the image
    """

    looks: Annotated[int, Range(0)] = 0
    shaped: Annotated[int, Range(0)] = 0
    judged: Annotated[float, Range(-1e12, 1e12)] = 0.0
    rested: Annotated[int, Range(0)] = 0
    unlikely: Annotated[float, Range(0, 1e12)] = 0.0

    def after(self, shaped: bool, judged: float, rests: bool) -> Evidence:
        """With one more look."""
        looks, shapes, rested = self.looks + 1, self.shaped + shaped, self.rested + rests
        return replace(self, looks=looks, shaped=shapes, judged=self.judged + judged, rested=rested)

    @property
    def lifeless(self) -> bool:
        """Whether nothing of it ever moves, and its body stands as nobody does."""
        return self.looks == self.rested >= STILL_LOOKS and self.unlikely > NOBODYS

    @property
    def log_odds(self) -> float:
        """Log odds of a person against furniture."""
        if self.looks == 0:
            return FOLLOWED
        mean = float(np.clip(self.judged / self.looks, -MOST_JUDGED, MOST_JUDGED))
        return FOLLOWED + SHAPED * (self.shaped / self.looks - 0.5) + JUDGED * mean - LIFELESS * self.lifeless

    def text(self) -> str:
        """Why it was taken for what it is, for people."""
        if self.looks == 0:
            return "never looked at closely"
        pixels = f", pixels {self.judged / self.looks:+.1f}" if self.judged else ""
        shape = f"a person's shape in {self.shaped} of {self.looks} looks"
        still = ", nothing moves and nobody stands like that" if self.lifeless else ""
        return f"{shape}{pixels}{still}, in all {self.log_odds:+.1f} log odds of a person"


def furniture(evidence: Mapping[int, Evidence]) -> frozenset[int]:
    """Ids of what is no person by all that was seen of it."""
    return frozenset(person for person, own in evidence.items() if own.log_odds <= 0)


def export_evidence(evidence: Mapping[int, Evidence]) -> dict[str, Any]:
    """Evidence by id as columns."""
    rows = [(person, *astuple(own)) for person, own in sorted(evidence.items())]
    return {name: np.array([row[k] for row in rows], dtype=kind) for k, (name, kind) in enumerate(COLUMNS.items())}


def restore_evidence(state: Mapping[str, Any]) -> dict[int, Evidence]:
    """Evidence by id from what `export_evidence` gave; raises TrackError for anything else."""
    whole, number = Column("i", ("n",), 0, 1e9), Column("f", ("n",), -1e12, 1e12)
    check_state(state, {name: number if kind is float else whole for name, kind in COLUMNS.items()}, (), "evidence")
    rows = zip(*(state[name].tolist() for name in COLUMNS), strict=True)
    return {person: Evidence(*row) for person, *row in rows}
