"""Pose prior by situation: the distribution of unobserved limbs given the observed rest of the body.

A mixture of Gaussians over the joint angles of a database, with components for standing, seated, crouching and lying
people. The known variables weight the components; each component gives the conditional Gaussian of the other
variables, a quadratic prior for a least squares fit.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.archives import Column, check_columns
from toolkit.io.errors import DatabaseError
from toolkit.kernels.learning import gaussians

SITUATIONS: tuple[str, ...] = ("standing", "seated", "crouching", "lying")
ANGLES = slice(0, skeleton.POSE_SIZE - 6)
"""Joint angles `pose[6:]` (radians) among the variables."""
UP = slice(skeleton.POSE_SIZE - 6, skeleton.POSE_SIZE - 3)
"""Vertical in the root's frame among the variables: the orientation without the heading."""
HEIGHT = skeleton.POSE_SIZE - 3
"""Height of the pelvis over the lowest joint among the variables, in leg lengths; known with a floor."""
SIZE = skeleton.POSE_SIZE - 2
"""Number of variables."""
_WIDEST = 10.0
"""Largest absolute variable, radians or leg lengths."""
_COLUMNS = {
    "weights": Column("f", ("components",), 0.0, 1.0),
    "means": Column("f", ("components", SIZE), -_WIDEST, _WIDEST),
    "covariances": Column("f", ("components", SIZE, SIZE), -(_WIDEST**2), _WIDEST**2),
    "situation": Column("i", ("components",), 0, len(SITUATIONS) - 1),
}


def variables(poses: np.ndarray, body: Body) -> np.ndarray:
    """Return the variables of poses (..., P) of `body` in any y-up frame: float64 (..., SIZE)."""
    poses = skeleton.check_pose(poses)
    flat = poses.reshape(-1, skeleton.POSE_SIZE)
    out = np.empty((len(flat), SIZE))
    out[:, ANGLES] = flat[:, 6:]
    out[:, UP] = _up_in_root(flat)
    joints = body.joint_positions(flat)
    pelvis = joints[:, skeleton.REPORTED.index("pelvis"), 1]
    out[:, HEIGHT] = (pelvis - joints[..., 1].min(axis=1)) / leg_length(body)
    return out.reshape(*poses.shape[:-1], SIZE)


def leg_length(body: Body) -> float:
    """Return the distance from the hips to the lowest joint in the rest pose."""
    return float(-min(body.joints[:, 1].min(), body.sites[:, 1].min()))


def situations(values: np.ndarray) -> np.ndarray:
    """Return the rows in `SITUATIONS` of poses with these variables (N, SIZE): int64 (N,).

    A person with both thighs raised under an upright trunk is seated, on a chair, on the floor or on the heels. A low
    person with a horizontal trunk is lying. Any other person with the pelvis below 0.8 leg lengths is crouching.
    """
    up, height = values[:, UP], values[:, HEIGHT]
    raised = np.ones(len(values), dtype=np.bool_)
    # Vertical component of a thigh's direction in the root's frame above which a person may be seated.
    raised_thigh = -float(np.cos(np.radians(60.0)))
    for side in ("left", "right"):
        raised &= _thigh(values, side) > raised_thigh
    standing_height = 0.8
    out = np.where(height < standing_height, SITUATIONS.index("crouching"), SITUATIONS.index("standing"))
    # Vertical component of the trunk's direction below which a person is not seated.
    upright = float(np.cos(np.radians(50.0)))
    out[raised & (up[:, 1] > upright)] = SITUATIONS.index("seated")
    lying_trunk, lying_height = 0.5, 0.55
    out[(up[:, 1] < lying_trunk) & (height < lying_height)] = SITUATIONS.index("lying")
    return out


@dataclass(frozen=True, eq=False)
class Conditional:
    """Distribution of the unknown variables given the known ones.

    Attributes
    ----------
    unknown : int64 (B,), rows of the unknown variables
    mean, covariance : float64 (B,) and (B, B), of the whole mixture
    responsibilities : float64 (K,), probability of each component
    """

    unknown: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    responsibilities: np.ndarray


