"""Confidence of joints: the probability that each reported joint lies within 10 cm of the person's.

Logistic regressions of one group of joints each, fitted to real and simulated recordings by
`training/fit_confidence.py`. Their inputs are bounded, so that a value beyond those of the fit cannot outweigh the
others.
"""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.body import skeleton
from toolkit.kernels import linear
from toolkit.kernels.fit import pairs
from toolkit.kernels.learning import joint_crop
from toolkit.landmarks.joint_network import JointEstimate

if TYPE_CHECKING:
    from toolkit.fitting.objective import Comparison

ASSET = Path(__file__).parent / "assets" / "confidence.json"
GROUPS: dict[str, tuple[str, ...]] = {
    "trunk": ("pelvis", "spine", "neck", "head", "shoulder", "hip"),
    "elbow": ("elbow",),
    "hand": ("wrist", "hand"),
    "knee": ("knee",),
    "foot": ("ankle", "foot"),
}
"""Last words of the names of the joints of each regression."""
FEATURES = ("surface", "support", "observed", "uncovered", "energy", "spread", "precision", "estimate")
"""Inputs of a regression, see `joint_features`."""
WITHOUT_NETWORK = len(FEATURES) - 2
"""Number of leading features that need no joint network."""
SCALES: dict[str, float] = {
    "surface": 0.03,
    "uncovered": 0.05,
    "energy": 0.01,
    "spread": 0.1,
    "estimate": 0.1,
    "apart": 0.1,
}
"""Value at which an input x / (x + scale) is one half: metres, a share of the samples, an energy."""


class JointConfidence:
    """Logistic regressions of the confidence.

    Parameters
    ----------
    content : parsed file of `ASSET`: for each group the intercept and the coefficients of `FEATURES` (`network`), of
        the first `WITHOUT_NETWORK` (`depth`), and of the log odds and the distance between both passes (`passes`)

    Attributes
    ----------
    content : as given
    """

    def __init__(self, content: dict[str, Any]) -> None:
        self.content = content
        self._tables = {
            name: np.array([content[name][group] for group in _GROUP_OF_JOINT])
            for name in ("network", "depth", "passes")
        }

    def of(self, features: np.ndarray) -> np.ndarray:
        """Return the probabilities (20,) of features (20, 8), see `joint_features`."""
        return _probabilities(self._tables["network" if np.isfinite(features).all() else "depth"], features)

    def of_both(self, confidence: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """Return the probabilities (20,) of joints that another pass has `apart` (20,) metres away, given their own."""
        likely = np.clip(confidence.astype(np.float64), 1e-6, 1.0 - 1e-6)
        odds = np.array([math.log(p / (1.0 - p)) for p in likely])
        return _probabilities(self._tables["passes"], np.stack([odds, bounded(apart, SCALES["apart"])], axis=1))


@cache
def joint_confidence() -> JointConfidence:
    """Load the regressions of the package once."""
    return JointConfidence(json.loads(ASSET.read_text(encoding="utf-8")))


def network_features(joints: np.ndarray, estimate: JointEstimate) -> np.ndarray:
    """Return the inputs of the regressions from the joint network: float64 (20, 2), `precision` and `estimate`.

    Parameters
    ----------
    joints : float64 (20, 3), of the pose, level frame, metres
    estimate : joints of the network in the same frame
    """
    apart = bounded(linear.lengths(joints - estimate.points), SCALES["estimate"])
    return np.stack([np.sqrt(estimate.confidence), apart], axis=1)


def joint_features(
    comparison: Comparison, joints: np.ndarray, spread: np.ndarray, network: np.ndarray | None = None
) -> np.ndarray:
    """Return the inputs of the regressions: float64 (20, 8), in the order of `FEATURES`.

    - surface: distance between the whole body and the measured depth
    - support, observed: visible vertices around the joint, weighted by their distance to measured points (root), and
      the fraction of them at observed pixels
    - uncovered: share of all measured points that lie in reach of the joint and are not covered by the body
    - energy: of the pose prior
    - spread: standard deviation of an inferred joint; 0 for an observed one
    - precision, estimate: inverse of the expected error of the network's joint, and the distance to it; NaN without a
      network

    Parameters
    ----------
    comparison : comparison of the pose with the frame
    joints : float64 (20, 3), of that pose, level frame, metres
    spread : float64 (20,), metres, see `toolkit.tracking.occluded_limbs.Guess`
    network : float64 (20, 2), see `network_features`
    """
    placed, scene = comparison.placed, comparison.scene
    assert placed is not None and scene is not None  # an aborted comparison is never selected
    around = placed.placer.around_joints
    support, observed = np.empty((2, len(around)))
    support_range = 0.04  # metres from a measured point at which a vertex no longer supports its joint
    pairs.support_of_joints(around, comparison.gaps, comparison.observed, support_range, support, observed)
    covered_within = 0.06  # metres from the body within which it covers a measured point
    samples = scene.samples[: scene.plain_samples][comparison.sample_gaps > covered_within]
    points = linear.rotated(joints, placed.placer.from_level.T)
    x, y, z = (samples[:, k, None] - points[:, k] for k in range(3))
    reach = 0.5  # metres of a limb around a joint
    uncovered = np.count_nonzero(x * x + y * y + z * z < reach**2, axis=0)
    features = np.full((len(around), len(FEATURES)), np.nan)
    sensor_noise = 0.013  # metres: smaller surface distances are no evidence (1 % of the simulated frames of the fit)
    features[:, 0] = bounded(np.array(max(comparison.surface, sensor_noise)), SCALES["surface"])
    features[:, 1] = np.sqrt(support)
    fully_observed = 0.4  # minimum fraction of observed vertices around a joint that counts as fully observed
    features[:, 2] = np.minimum(observed / fully_observed, 1.0)
    features[:, 3] = bounded(uncovered / max(scene.plain_samples, 1), SCALES["uncovered"])
    features[:, 4] = bounded(np.array(max(comparison.energy, 0.0)), SCALES["energy"])
    features[:, 5] = bounded(spread, SCALES["spread"])
    if network is not None:
        features[:, WITHOUT_NETWORK:] = network
    return features


def bounded(values: np.ndarray, scale: float) -> np.ndarray:
    """Return values from 0 on as a share in [0, 1): one half at `scale`."""
    return np.asarray(values / (values + scale))


def _probabilities(table: np.ndarray, features: np.ndarray) -> np.ndarray:
    """Return the probabilities (20,), see `joint_crop.probabilities`."""
    out = np.empty(len(table))
    joint_crop.probabilities(table, features, out)
    return out


def group_of(joint: str) -> str:
    """Return the group in `GROUPS` of a reported joint."""
    return next(group for group, words in GROUPS.items() if joint.rsplit("_", 1)[-1] in words)


_GROUP_OF_JOINT = [group_of(joint) for joint in skeleton.REPORTED]
