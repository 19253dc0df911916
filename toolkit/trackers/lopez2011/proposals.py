"""Proposals of upper-body particles: diffusion, or inverse kinematics to a candidate for a hand (Lopez-Mendez 2011,
2.2)."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.kernels.fit import aiming
from toolkit.trackers.lopez2011.costs import ParticleFrame
from toolkit.trackers.lopez2011.filter_settings import ParticleSettings
from toolkit.trackers.lopez2011.upper import TRUNK, UpperBody

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


def diffusion() -> np.ndarray:
    """Return the spread of each pose entry, float64 (P,), per frame at 30 Hz; 0 for the legs."""
    spread = np.array([DIFFUSION.get(name.rpartition("_")[0], 0.0) for name in skeleton.POSE_NAMES])
    spread[skeleton.ROOT_POSITION], spread[skeleton.ROOT_ROTATION] = ROOT_DIFFUSION
    return spread


def by_inverse_kinematics(count: int, alpha: float) -> np.ndarray:
    """Return the particles that use inverse kinematics, bool (count,): 1 - alpha of them (Lopez-Mendez 2011, 2.2)."""
    steps = np.floor(np.arange(count + 1) * (1.0 - alpha) + 1e-9)
    return np.diff(steps) > 0


class UpperProposals:
    """Proposals for trunks and arms of particles (Eq. 4 to 6).

    Parameters
    ----------
    settings : see `ParticleSettings`
    """

    def __init__(self, settings: ParticleSettings) -> None:
        self.settings, self._spread = settings, diffusion()

    def move_trunk(self, poses: np.ndarray, dt: float, rng: np.random.Generator) -> None:
        """Diffuse root, spine and neck of `poses` (N, P), in place, `dt` seconds after the previous frame."""
        self._diffuse(poses, TRUNK_ENTRIES, dt, rng)

    def move_arm(
        self, upper: UpperBody, poses: np.ndarray, side: int, frame: ParticleFrame, dt: float,
        rng: np.random.Generator,
    ) -> np.ndarray:  # fmt: skip
        """Sample one arm of `poses` (N, P) by Eq. 6, in place; return bool (N,), True for inverse kinematics."""
        arm, entries, candidates = upper.arms[side], skeleton.ARM_ENTRIES[side], frame.candidates
        start = poses.copy()
        self._diffuse(poses, entries, dt, rng)
        wanted = by_inverse_kinematics(len(poses), self.settings.alpha if len(candidates) else 1.0)
        if not wanted.any():
            return wanted
        aimed = poses.copy()
        # Clavicle and wrist diffuse with the others; shoulder and elbow are the start of inverse kinematics.
        swing = np.array([arm.shoulder_entry, arm.shoulder_entry + 1, arm.shoulder_entry + 2, arm.elbow_entry])
        aimed[:, swing] = start[:, swing]
        weights = self.candidate_weights(upper, start, side, candidates)
        target = candidates[_drawn(weights, rng)] + SPREAD * rng.standard_normal((len(poses), 3))
        swivel = 0.5  # spread about the swivel nearest to the previous arm, radians
        swivels = swivel * rng.standard_normal(len(poses))
        scores = np.empty(len(poses))
        aiming.aim_arms(aimed, arm, wanted, target, swivels, AIM, scores)
        taken = np.isfinite(scores)
        poses[taken] = aimed[taken]
        return taken

    def candidate_weights(self, upper: UpperBody, poses: np.ndarray, side: int, candidates: np.ndarray) -> np.ndarray:
        """Return weights (N, M), with sum 1, of `candidates` (M, 3) for one arm of `poses` (N, P) (Eq. 5)."""
        hands = np.empty((len(poses), 3))
        aiming.place_hands(poses, upper.arms[side], hands)
        far = np.sqrt(((hands[:, None] - candidates[None]) ** 2).sum(axis=2))
        weights = np.exp(-((far / NEAR_SCALE) ** 2))
        return weights / weights.sum(axis=1, keepdims=True)

    def _diffuse(self, poses: np.ndarray, entries: np.ndarray, dt: float, rng: np.random.Generator) -> None:
        """Add Gaussian noise to some entries of `poses` (N, P), in place, within the joint limits.

        The first pose does not diffuse, because people mostly move slowly.
        """
        rate = 30.0  # frame rate for which the diffusion is given, Hz
        longest = 0.5  # maximum time between frames in the diffusion, seconds
        scale = float(np.sqrt(rate * min(max(dt, 0.0), longest)))
        noise = rng.standard_normal((len(poses), len(entries)))
        noise[0] = 0.0
        poses[:, entries] += scale * self._spread[entries] * noise
        poses[:, entries] = np.clip(poses[:, entries], *skeleton.POSE_LIMITS[entries].T)


def _drawn(weights: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw a column for each row of `weights` (N, M), by the row's weights: int64 (N,)."""
    reached = np.cumsum(weights, axis=1)
    rows = (reached < rng.random((len(weights), 1)) * reached[:, -1:]).sum(axis=1)
    return np.minimum(rows, weights.shape[1] - 1)
