"""The protocol of a search: an observation and a state in, a proposal of hypotheses out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.objective import Comparison
from toolkit.tracking.observation import Observation
from toolkit.tracking.state import PersonState


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A pose that may be the person's.

    Attributes
    ----------
    source : who says so, as the track reports it
    pose : float64 (P,), level frame, refined
    comparison : how far it is from the frame, where the search knows
    continues : it goes on from the previous pose, so that the step between the two says something about the next one
    improves : the hypothesis that it is made from and takes the place of: the search decided between the two by
        something that tells more than the cost does
    """

    source: str
    pose: np.ndarray
    comparison: Comparison | None = None
    continues: bool = False
    improves: ScoredHypothesis | None = None


UNLIKELY = 0.1
"""Metres of distance that a unit of the pose prior's energy counts where no previous pose is known: of two poses
that explain a frame alike, the likelier one."""


@dataclass(frozen=True, eq=False)
class ScoredHypothesis:
    """A hypothesis that was judged; of all of a frame the one of least cost is the person's pose (Baak 2013, 5.4.4).

    Attributes
    ----------
    body : whose pose it is
    comparison : how far that is from the frame
    cost : metres: the sparse distance and, where the person is found anew, how unlikely the pose is (maximum a
        posteriori); a pose that goes on from another one needs no other prior
    """

    hypothesis: Hypothesis
    body: Body
    comparison: Comparison
    cost: float

    @classmethod
    def of(cls, hypothesis: Hypothesis, body: Body, comparison: Comparison, *, anew: bool) -> ScoredHypothesis:
        """A hypothesis with its cost; `anew` says whether the person is found anew."""
        cost = comparison.distance + UNLIKELY * comparison.energy if anew else comparison.distance
        return cls(hypothesis, body, comparison, cost)


def cost_of(scored: ScoredHypothesis) -> float:
    """What is to be least."""
    return scored.cost


@dataclass(frozen=True, eq=False)
class Proposal:
    """A search's answer: hypotheses, and its memory for the next frame (None: unchanged)."""

    hypotheses: tuple[Hypothesis, ...] = ()
    memory: Mapping[str, np.ndarray] | None = None


NOTHING = Proposal()


class Search(Protocol):
    """A source of pose hypotheses.

    Attributes
    ----------
    name : under which its time is booked and its `memory` is kept
    """

    name: str

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """Hypotheses for a frame, given what was known before it and the one of least cost so far.

        Without `state.previous` the person has to be found anew, with the body `state.body`.
        """
        ...


class Verifier(Protocol):
    """Adds hypotheses once where the person has to be found anew, after all searches of all bodies.

    Attributes
    ----------
    name : under which its time is booked
    """

    name: str

    def verified(self, observation: Observation, scored: Sequence[ScoredHypothesis]) -> list[ScoredHypothesis]:
        """Further hypotheses, given all that were scored."""
        ...
