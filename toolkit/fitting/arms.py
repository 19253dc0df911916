"""Other places for one arm of a tracked pose, from the arms of the database's poses.

A retrieved pose as a whole seldom beats the local optimum (Baak 2013, 5.4.3), although one arm of some pose often
would. So the database is also asked for one arm at a time: its arms, as chains of balls, are held against what the rest
of the body leaves unexplained of the frame, and the cheapest are fitted to it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.errors import SettingsError
from toolkit.fitting.balls import Balls
from toolkit.fitting.fitter import Comparison, Fitter
from toolkit.fitting.posed import PosedBody, spread_rows
from toolkit.fitting.scene import Scene
from toolkit.kernels import limbs as kernel
from toolkit.kernels import linear

CARRIER = "thorax"
JOINTS = ("clavicle", "shoulder", "elbow", "wrist")
SIGMA = 0.12
"""Metres: as `FittingSettings.sigma`."""
DAMPING = 5e-4
"""Square metres per square radian: a third of what ten samples at a forearm's length from the joint weigh."""
ITERATIONS = 2
"""Of the refinement of a pose of which only one arm is new."""
FARTHER = 1.2
"""By how much the sparse distance may grow: beyond it the new arm is in the way of what was measured."""
COARSE = 3
"""Every third sample will do to find the cheapest arms."""
DIFFERENT = 0.2
"""Radians: arms of which no angle differs by more are one candidate."""


