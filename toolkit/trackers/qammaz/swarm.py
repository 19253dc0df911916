"""Particle swarm optimisation: positions move towards the best ones that they and the swarm have visited (Qammaz, 2.4).

The method uses only values of the objective, and finds minima beyond the reach of a local optimisation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import AtLeastOne, NotNegative, Range, Share, constant
from toolkit.kernels.fit import swarm as kernel

Costs = Callable[[np.ndarray], np.ndarray]
"""Objective `costs(positions)` of (N, D): float64 (N,), minimised."""


@dataclass(frozen=True)
class SwarmSettings:
    """Settings of a swarm (Qammaz, 2.4).

    Attributes
    ----------
    particles, generations : 64 in 64 generations as in the paper cost four times as much and gain nothing before a
        local optimisation
    own, shared : c1 and c2 of Eq. 7, weights of a particle's own best position and of the swarm's (from the paper); the
        constriction w is 0.7298
    perturbed_every : number of generations between two perturbations, 0 for none; not given in the paper
    perturbed_share : of the particles, in [0, 1], that get one random angle of their window each time
    """

    particles: AtLeastOne = 32
    generations: AtLeastOne = 32
    own: NotNegative = constant(2.8)
    shared: NotNegative = constant(1.3)
    perturbed_every: Annotated[int, Range(0)] = constant(3)
    perturbed_share: Share = constant(0.5)

    def __post_init__(self) -> None:
        if self.own + self.shared <= 4.0:
            raise SettingsError(
                f"own and shared are {self.own} and {self.shared}; their sum must be above 4, so that the swarm "
                "contracts"
            )

    @property
    def constriction(self) -> float:
        """Return the constriction w of Eq. 7. It multiplies the whole sum, as in the paper's reference [6], where only
        this form contracts."""
        psi = self.own + self.shared
        return 2.0 / abs(2.0 - psi - math.sqrt(psi * psi - 4.0 * psi))


@dataclass(frozen=True, eq=False)
class SwarmResult:
    """Result of a swarm.

    Attributes
    ----------
    position : float64 (D,), best visited position; cost : its value
    history : float64 (G + 1,), the best cost at the start and after each generation, never rising
    """

    position: np.ndarray
    cost: float
    history: np.ndarray


def minimise(
    costs: Costs,
    starts: np.ndarray,
    limits: np.ndarray,
    settings: SwarmSettings,
    rng: np.random.Generator,
    *,
    perturbed: np.ndarray | None = None,
) -> SwarmResult:
    """Minimise an objective with a swarm (Qammaz, Eq. 7 and 8).

    Parameters
    ----------
    costs : minimised function of many positions at once
    starts : float64 (N, D), initial positions, most probable first; at most `settings.particles` are used, and the
        other particles start at random within the limits
    limits : float64 (D, 2), finite; a velocity that would leave them is reduced
    perturbed : int64 (K,), entries that a perturbation may set to any value within the limits; None = all

    All random numbers are drawn before a generation is evaluated; of equal costs the first particle wins.
    """
    count, size = settings.particles, len(limits)
    low, high = limits[:, 0], limits[:, 1]
    positions = rng.uniform(low, high, (count, size))
    given = starts[:count]
    positions[: len(given)] = np.clip(given, low, high)
    velocities = np.zeros_like(positions)
    own, own_costs = positions.copy(), costs(positions)
    best = int(own_costs.argmin())
    history = [float(own_costs[best])]
    entries = np.arange(size) if perturbed is None else perturbed
    pulls = np.array([settings.own, settings.shared, settings.constriction])
    for generation in range(1, settings.generations + 1):
        kernel.move(positions, velocities, own, own[best], rng.random((2, count, size)), pulls, limits)
        if settings.perturbed_every and generation % settings.perturbed_every == 0:
            _perturb(positions, limits, entries, settings.perturbed_share, rng)
        now = costs(positions)
        better = now < own_costs
        own[better], own_costs[better] = positions[better], now[better]
        best = int(own_costs.argmin())
        history.append(float(own_costs[best]))
    return SwarmResult(own[best].copy(), float(own_costs[best]), np.array(history))


def _perturb(
    positions: np.ndarray, limits: np.ndarray, entries: np.ndarray, share: float, rng: np.random.Generator
) -> None:
    """Set one random entry of a random fraction `share` of the particles to a random value within its limits."""
    chosen = rng.permutation(len(positions))[: round(share * len(positions))]
    entry = entries[rng.integers(len(entries), size=len(chosen))]
    positions[chosen, entry] = rng.uniform(limits[entry, 0], limits[entry, 1])
