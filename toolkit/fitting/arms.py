"""Other places for one arm of a tracked pose, from the arms of the database's poses.

A retrieved pose as a whole seldom beats the local optimum (Baak 2013, 5.4.3), although one arm of some pose often
would. So the database is also asked for one arm at a time: its arms, as chains of balls, are held against what the rest
of the body leaves unexplained of the frame, and the cheapest are fitted to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.objective import Comparison
from toolkit.fitting.placed import PlacedBody, balls_of, spread_rows
from toolkit.fitting.scene import Scene
from toolkit.io.errors import SettingsError
from toolkit.kernels import linear
from toolkit.kernels.fit import limbs as kernel

CARRIER = "thorax"
JOINTS = ("clavicle", "shoulder", "elbow", "wrist")
SIDES = ("left", "right")
DAMPING = 5e-4
"""Square metres per square radian: a third of what ten samples at a forearm's length from the joint weigh."""
COARSE = 3
"""Every third sample will do to find the cheapest arms."""
DIFFERENT = 0.2
"""Radians: arms that differ by less in every angle are one candidate."""


@dataclass(frozen=True)
class ArmSettings:
    """Constants of the search for arms. Lengths in metres.

    Attributes
    ----------
    count : different arms of the database that are held against a frame: a quarter of a millisecond
    fitted : the cheapest of them that are fitted, as chains of balls; the right one is seldom the cheapest before the
        fit
    iterations : of that fit; the refinement with the whole body does the rest
    refined : the cheapest of those that are refined with the whole body, of both arms together in one frame; each costs
        as much as the local hypothesis, and with 1 the error on the tuning split is 1.0 mm larger
    explained : metres; a sample nearer to the body than this, and not at the arm itself, needs no arm: what the local
        hypothesis leaves where it is right
    tolerance : metres that a sample may be off from an arm made of balls
    cap : metres that a sample, or a ball in free space, counts at most
    free_space : weight of the mean intrusion of the balls against the mean over the samples: the share of an arm in
        the surface that a camera sees
    margin : metres by which an arm must leave less unexplained than the one it replaces: one sample of 400 that lies
        20 cm off; with 0, noise moves hidden arms
    prior : metres per unit of the pose prior's energy that an unlikely pose counts: of two arms that explain as much,
        the likelier one
    """

    count: int = 128
    fitted: int = 8
    iterations: int = 3
    refined: int = 2
    explained: float = 0.04
    tolerance: float = 0.03
    cap: float = 0.15
    free_space: float = 0.05
    margin: float = 0.0005
    prior: float = 0.05

    def __post_init__(self) -> None:
        if min(self.count, self.fitted, self.iterations, self.refined) < 1 or self.fitted > self.count:
            raise SettingsError(
                "arms.count, fitted, iterations and refined are at least 1 and fitted at most count, "
                f"not {self.count}, {self.fitted}, {self.iterations}, {self.refined}"
            )


class ArmPoses:
    """The arms of the database, as different from each other as can be.

    Parameters
    ----------
    poses : (N, P), of the database
    body : on which they are compared
    count : how many are kept of either side
    """

    def __init__(self, poses: np.ndarray, body: Body, count: int) -> None:
        self._angles: dict[str, np.ndarray] = {}
        for side in SIDES:
            chain, entries = _chain_of(side, body), entries_of(side)
            angles = np.ascontiguousarray(poses[:, entries], dtype=np.float64)
            self._angles[side] = angles[spread_rows(_placed_balls(angles, chain).reshape(len(angles), -1), count)]
        self.of = lru_cache(maxsize=4)(self._of)

    def _of(self, body: Body) -> tuple[Arm, ...]:
        """Both arms of `body`, made once for each body."""
        return tuple(Arm(side, body, self._angles[side]) for side in SIDES)


