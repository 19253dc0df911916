"""Fakes of a tracker's parts with given answers, which keep their inputs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from tests import poses
from toolkit.body.body import Body
from toolkit.fitting.objective import WORSE, Comparison
from toolkit.sensing.cloud import Cloud
from toolkit.tracking.search.search_protocol import Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import FIRST_STEP, PersonState

CENTRE = np.array([0.1, 0.2, -3.0])
FACING = np.array([0.6, 0.8])
IN_VIEW = np.linspace(0.1, 1.0, 20)


def pose_at(x: float = 0.0, **angles: float) -> np.ndarray:
    """Return a standing pose (P,) at `x` metres to the right, 3 m away, with some entries by name."""
    return poses.pose_at((x, 0.0, -3.0), **angles)


def compared(distance: float, *, gaps: float = 0.01, energy: float = 0.0) -> Comparison:
    """Return a comparison of this distance whose samples all lie `gaps` metres away."""
    return Comparison(distance, distance, np.zeros(1), np.full(4, gaps), energy, None, None)


def observation(extrema: int = 20, estimate: Any = None, **others: Any) -> Any:
    """Return an observation with extrema on a line and the given attributes."""
    points = np.arange(3.0 * extrema, dtype=np.float32).reshape(extrema, 3)
    seen = {
        "scene": object(),
        "centre": CENTRE,
        "facing": FACING,
        "in_view": IN_VIEW,
        "elapsed": FIRST_STEP,
        "yaw": float(np.arctan2(*FACING)),
        "extrema": SimpleNamespace(points=points),
        "free_extrema": points.astype(np.float64),
        "estimate": estimate,
        "network_evidence": lambda _joints, before: before,
        "cloud": SimpleNamespace(rotation=np.diag([1.0, -1.0, -1.0])),
        "timestamp": 0.0,
        "prepare": lambda: None,
    }
    return SimpleNamespace(**(seen | others))


@dataclass
class FakeObserver:
    """Observer that returns the same observation for each sighting."""

    shown: Any = field(default_factory=observation)
    states: list[PersonState] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)

    def observe(
        self,
        cloud: Cloud,
        timestamp: float,
        state: PersonState,
        unobserved: np.ndarray | None = None,
        joints: Any = None,
    ) -> Any:
        """See `Observer.observe`."""
        self.states.append(state)
        self.shown.timestamp = timestamp
        self.shown.follows = state.previous is not None
        self.sizes.append(len(cloud))
        if state.timestamp is not None:
            self.shown.elapsed = timestamp - state.timestamp
        return self.shown


@dataclass
class FakeObjective:
    """Objective whose cost depends on the root's x: `distances[x]`."""

    distances: Mapping[float, float] = field(default_factory=dict)
    bounds: list[float] = field(default_factory=list)
    bodies: list[Body] = field(default_factory=list)
    placer: Any = None

    def compare(self, body: Body, pose: np.ndarray, scene: Any, bound: float = np.inf) -> Comparison:
        """See `Objective.compare`."""
        self.bounds.append(bound)
        self.bodies.append(body)
        distance = self.distances[round(float(pose[0]), 6)]
        return WORSE if distance > bound else compared(distance)

    def confidence(
        self, comparison: Comparison, joints: np.ndarray, spread: np.ndarray, estimate: Any = None
    ) -> np.ndarray:
        """Return a confidence that falls with the distance, and is 0 for inferred joints."""
        return np.where(spread > 0.0, 0.0, 1.0 - comparison.distance)


@dataclass
class FakeSearch:
    """Search with a given answer, which may be a function of its inputs."""

    name: str
    answer: Proposal | Callable[[PersonState, ScoredHypothesis | None], Proposal]
    asked: list[tuple[Any, PersonState, ScoredHypothesis | None]] = field(default_factory=list)
    draws: list[float] = field(default_factory=list)

    def propose(
        self, seen: Any, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """See `Search.propose`."""
        self.asked.append((seen, state, best))
        self.draws.append(float(rng.random()))
        return self.answer(state, best) if callable(self.answer) else self.answer


@dataclass
class FakeRefiner:
    """Refiner that moves each pose by `step` along x and keeps its inputs."""

    step: float = 0.0
    calls: list[SimpleNamespace] = field(default_factory=list)
    settings: Any = field(default_factory=lambda: SimpleNamespace(iterations=5, sigma=0.12))

    def refine(
        self, body: Body, pose: np.ndarray, scene: Any, *, terms: Any = (), iterations: Any = None
    ) -> np.ndarray:
        """See `Refiner.refine`."""
        self.calls.append(SimpleNamespace(body=body, pose=pose.copy(), terms=tuple(terms), iterations=iterations))
        moved = pose.copy()
        moved[0] += self.step
        return moved


def says(source: str, pose: np.ndarray, distance: float | None = None, **how: bool) -> Hypothesis:
    """Return a hypothesis, with its comparison if a distance is given."""
    return Hypothesis(source, pose, None if distance is None else compared(distance), **how)