@dataclass(frozen=True, eq=False)
class PosePrior:
    """Mixture of K Gaussians over the variables of `variables`.

    Attributes
    ----------
    weights : float64 (K,), sum 1
    means, covariances : float64 (K, SIZE) and (K, SIZE, SIZE)
    situation : int64 (K,), row in `SITUATIONS` that each component was learnt from

    Raises
    ------
    DatabaseError
        The arrays do not fit together, or a value is out of range.
    """

    weights: np.ndarray
    means: np.ndarray
    covariances: np.ndarray
    situation: np.ndarray
    _conditioned: dict[tuple[bytes, float], tuple[np.ndarray, ...]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        check_columns(vars(self), _COLUMNS, DatabaseError, "the pose prior", "build the database again")
        if not (len(self.weights) and (self.weights > 0.0).all()):
            raise DatabaseError("the pose prior has no component, or one without weight; build the database again")

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the arrays by name, as stored in a database file."""
        return {
            "weights": self.weights,
            "means": self.means.astype(np.float32),
            "covariances": self.covariances.astype(np.float32),
            "situation": self.situation.astype(np.int8),
        }

    @staticmethod
    def of_arrays(arrays: dict[str, np.ndarray]) -> PosePrior:
        """Return the prior of stored arrays.

        Raises
        ------
        DatabaseError
            An array is missing, has another type, or does not fit.
        """
        check_columns(arrays, _COLUMNS, DatabaseError, "the pose prior", "build the database again")
        try:
            return PosePrior(
                arrays["weights"].astype(np.float64), arrays["means"].astype(np.float64),
                arrays["covariances"].astype(np.float64), arrays["situation"].astype(np.int64),
            )  # fmt: skip
        except KeyError as error:
            raise DatabaseError(f"the pose prior lacks {error}; build the database again") from error

    def expected(self, values: np.ndarray, known: np.ndarray, noise: float = 0.1) -> Conditional:
        """Return the distribution of the unknown variables.

        Parameters
        ----------
        values : (SIZE,), see `variables`; unknown ones are ignored
        known : bool (SIZE,)
        noise : standard deviation of the error of the known values, radians
        """
        given, missing = np.flatnonzero(known), np.flatnonzero(~known)
        factors, gains, remaining = self._condition(given, missing, noise)
        shares = np.empty(len(self.weights))
        at = np.ascontiguousarray(np.asarray(values, dtype=np.float64)[given])
        gaussians.responsibilities(at, np.log(self.weights), self.means, given, factors, shares)
        mean, covariance = np.empty(len(missing)), np.empty((len(missing), len(missing)))
        gaussians.expect(at, shares, self.means, given, missing, gains, remaining, mean, covariance)
        return Conditional(missing, mean, covariance, shares)

    def _condition(self, given: np.ndarray, missing: np.ndarray, noise: float) -> tuple[np.ndarray, ...]:
        """Return `gaussians.condition`, cached, because the same limbs stay occluded from frame to frame."""
        key = (given.tobytes(), noise)
        cached_conditions = 32  # number of sets of known variables with cached factors, half a megabyte each
        if key not in self._conditioned:
            if len(self._conditioned) >= cached_conditions:
                self._conditioned.clear()
            count = len(self.weights)
            made = (
                np.empty((count, len(given), len(given))),
                np.empty((count, len(missing), len(given))),
                np.empty((count, len(missing), len(missing))),
            )
            gaussians.condition(self.covariances, given, missing, noise, *made)
            self._conditioned[key] = made
        return self._conditioned[key]


def _up_in_root(poses: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    up = Rotation.from_rotvec(poses[:, skeleton.ROOT_ROTATION]).inv().apply([0.0, 1.0, 0.0])
    return np.asarray(up, dtype=np.float64)


def _thigh(values: np.ndarray, side: str) -> np.ndarray:
    """Return the vertical component in the root's frame of the direction of a thigh (N,)."""
    from scipy.spatial.transform import Rotation

    columns = [skeleton.POSE_NAMES.index(f"{side}_hip_r{letter}") - 6 for letter in "xyz"]
    down = Rotation.from_rotvec(values[:, ANGLES][:, columns]).apply([0.0, -1.0, 0.0])
    return np.asarray(down[:, 1], dtype=np.float64)
