"""Learns the pose prior of a database from its own poses: a mixture of Gaussians for each situation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.database.prior import SITUATIONS, SIZE, PosePrior, situations, variables
from toolkit.errors import SettingsError


@dataclass(frozen=True)
class PriorSettings:
    """How the prior is learnt.

    Attributes
    ----------
    components : Gaussians of a situation, at most
    smallest : poses that a Gaussian is learnt from, at least; a situation with fewer is left out
    most : poses of a situation that take part, evenly chosen
    deviation : radians added to every variable, so that no direction is ever certain
    evenness : exponent of a situation's number of poses in its weight: 0 all alike, 1 as often as in the database
    """

    components: int = 4
    smallest: int = 60
    most: int = 4000
    deviation: float = 0.15
    evenness: float = 0.5

    def __post_init__(self) -> None:
        if min(self.components, self.smallest, self.most) < 1 or not self.deviation > 0:
            raise SettingsError("prior: components, smallest and most are at least 1, deviation is positive")


def learn_prior(
    poses: np.ndarray, body: Body, settings: PriorSettings | None = None, seed: int = 0
) -> PosePrior | None:
    """The prior of canonical poses (N, P) of `body`; None where no situation has enough of them."""
    from sklearn.mixture import GaussianMixture
    from threadpoolctl import threadpool_limits

    settings = settings or PriorSettings()
    values = variables(poses, body)
    of_pose = situations(values)
    weights: list[np.ndarray] = []
    means: list[np.ndarray] = []
    covariances: list[np.ndarray] = []
    labels: list[np.ndarray] = []
    for situation in range(len(SITUATIONS)):
        rows = np.flatnonzero(of_pose == situation)
        count = min(settings.components, len(rows) // settings.smallest)
        if count == 0:
            continue
        chosen = values[rows[np.linspace(0, len(rows) - 1, min(len(rows), settings.most)).astype(np.int64)]]
        mixture = GaussianMixture(count, reg_covar=settings.deviation**2, random_state=seed, max_iter=60, tol=1e-2)
        with threadpool_limits(1):  # the products of BLAS differ in their last bits with the number of threads
            mixture.fit(chosen)
        weights.append(mixture.weights_ * len(rows) ** settings.evenness)
        means.append(mixture.means_)
        covariances.append(mixture.covariances_)
        labels.append(np.full(count, situation))
    if not weights:
        return None
    together = np.concatenate(weights)
    return PosePrior(
        together / together.sum(), np.concatenate(means).reshape(-1, SIZE),
        np.concatenate(covariances).reshape(-1, SIZE, SIZE), np.concatenate(labels),
    )  # fmt: skip
