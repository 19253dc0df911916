"""Particle swarm optimisation: many positions move towards the best that they and the others have seen (Qammaz, 2.4).

It asks nothing of what it minimises but its value, and so finds minima that a local optimisation walks past.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import constant
from toolkit.kernels.fit import swarm as kernel

Costs = Callable[[np.ndarray], np.ndarray]
"""`costs(positions)` of (N, D): float64 (N,), to be minimised."""


@dataclass(frozen=True)
class SwarmSettings:
    """Constants of a swarm (Qammaz, 2.4).

    Attributes
    ----------
    particles, generations : the paper's 64 in 64 generations cost four times as much and gain nothing once the local
        optimisation follows
    own, shared : c1 and c2 of Eq. 7, pull of the best position of a particle's own, and of the best of all: the
        paper's; the constriction w is 0.7298
    perturbed_every : generations from one perturbation to the next, 0 for none; the paper does not say
    perturbed_share : of the particles, in [0, 1], that get one random angle of their window each time
    """

    particles: int = 32
    generations: int = 32
    own: float = constant(2.8)
    shared: float = constant(1.3)
    perturbed_every: int = constant(3)
    perturbed_share: float = constant(0.5)

    def __post_init__(self) -> None:
        if self.particles < 1 or self.generations < 1:
            raise SettingsError(
                f"a swarm of {self.particles} particles in {self.generations} generations finds nothing; give at least "
                "1 of each"
            )
        if min(self.own, self.shared) < 0.0 or self.own + self.shared <= 4.0:
            raise SettingsError(
                f"own and shared are {self.own} and {self.shared}; they are at least 0 and come to more than 4, so "
                "that the swarm contracts"
            )
        if self.perturbed_every < 0 or not 0.0 <= self.perturbed_share <= 1.0:
            raise SettingsError(
                f"perturbed_every is {self.perturbed_every} and perturbed_share {self.perturbed_share}; the first is "
                "at least 0, the second a share in [0, 1]"
            )

    @property
    def constriction(self) -> float:
        """The w of Eq. 7. It multiplies the whole sum, as in the paper's reference [6], where alone it contracts."""
        psi = self.own + self.shared
        return 2.0 / abs(2.0 - psi - math.sqrt(psi * psi - 4.0 * psi))


@dataclass(frozen=True, eq=False)
class SwarmResult:
    """What a swarm found.

    Attributes
    ----------
    position : float64 (D,), the best that any particle has visited; cost : its value
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
    """The best position that a swarm visits on its way (Qammaz, Eq. 7 and 8).

    Parameters
    ----------
    costs : what is minimised, of many positions at once
    starts : float64 (N, D), where some particles begin, the likeliest first; at most `settings.particles` are taken,
        and the others begin anywhere within the limits
    limits : float64 (D, 2), finite; no particle leaves them: a velocity that would is cut short
    perturbed : int64 (K,), entries that a perturbation may set to anything within the limits; all of them if None

    Every random number is drawn before a generation is evaluated; of equal costs the first particle's wins.
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
    """Set one random entry each of a random `share` of the particles to a random value within its limits."""
    chosen = rng.permutation(len(positions))[: round(share * len(positions))]
    entry = entries[rng.integers(len(entries), size=len(chosen))]
    positions[chosen, entry] = rng.uniform(limits[entry, 0], limits[entry, 1])
