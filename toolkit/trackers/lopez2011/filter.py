"""The hierarchical particle filter of an upper body, with geodesic-driven proposals (Lopez-Mendez 2011, 2).

Three layers: trunk with head, then one arm given the trunk, then the other arm given both. In each layer the particles
are moved, weighted by the likelihood of Eq. 3 and resampled. Arms are moved by diffusion or, by Eq. 6, by inverse
kinematics to a candidate for a hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.io.typed_values import AtLeastOne, Share, constant
from toolkit.kernels.fit import aiming
from toolkit.kernels.fit.particles import systematic
from toolkit.trackers.lopez2011.costs import ParticleFrame, costs_of_arm, costs_of_trunks, likelihood, mean_cost
from toolkit.trackers.lopez2011.upper import TRUNK, UpperBody

SHARPNESS = 3.0
"""Factor of the cost in the log weights: costs are means over pixels, so a wrong arm changes them little."""
SPREAD = 0.03
"""Spread of a hand about a candidate (`Sigma_e`), metres; candidates lie on the surface, at fingertip or knuckles."""
AIM = aiming.Aim(SPREAD, 0.1, -8.0)
"""Spread of arm angles (`lambda` of Eq. 4), and log-probability of Eq. 4 below which an arm diffuses instead: four
spreads from the candidate."""
NEAR_SCALE = 0.25
"""Scale of the distance in `f` of Eq. 5, metres: a candidate has the weight exp(-(distance / NEAR_SCALE)^2)."""
DIFFUSION = {"lumbar": 0.03, "thorax": 0.03, "cervical": 0.1} | {
    f"{side}_{name}": spread
    for side in skeleton.SIDES
    for name, spread in (("clavicle", 0.04), ("shoulder", 0.2), ("elbow", 0.25), ("wrist", 0.1))
}
"""Diffusion of joint angles per frame at 30 Hz, radians: fast arms turn by 6 rad/s, trunks move little."""
ROOT_DIFFUSION = (0.02, 0.052)
"""Diffusion of the root per frame at 30 Hz, metres and radians (3 degrees)."""
TRUNK_ENTRIES: np.ndarray = np.array(
    [*range(6)]
    + [
        i
        for i, name in enumerate(skeleton.POSE_NAMES)
        if i >= 6 and name.rpartition("_")[0] in TRUNK and "clavicle" not in name
    ]
)
"""Pose entries of root, spine and neck."""


@dataclass(frozen=True)
class ParticleSettings:
    """Parameters of the filter that the paper varies or leaves open.

    Attributes
    ----------
    count : particles in each of the three layers (64 in the paper's online figure, 256 in its reported one)
    alpha : fraction of the arm particles that diffuse (Eq. 6), in [0, 1]; rejected proposals add to it; 1 is the plain
        filter
    columns : maximum width in pixels of the images in which poses are weighed (160x120 in the paper); a hand has 8
        pixels across at 1.4 m
    """

    count: AtLeastOne = 256
    alpha: Share = constant(0.5)
    columns: AtLeastOne = 160


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


def diffusion() -> np.ndarray:
    """Return the spread of each pose entry, float64 (P,), per frame at 30 Hz; 0 for the legs."""
    spread = np.array([DIFFUSION.get(name.rpartition("_")[0], 0.0) for name in skeleton.POSE_NAMES])
    spread[skeleton.ROOT_POSITION], spread[skeleton.ROOT_ROTATION] = ROOT_DIFFUSION
    return spread


class UpperFilter:
    """Particle filter of upper-body poses.

    Parameters
    ----------
    settings : see `ParticleSettings`
    """

    def __init__(self, settings: ParticleSettings) -> None:
        self.settings, self._spread = settings, diffusion()

    def trunk(
        self, upper: UpperBody, particles: np.ndarray, before: np.ndarray, frame: ParticleFrame, dt: float,
        rng: np.random.Generator,
    ) -> np.ndarray:  # fmt: skip
        """Process the first layer: move, weight and resample the trunks of `particles` (N, P).

        `before` (P,) is the last estimate, `dt` the seconds since it.
        """
        poses = particles.copy()
        self.diffuse(poses, TRUNK_ENTRIES, dt, rng)
        return poses[resampled(costs_of_trunks(upper, poses, before, frame), rng)]

    def arms(
        self, upper: UpperBody, particles: np.ndarray, before: np.ndarray, frame: ParticleFrame, dt: float,
        rng: np.random.Generator,
    ) -> Filtered:  # fmt: skip
        """Process the second and third layer of `particles` (N, P): the right arm, then the left one (Fig. 4)."""
        poses = particles.copy()
        estimate, both = poses[0], np.zeros(len(poses))
        for side in (1, 0):
            self.move_arm(upper, poses, side, frame.candidates, dt, rng)
            costs = costs_of_arm(upper, poses, side, before, frame)
            both = both + costs
            estimate = poses[int(both.argmin())]
            chosen = resampled(costs, rng)
            poses, both = poses[chosen], both[chosen]
        return Filtered(poses, estimate, mean_cost(upper, estimate, frame))

    def move_arm(
        self, upper: UpperBody, poses: np.ndarray, side: int, candidates: np.ndarray, dt: float,
        rng: np.random.Generator,
    ) -> np.ndarray:  # fmt: skip
        """Sample one arm of `poses` (N, P) by Eq. 6, in place; return bool (N,), True for inverse kinematics.

        `candidates` (M, 3), metres, level frame, are where hands may be.
        """
        arm, start = upper.arms[side], poses.copy()
        self.diffuse(poses, skeleton.ARM_ENTRIES[side], dt, rng)
        # Of the particles, 1 - alpha use inverse kinematics, evenly spread.
        alpha = self.settings.alpha if len(candidates) else 1.0
        wanted = np.diff(np.floor(np.arange(len(poses) + 1) * (1.0 - alpha) + 1e-9)) > 0
        if not wanted.any():
            return wanted
        aimed = poses.copy()
        # Clavicle and wrist diffuse with the others; shoulder and elbow are the start of inverse kinematics.
        swing = np.array([arm.shoulder_entry, arm.shoulder_entry + 1, arm.shoulder_entry + 2, arm.elbow_entry])
        aimed[:, swing] = start[:, swing]
        weights = candidate_weights(upper, start, side, candidates)
        target = candidates[_drawn(weights, rng)] + SPREAD * rng.standard_normal((len(poses), 3))
        swivel = 0.5  # spread about the swivel nearest to the previous arm, radians
        swivels = swivel * rng.standard_normal(len(poses))
        scores = np.empty(len(poses))
        aiming.aim_arms(aimed, arm, wanted, target, swivels, AIM, scores)
        taken = np.isfinite(scores)
        poses[taken] = aimed[taken]
        return taken

    def diffuse(self, poses: np.ndarray, entries: np.ndarray, dt: float, rng: np.random.Generator) -> None:
        """Add Gaussian noise to some entries of `poses` (N, P), in place, within the joint limits.

        `dt` seconds have passed. The first pose does not diffuse, because people mostly move slowly.
        """
        rate = 30.0  # frame rate for which the diffusion is given, Hz
        longest = 0.5  # maximum time between frames in the diffusion, seconds
        scale = float(np.sqrt(rate * min(max(dt, 0.0), longest)))
        noise = rng.standard_normal((len(poses), len(entries)))
        noise[0] = 0.0
        poses[:, entries] += scale * self._spread[entries] * noise
        poses[:, entries] = np.clip(poses[:, entries], *skeleton.POSE_LIMITS[entries].T)


def candidate_weights(upper: UpperBody, poses: np.ndarray, side: int, candidates: np.ndarray) -> np.ndarray:
    """Return weights (N, M), with sum 1, of `candidates` (M, 3) for one arm of `poses` (N, P) (Eq. 5)."""
    hands = np.empty((len(poses), 3))
    aiming.place_hands(poses, upper.arms[side], hands)
    far = np.sqrt(((hands[:, None] - candidates[None]) ** 2).sum(axis=2))
    weights = np.exp(-((far / NEAR_SCALE) ** 2))
    return weights / weights.sum(axis=1, keepdims=True)


def _drawn(weights: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw a column for each row of `weights` (N, M), by the row's weights: int64 (N,)."""
    reached = np.cumsum(weights, axis=1)
    rows = (reached < rng.random((len(weights), 1)) * reached[:, -1:]).sum(axis=1)
    return np.minimum(rows, weights.shape[1] - 1)
