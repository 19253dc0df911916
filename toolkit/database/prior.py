"""The pose prior given the situation: what limbs without evidence do while the rest of the body is seen.

A mixture of Gaussians over the joint angles of a database, some for people who stand, some for people who sit, crouch
and lie. The variables that a tracker knows say which of them are likely, and each of those says where the others are:
the conditional of a Gaussian is a Gaussian, and so a pose prior of the kind that a least squares fit takes.
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
"""Where the joint angles `pose[6:]` (radians) stand among the variables."""
UP = slice(skeleton.POSE_SIZE - 6, skeleton.POSE_SIZE - 3)
"""Where the vertical in the root's frame stands: the orientation without the heading."""
HEIGHT = skeleton.POSE_SIZE - 3
"""Where the height of the pelvis over the lowest joint stands, in lengths of the leg; known where a floor is."""
SIZE = skeleton.POSE_SIZE - 2
"""Number of variables."""
NOISE = 0.1
"""Radians by which a tracked joint angle differs from the true one; and about the same share of a leg's length."""
_RAISED_THIGH = -float(np.cos(np.radians(60.0)))
"""Vertical part of a thigh's direction in the root's frame above which a thigh is a seated person's."""
_UPRIGHT = float(np.cos(np.radians(50.0)))
"""Vertical part of the trunk's direction below which no person sits."""
_WIDEST = 10.0
"""Radians, or lengths of the leg: no person's variables are larger."""
_COLUMNS = {
    "weights": Column("f", ("components",), 0.0, 1.0),
    "means": Column("f", ("components", SIZE), -_WIDEST, _WIDEST),
    "covariances": Column("f", ("components", SIZE, SIZE), -(_WIDEST**2), _WIDEST**2),
    "situation": Column("i", ("components",), 0, len(SITUATIONS) - 1),
}
_LYING_TRUNK, _LYING_HEIGHT = 0.5, 0.55
_STANDING_HEIGHT = 0.8


def variables(poses: np.ndarray, body: Body) -> np.ndarray:
    """The variables of poses (..., P) of `body` in any y-up frame: float64 (..., SIZE)."""
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
    """Metres from the hips to the lowest joint in the rest pose."""
    return float(-min(body.joints[:, 1].min(), body.sites[:, 1].min()))


def situations(values: np.ndarray) -> np.ndarray:
    """Which of `SITUATIONS` poses of these variables (N, SIZE) are: int64 (N,).

    A person who has both thighs raised under an upright trunk sits, be it on a chair, on the floor or on the heels; a
    person who is low with a level trunk lies; any other person who has the pelvis below 0.8 of the leg's length
    crouches.
    """
    up, height = values[:, UP], values[:, HEIGHT]
    raised = np.ones(len(values), dtype=np.bool_)
    for side in ("left", "right"):
        raised &= _thigh(values, side) > _RAISED_THIGH
    out = np.where(height < _STANDING_HEIGHT, SITUATIONS.index("crouching"), SITUATIONS.index("standing"))
    out[raised & (up[:, 1] > _UPRIGHT)] = SITUATIONS.index("seated")
    out[(up[:, 1] < _LYING_TRUNK) & (height < _LYING_HEIGHT)] = SITUATIONS.index("lying")
    return out


@dataclass(frozen=True, eq=False)
class Conditional:
    """What a prior expects of the variables that are not known.

    Attributes
    ----------
    unknown : int64 (B,), which variables
    mean, covariance : float64 (B,) and (B, B), of the whole mixture
    responsibilities : float64 (K,), probability of each component
    situations : float64 (4,), probability of each of `SITUATIONS`
    log_density : of the known values under the prior: low where no person was ever seen like that
    """

    unknown: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    responsibilities: np.ndarray
    situations: np.ndarray
    log_density: float


@dataclass(frozen=True, eq=False)
class PosePrior:
    """A mixture of K Gaussians over the variables of `variables`.

    Attributes
    ----------
    weights : float64 (K,), sum 1
    means, covariances : float64 (K, SIZE) and (K, SIZE, SIZE)
    situation : int64 (K,), which of `SITUATIONS` each component was learnt from

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
        """The arrays by name, as they stand in a database file."""
        return {
            "weights": self.weights,
            "means": self.means.astype(np.float32),
            "covariances": self.covariances.astype(np.float32),
            "situation": self.situation.astype(np.int8),
        }

    @staticmethod
    def of_arrays(arrays: dict[str, np.ndarray]) -> PosePrior:
        """The prior of stored arrays.

        Raises
        ------
        DatabaseError
            One is missing, of another type, or does not fit.
        """
        check_columns(arrays, _COLUMNS, DatabaseError, "the pose prior", "build the database again")
        try:
            return PosePrior(
                arrays["weights"].astype(np.float64), arrays["means"].astype(np.float64),
                arrays["covariances"].astype(np.float64), arrays["situation"].astype(np.int64),
            )  # fmt: skip
        except KeyError as error:
            raise DatabaseError(f"the pose prior lacks {error}; build the database again") from error

    def expected(self, values: np.ndarray, known: np.ndarray, noise: float = NOISE) -> Conditional:
        """What is to be expected of the variables that are not known.

        Parameters
        ----------
        values : (SIZE,), see `variables`; unknown ones may hold anything
        known : bool (SIZE,)
        noise : standard deviation of the known values about the true ones, radians
        """
        given, missing = np.flatnonzero(known), np.flatnonzero(~known)
        factors, gains, remaining = self._condition(given, missing, noise)
        shares = np.empty(len(self.weights))
        at = np.ascontiguousarray(np.asarray(values, dtype=np.float64)[given])
        log_density = gaussians.responsibilities(at, np.log(self.weights), self.means, given, factors, shares)
        mean, covariance = np.empty(len(missing)), np.empty((len(missing), len(missing)))
        gaussians.expect(at, shares, self.means, given, missing, gains, remaining, mean, covariance)
        by_situation = np.bincount(self.situation, weights=shares, minlength=len(SITUATIONS))
        return Conditional(missing, mean, covariance, shares, by_situation, float(log_density))

    def _condition(self, given: np.ndarray, missing: np.ndarray, noise: float) -> tuple[np.ndarray, ...]:
        """See `gaussians.condition`; kept, because the same limbs stay hidden from frame to frame."""
        key = (given.tobytes(), noise)
        if key not in self._conditioned:
            if len(self._conditioned) >= KEPT:
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


KEPT = 32
"""Sets of known variables whose factors are kept: half a megabyte each."""


def _up_in_root(poses: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    up = Rotation.from_rotvec(poses[:, skeleton.ROOT_ROTATION]).inv().apply([0.0, 1.0, 0.0])
    return np.asarray(up, dtype=np.float64)


def _thigh(values: np.ndarray, side: str) -> np.ndarray:
    """Vertical part in the root's frame of the direction of a thigh (N,)."""
    from scipy.spatial.transform import Rotation

    columns = [skeleton.POSE_NAMES.index(f"{side}_hip_r{letter}") - 6 for letter in "xyz"]
    down = Rotation.from_rotvec(values[:, ANGLES][:, columns]).apply([0.0, -1.0, 0.0])
    return np.asarray(down[:, 1], dtype=np.float64)