@dataclass(frozen=True)
class ArmSettings:
    """Constants of the search for arms; the reasons stand beside the values in `configs/*.yaml`. Lengths in metres.

    Attributes
    ----------
    count : different arms of the database that are held against a frame
    fitted : the cheapest of them that are fitted, as chains of balls
    iterations : of that fit
    refined : the cheapest of those that are refined with the whole body
    explained : a sample nearer to the body than this, and not at the arm itself, needs no arm
    tolerance : what a sample may be off from an arm made of balls
    cap : the most that a sample, or a ball in free space, counts
    free_space : weight of the mean intrusion of the balls against the mean over the samples
    margin : by how much less an arm must leave unexplained than the one it replaces
    prior : metres per unit of the pose prior's energy that an unlikely pose counts in that
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


class Arm:
    """One arm of one body, and the arms of the database that could take its place.

    Attributes
    ----------
    entries : int64 (D,), where its angles stand in a pose vector
    angles : float64 (C, D), the arms of the database, radians, as different from each other as can be
    """

    def __init__(self, side: str, body: Body, balls: Balls, poses: np.ndarray, count: int) -> None:
        self._joints = [skeleton.JOINT_NAMES.index(name) for name in (CARRIER, *(f"{side}_{n}" for n in JOINTS))]
        dofs = np.flatnonzero(np.isin(skeleton.DOF_JOINT, self._joints[1:]))
        self.entries = 3 + dofs
        places = [self._joints.index(joint) for joint in skeleton.DOF_JOINT[dofs]]
        self._dof_joint = np.array([0, 0, 0, *places])
        self._dof_axis = np.concatenate([[0, 1, 2], skeleton.DOF_AXIS[dofs]])
        self._chain = self._chain_of(body, balls)
        angles = np.ascontiguousarray(poses[:, self.entries], dtype=np.float64)
        self.angles = angles[spread_rows(_placed(angles, self._chain).reshape(len(angles), -1), count)]
        self.set_body(body, balls)

    def set_body(self, body: Body, balls: Balls) -> None:
        """Exchange the body, whose `balls` these are."""
        self._chain = self._chain_of(body, balls)
        self._balls = _placed(self.angles, self._chain)
        self._of_vertex = np.isin(body.part, self._joints[1:])

    def _chain_of(self, body: Body, balls: Balls) -> kernel.Chain:
        mine = np.isin(balls.joint, self._joints[1:])
        joints = body.joints[self._joints]
        return kernel.Chain(
            parents=np.arange(-1, len(joints) - 1),
            rest=joints - joints[0],
            dof_joint=self._dof_joint,
            dof_axis=self._dof_axis,
            limits=np.ascontiguousarray(skeleton.POSE_LIMITS[self.entries]),
            ball_joint=np.array([self._joints.index(joint) for joint in balls.joint[mine]]),
            ball_offset=balls.offset[mine],
            radii=balls.radius[mine],
        )

    def propose(
        self, pose: np.ndarray, compared: Comparison, posed: PosedBody, scene: Scene, settings: ArmSettings
    ) -> list[np.ndarray]:
        """`pose` (P,), as it is `posed`, with other arms that leave less unexplained; the best first."""
        samples = scene.samples[: scene.plain_samples]
        at_arm = (compared.drawn >= 0) & self._of_vertex[compared.drawn]
        free = samples[at_arm | (compared.sample_gaps > settings.explained)]
        rotation, origin = posed.rotations[self._joints[0]], posed.origins[self._joints[0]]
        measured = kernel.Measured(
            rotation, origin, scene.depth, scene.intrinsics, linear.rotated(free - origin, rotation),
            1.0 / len(samples), settings.free_space, settings.tolerance, settings.cap,
        )  # fmt: skip
        _, (own,) = self._fitted(pose[None, self.entries], measured, settings)
        if own <= settings.margin:
            return []
        costs = np.empty(len(self.angles))
        coarse = measured._replace(samples=measured.samples[::COARSE].copy(), share=COARSE * measured.share)
        kernel.limb_costs(self._balls, self._chain.radii, coarse, costs)
        cheapest = np.argsort(costs, kind="stable")[: settings.fitted]
        angles, costs = self._fitted(self.angles[cheapest], measured, settings)
        chosen: list[np.ndarray] = []
        for k in np.argsort(costs, kind="stable"):
            if costs[k] > own - settings.margin or len(chosen) == settings.refined:
                break
            if all(np.abs(angles[k] - other).max() > DIFFERENT for other in chosen):
                chosen.append(angles[k])
        proposed = np.repeat(pose[None], len(chosen), axis=0)
        for candidate, arm in zip(proposed, chosen, strict=True):
            candidate[self.entries] = arm
        return list(proposed)

    def _fitted(
        self, angles: np.ndarray, measured: kernel.Measured, settings: ArmSettings
    ) -> tuple[np.ndarray, np.ndarray]:
        angles, costs = angles.copy(), np.empty(len(angles))
        kernel.fit_limbs(angles, self._chain, measured, SIGMA, DAMPING, settings.iterations, costs)
        return angles, costs


class ArmSearch:
    """Looks for better arms of a tracked pose.

    Parameters
    ----------
    poses : (N, P), of the database
    body : the tracked body; see `set_body`
    """

    def __init__(self, poses: np.ndarray, body: Body, settings: ArmSettings) -> None:
        self.settings = settings
        self._body = body
        balls = Balls.of_body(body)
        self._arms = [Arm(side, body, balls, poses, settings.count) for side in ("left", "right")]

    def set_body(self, body: Body) -> None:
        """Exchange the body."""
        if body is not self._body:
            self._body, balls = body, Balls.of_body(body)
            for arm in self._arms:
                arm.set_body(body, balls)

    def improve(
        self, pose: np.ndarray, compared: Comparison, fitter: Fitter, scene: Scene
    ) -> tuple[np.ndarray, Comparison] | None:
        """The pose with other arms, refined, and its comparison; None where no other arm explains the frame better.

        Decided by what a pose leaves unexplained of the frame and by the pose prior. The other parts of the sparse
        distance do not help here: they are least for an arm that hides in the body.

        Parameters
        ----------
        pose : (P,), level frame, and how it compared with the frame
        """
        settings = self.settings
        first = pose
        for arm in self._arms if scene.plain_samples else ():
            fitter.posed.place(pose)
            for candidate in arm.propose(pose, compared, fitter.posed, scene, settings):
                refined = fitter.refine(candidate, scene, iterations=ITERATIONS)
                tried = fitter.compare(refined, scene, FARTHER * compared.distance)
                if self._unexplained(tried) < self._unexplained(compared) - settings.margin:
                    pose, compared = refined, tried
        return None if pose is first else (pose, compared)

    def _unexplained(self, compared: Comparison) -> float:
        if not np.isfinite(compared.distance):
            return np.inf
        return float(compared.sample_gaps.mean()) + self.settings.prior * compared.energy


def _placed(angles: np.ndarray, chain: kernel.Chain) -> np.ndarray:
    """Balls (C, B, 3) of the arms `angles` (C, D)."""
    balls = np.empty((len(angles), len(chain.radii), 3))
    kernel.place_balls(angles, chain, balls)
    return balls
