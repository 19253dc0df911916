"""The hierarchical particle filter of an upper body, with geodesic-driven proposals (Lopez-Mendez 2011, 2).

Three layers: trunk with head, then one arm given the trunk, then the other arm given both. In each layer the particles
are moved, weighted by the likelihood of Eq. 3 and resampled. Arms are moved by diffusion or, by Eq. 6, by inverse
kinematics to a candidate for a hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.kernels.fit.particles import systematic
from toolkit.trackers.lopez2011.costs import (
    ParticleFrame,
    costs_of_arm,
    costs_of_trunks,
    likelihood,
    mean_cost,
    trunk_pictures,
)
from toolkit.trackers.lopez2011.filter_settings import ParticleSettings
from toolkit.trackers.lopez2011.proposals import UpperProposals
from toolkit.trackers.lopez2011.upper import UpperBody

SHARPNESS = 3.0
"""Factor of the cost in the log weights: costs are means over pixels, so a wrong arm changes them little."""


@dataclass(frozen=True, eq=False)
class Filtered:
    """Result of the filter for one frame.

    Attributes
    ----------
    particles : float64 (N, P), of equal weight, for the next frame
    estimate : float64 (P,), particle with the lowest cost over both arm layers (MAP)
    cost : mean cost of the estimate over the three layers
    """

    particles: np.ndarray
    estimate: np.ndarray
    cost: float


def resampled(costs: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return resampled particles, int64 (N,), with the log weights minus `SHARPNESS` times the costs (N,)."""
    chosen = np.empty(len(costs), dtype=np.int64)
    systematic(likelihood(SHARPNESS * costs), rng.random(), chosen)
    return chosen


class UpperFilter:
    """Particle filter of upper-body poses.

    Parameters
    ----------
    settings : see `ParticleSettings`

    Attributes
    ----------
    proposals : moves of the particles
    """

    def __init__(self, settings: ParticleSettings) -> None:
        self.settings = settings
        self.proposals = UpperProposals(settings)

    def trunk(
        self, upper: UpperBody, particles: np.ndarray, before: np.ndarray, frame: ParticleFrame, dt: float,
        rng: np.random.Generator,
    ) -> np.ndarray:  # fmt: skip
        """Process the first layer: move, weight and resample the trunks of `particles` (N, P).

        `before` (P,) is the last estimate, `dt` the seconds since it.
        """
        poses = particles.copy()
        self.proposals.move_trunk(poses, dt, rng)
        costs = costs_of_trunks(upper, poses, before, frame)
        return poses[resampled(costs, rng)]

    def arms(
        self, upper: UpperBody, particles: np.ndarray, before: np.ndarray, frame: ParticleFrame, dt: float,
        rng: np.random.Generator,
    ) -> Filtered:  # fmt: skip
        """Process the second and third layer of `particles` (N, P): the right arm, then the left one (Fig. 4)."""
        poses = particles.copy()
        bases, base_of = self._bases(poses)
        poses = bases[base_of]
        pictures = trunk_pictures(upper, bases, frame)
        estimate, both = poses[0], np.zeros(len(poses))
        for side in (1, 0):
            self.proposals.move_arm(upper, poses, side, frame, dt, rng)
            costs = costs_of_arm(upper, poses, side, before, frame, base_of, pictures)
            both = both + costs
            estimate = poses[int(both.argmin())]
            chosen = resampled(costs, rng)
            poses, base_of, both = poses[chosen], base_of[chosen], both[chosen]
        return Filtered(poses, estimate, mean_cost(upper, estimate, frame))

    def _bases(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the most frequent of the resampled `poses` (N, P), and the index of each pose's representative."""
        distinct, member = np.unique(poses, axis=0, return_inverse=True)
        member = member.reshape(-1)
        bases = 16  # maximum number of different trunks after the first layer
        often = np.argsort(-np.bincount(member), kind="stable")[:bases]
        place = np.zeros(len(distinct), dtype=np.int64)
        place[often] = np.arange(len(often))
        return distinct[often], place[member]
