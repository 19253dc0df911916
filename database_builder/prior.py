"""Learning of the pose prior: a Gaussian mixture for each situation of people (standing, seated, crouching, lying)."""

from __future__ import annotations

import numpy as np

from toolkit.body.body import Body
from toolkit.database.prior import SITUATIONS, SIZE, PosePrior, situations, variables


def learn_prior(poses: np.ndarray, body: Body) -> PosePrior | None:
    """Return the prior of canonical poses (N, P) of `body`, or None without a situation with enough poses."""
    from sklearn.mixture import GaussianMixture
    from threadpoolctl import threadpool_limits

    values = variables(poses, body)
    of_pose = situations(values)
    weights: list[np.ndarray] = []
    means: list[np.ndarray] = []
    covariances: list[np.ndarray] = []
    labels: list[np.ndarray] = []
    components = 4  # maximum number of Gaussians of a situation
    smallest = 60  # minimum number of poses of a Gaussian; a situation with fewer is left out
    most = 4000  # maximum number of poses of a situation, evenly chosen
    deviation = 0.15  # standard deviation added to each variable, radians, so that no variance is zero
    # Exponent of a situation's number of poses in its weight: 0 all equal, 1 as often as in the database.
    evenness = 0.5
    for situation in range(len(SITUATIONS)):
        rows = np.flatnonzero(of_pose == situation)
        count = min(components, len(rows) // smallest)
        if count == 0:
            continue
        chosen = values[rows[np.linspace(0, len(rows) - 1, min(len(rows), most)).astype(np.int64)]]
        mixture = GaussianMixture(count, reg_covar=deviation**2, random_state=0, max_iter=60, tol=1e-2)
        with threadpool_limits(1):  # the last bits of BLAS products depend on the number of threads
            mixture.fit(chosen)
        weights.append(mixture.weights_ * len(rows) ** evenness)
        means.append(mixture.means_)
        covariances.append(mixture.covariances_)
        labels.append(np.full(count, situation))
    if not weights:
        return None
    together = np.concatenate(weights)
    decimals = 6  # significant digits of the mixture; the others depend on the processor's linear algebra
    return PosePrior(
        np.round(together / together.sum(), decimals),
        np.round(np.concatenate(means).reshape(-1, SIZE), decimals),
        np.round(np.concatenate(covariances).reshape(-1, SIZE, SIZE), decimals),
        np.concatenate(labels),
    )
