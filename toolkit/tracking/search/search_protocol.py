"""Protocol of a search: an observation and a state in, a proposal of hypotheses out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.objective import Comparison
from toolkit.io.parts import Parts
from toolkit.tracking.observation import Observation
from toolkit.tracking.state import PersonState


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Pose hypothesis of one search.

    Attributes
    ----------
    source : name of the search in the track
    pose : float64 (P,), level frame, refined
    comparison : comparison with the frame, if the search computed it
    continues : True if it continues the previous pose, so that their difference is a velocity
    improves : hypothesis that it replaces: the search decided between the two by a better criterion than the cost
    """

    source: str
    pose: np.ndarray
    comparison: Comparison | None = None
    continues: bool = False
    improves: ScoredHypothesis | None = None


UNLIKELY = 0.1
"""Metres of distance per unit of the pose prior's energy without a previous pose: the likelier of two equal poses
wins.
"""


@dataclass(frozen=True, eq=False)
class ScoredHypothesis:
    """Hypothesis with its cost; the one of lowest cost in a frame is the person's pose (Baak 2013, 5.4.4).

    Attributes
    ----------
    body : body of the pose
    comparison : comparison with the frame
    cost : metres: the sparse distance and, where the person is detected again, the pose prior (maximum a posteriori)
    """

    hypothesis: Hypothesis
    body: Body
    comparison: Comparison
    cost: float

    @classmethod
    def of(cls, hypothesis: Hypothesis, body: Body, comparison: Comparison, *, redetected: bool) -> ScoredHypothesis:
        """Return a hypothesis with its cost; `redetected` is True if the person is detected again."""
        cost = comparison.distance + UNLIKELY * comparison.energy if redetected else comparison.distance
        return cls(hypothesis, body, comparison, cost)


def cost_of(scored: ScoredHypothesis) -> float:
    """Return the cost."""
    return scored.cost


@dataclass(frozen=True, eq=False)
class Proposal:
    """Answer of a search: hypotheses, and its memory for the next frame (None: unchanged)."""

    hypotheses: tuple[Hypothesis, ...] = ()
    memory: Mapping[str, np.ndarray] | None = None


NOTHING = Proposal()


class Search(Protocol):
    """Source of pose hypotheses.

    Attributes
    ----------
    name : key of its time and of its `memory`
    """

    name: str

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """Propose hypotheses for a frame, given the state and the best hypothesis so far.

        Without `state.previous` the person has to be detected again, with the body `state.body`.
        """
        ...


@runtime_checkable
class SearchInParts(Search, Protocol):
    """Search that takes long where the person has to be detected again."""

    def propose_parts(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Parts[Proposal]:
        """Compute the same as `propose` in parts."""
        ...


class Verifier(Protocol):
    """Source of further hypotheses where the person is detected again, after all searches of all bodies.

    Attributes
    ----------
    name : key of its time
    """

    name: str

    def verified(self, observation: Observation, scored: Sequence[ScoredHypothesis]) -> Parts[list[ScoredHypothesis]]:
        """Compute further hypotheses in parts, given all scored ones."""
        ...
