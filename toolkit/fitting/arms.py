"""Arm candidates as chains of balls, compared with the part of a frame that the rest of the body leaves unexplained."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.objective import Comparison
from toolkit.fitting.placed import PlacedBody, balls_of
from toolkit.fitting.scene import Scene
from toolkit.io.errors import SettingsError
from toolkit.kernels import linear
from toolkit.kernels.fit import limbs as kernel

CARRIER = "thorax"
JOINTS = ("clavicle", "shoulder", "elbow", "wrist")
SIDES = ("left", "right")


@dataclass(frozen=True)
class ArmSettings:
    """Settings of the arm search. Lengths in metres.

    Attributes
    ----------
    fitted : number of the best candidates that are fitted as chains of balls; before the fit the correct arm is rarely
        the best
    iterations : iterations of that fit, which the refinement of the whole body completes
    refined : number of the best that are refined with the whole body, over both arms of a frame; each costs as much as
        the local hypothesis. With 1 the error on the tuning split is 1.0 mm larger
    explained : maximum distance of a sample from the body that needs no arm, unless it is at the arm itself; typical of
        correct local hypotheses
    tolerance : metres that a sample may be off from an arm made of balls
    cap : metres that a sample, or a ball in free space, counts at most
    free_space : weight of the mean intrusion of balls into free space relative to the mean over samples: the share of
        an arm in the visible surface
    margin : minimum reduction of the unexplained distance, metres: one of 400 samples that is 20 cm off; with 0, noise
        moves occluded arms
    prior : cost in metres per unit of the pose prior's energy, which decides between arms with equal fit
    """

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
        if min(self.fitted, self.iterations, self.refined) < 1:
            raise SettingsError(
                "arms.fitted, iterations and refined are at least 1, "
                f"not {self.fitted}, {self.iterations}, {self.refined}"
            )


class Arm:
    """One arm of one body, and its candidates.

    Attributes
    ----------
    entries : int64 (D,), indices of its angles in a pose vector
    angles : float64 (C, D), the candidates, radians
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
        """Return versions of `pose` (P,), `compared` with the frame, with arms that leave less unexplained, best first.

        At most `most` are returned. `sigma` is the scale of the sample weights in metres, see `FittingSettings`.
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
        coarse_step = 3  # step between the samples of the first comparison
        coarse = measured._replace(samples=measured.samples[::coarse_step].copy(), share=coarse_step * measured.share)
        kernel.limb_costs(self._balls, self.chain.radii, coarse, costs)
        cheapest = np.argsort(costs, kind="stable")[: settings.fitted]
        angles, costs = self._fitted(self.angles[cheapest], measured, settings, sigma)
        chosen: list[np.ndarray] = []
        different = 0.2  # maximum difference of all angles between arms that count as one candidate, radians
        for k in np.argsort(costs, kind="stable"):
            if costs[k] > own - settings.margin or len(chosen) == most:
                break
            if all(np.abs(angles[k] - other).max() > different for other in chosen):
                chosen.append(angles[k])
        proposed = np.repeat(pose[None], len(chosen), axis=0)
        for candidate, arm in zip(proposed, chosen, strict=True):
            candidate[self.entries] = arm
        return list(proposed)

    def measured(
        self, placed: PlacedBody, compared: Comparison, scene: Scene, settings: ArmSettings
    ) -> kernel.Measured:
        """Return the samples that the rest of the body leaves unexplained, and the depth image."""
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
        # Damping of the fit, m^2 / rad^2: a third of the weight of ten samples at a forearm's length from the joint.
        damping = 5e-4
        kernel.fit_limbs(angles, self.chain, measured, sigma, damping, settings.iterations, costs)
        return angles, costs


def joints_of(side: str) -> list[int]:
    """Return the parent joint of an arm, and the arm's joints from clavicle to wrist."""
    return [skeleton.JOINT_NAMES.index(name) for name in (CARRIER, *(f"{side}_{n}" for n in JOINTS))]


def entries_of(side: str) -> np.ndarray:
    """Return the pose entries of an arm's angles, int64 (D,)."""
    return 3 + np.flatnonzero(np.isin(skeleton.DOF_JOINT, joints_of(side)[1:]))


def _chain_of(side: str, body: Body) -> kernel.Chain:
    """Return the arm of a body as a chain of balls."""
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
    """Return the balls (C, B, 3) of the arms `angles` (C, D)."""
    balls = np.empty((len(angles), len(chain.radii), 3))
    kernel.place_balls(angles, chain, balls)
    return balls