class Arm:
    """One arm of one body, and the arms of the database that could take its place.

    Attributes
    ----------
    entries : int64 (D,), where its angles stand in a pose vector
    angles : float64 (C, D), the arms of the database, radians
    chain : the arm as a chain of balls
    """

    def __init__(self, side: str, body: Body, angles: np.ndarray) -> None:
        self.entries, self.angles = entries_of(side), angles
        self.chain = _chain_of(side, body)
        self._balls = _placed_balls(angles, self.chain)
        self._carrier = joints_of(side)[0]
        self._of_vertex = np.isin(body.part, joints_of(side)[1:])

    def propose(
        self, pose: np.ndarray, compared: Comparison, scene: Scene, settings: ArmSettings, sigma: float, most: int
    ) -> list[np.ndarray]:
        """`pose` (P,), as it `compared` with the frame, with other arms that leave less unexplained; the best first.

        There are at `most` so many. `sigma` metres off a sample pulls a quarter, see `FittingSettings`.
        """
        placed = compared.placed
        samples = scene.samples[: scene.plain_samples]
        if placed is None or len(samples) == 0:
            return []
        measured = self.measured(placed, compared, scene, settings)
        _, (own,) = self._fitted(pose[None, self.entries], measured, settings, sigma)
        if own <= settings.margin:
            return []
        costs = np.empty(len(self.angles))
        coarse = measured._replace(samples=measured.samples[::COARSE].copy(), share=COARSE * measured.share)
        kernel.limb_costs(self._balls, self.chain.radii, coarse, costs)
        cheapest = np.argsort(costs, kind="stable")[: settings.fitted]
        angles, costs = self._fitted(self.angles[cheapest], measured, settings, sigma)
        chosen: list[np.ndarray] = []
        for k in np.argsort(costs, kind="stable"):
            if costs[k] > own - settings.margin or len(chosen) == most:
                break
            if all(np.abs(angles[k] - other).max() > DIFFERENT for other in chosen):
                chosen.append(angles[k])
        proposed = np.repeat(pose[None], len(chosen), axis=0)
        for candidate, arm in zip(proposed, chosen, strict=True):
            candidate[self.entries] = arm
        return list(proposed)

    def measured(
        self, placed: PlacedBody, compared: Comparison, scene: Scene, settings: ArmSettings
    ) -> kernel.Measured:
        """The frame as an arm's chain needs it: what the rest of the body leaves unexplained, and the depth image."""
        samples = scene.samples[: scene.plain_samples]
        at_arm = (compared.drawn >= 0) & self._of_vertex[compared.drawn]
        free = samples[at_arm | (compared.sample_gaps > settings.explained)]
        rotation, origin = placed.rotations[self._carrier], placed.origins[self._carrier]
        return kernel.Measured(
            rotation, origin, scene.seen, scene.intrinsics, linear.rotated(free - origin, rotation),
            1.0 / len(samples), settings.free_space, settings.tolerance, settings.cap,
        )  # fmt: skip

    def _fitted(
        self, angles: np.ndarray, measured: kernel.Measured, settings: ArmSettings, sigma: float
    ) -> tuple[np.ndarray, np.ndarray]:
        angles, costs = angles.copy(), np.empty(len(angles))
        kernel.fit_limbs(angles, self.chain, measured, sigma, DAMPING, settings.iterations, costs)
        return angles, costs


def joints_of(side: str) -> list[int]:
    """The joint that carries an arm, and the arm's own, from the clavicle to the wrist."""
    return [skeleton.JOINT_NAMES.index(name) for name in (CARRIER, *(f"{side}_{n}" for n in JOINTS))]


def entries_of(side: str) -> np.ndarray:
    """Where the angles of an arm stand in a pose vector, int64 (D,)."""
    return 3 + np.flatnonzero(np.isin(skeleton.DOF_JOINT, joints_of(side)[1:]))


def _chain_of(side: str, body: Body) -> kernel.Chain:
    """The arm of a body as a chain of balls."""
    own, entries, balls = joints_of(side), entries_of(side), balls_of(body)
    mine = np.isin(balls.joint, own[1:])
    joints = body.joints[own]
    return kernel.Chain(
        parents=np.arange(-1, len(joints) - 1),
        rest=joints - joints[0],
        dof_joint=np.array([0, 0, 0, *(own.index(joint) for joint in skeleton.DOF_JOINT[entries - 3])]),
        dof_axis=np.concatenate([[0, 1, 2], skeleton.DOF_AXIS[entries - 3]]),
        limits=np.ascontiguousarray(skeleton.POSE_LIMITS[entries]),
        ball_joint=np.array([own.index(joint) for joint in balls.joint[mine]]),
        ball_offset=balls.offset[mine],
        radii=balls.radius[mine],
    )


def _placed_balls(angles: np.ndarray, chain: kernel.Chain) -> np.ndarray:
    """Balls (C, B, 3) of the arms `angles` (C, D)."""
    balls = np.empty((len(angles), len(chain.radii), 3))
    kernel.place_balls(angles, chain, balls)
    return balls
