"""The hierarchical particle filter of an upper body, with geodesic-driven proposals (Lopez-Mendez 2011, 2).

Three layers: trunk with head, then one arm given the trunk, then the other arm given all the rest. In every layer the
particles are moved, weighed by the likelihood of Eq. 3 and resampled. Arms are moved by diffusion or, as Eq. 6 has it,
by inverse kinematics to a candidate for a hand.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.errors import SettingsError
from toolkit.fitting.arms import SIDES, entries_of
from toolkit.fitting.upper import TRUNK, UpperBody, aimed_all_round
from toolkit.kernels import aiming, linear
from toolkit.kernels import particles as kernel
from toolkit.sensing.camera import Camera

SOFT = 0.8
"""Share of the sum of two balls' radii within which they penetrate, as `fitting.terms.SOFT`."""
RATE = 30.0
"""Frames a second for which the diffusion is given."""
LONGEST = 0.5
"""Seconds: a longer gap between frames diffuses no farther."""
TRUNK_ENTRIES: np.ndarray = np.array(
    [*range(6)]
    + [
        i
        for i, name in enumerate(skeleton.POSE_NAMES)
        if i >= 6 and name.rpartition("_")[0] in TRUNK and "clavicle" not in name
    ]
)
"""Where the root, the spine and the neck stand in a pose."""
TRUNK_JOINTS: np.ndarray = np.array(
    [skeleton.REPORTED.index(n) for n in ("spine", "neck", "head", "left_shoulder", "right_shoulder")]
)
"""Rows of the reported joints around which the trunk is weighed."""


@dataclass(frozen=True)
class ParticleSettings:
    """Constants of the filter, metres and radians; what Lopez-Mendez 2011 leaves open has its reason.

    Attributes
    ----------
    count : particles in each of the three layers: 64 is the paper's online figure, 256 its reported one
    alpha : share of the arm particles that diffuse (Eq. 6), in [0, 1]; refusals make it more; 1 is the plain filter
    trunk_columns, arm_columns : pixels of width, at most, of the images that trunks and arms are weighed in: a trunk
        needs no more, and a hand has 8 pixels across at 1.4 m
    bases : different trunks that are kept after the first layer: more are seldom left
    spread : metres of a hand about a candidate (`Sigma_e`), which lies on the surface, at tip or knuckles
    smoothness : `lambda` of Eq. 4: an arm may turn by two radians for a candidate
    least : log-probability of Eq. 4 below which an arm is diffused instead: four spreads from the candidate
    swivel : radians of spread about the swivel nearest to the arm before
    looks : swivels all round at which every candidate is held against the frame before every second aimed arm is drawn,
        by what they cost, for either arm in every other frame: from an arm that is folded the wrong way the near ones
        lead beyond the joint limits; 0 = the paper's blind draw
    near : metres: a candidate counts exp(-distance / near) as much as one at the hand before (`f` of Eq. 5)
    floor : but at least this share, or a raised hand is never proposed to a hanging arm
    holding : metres: the other hand holds a candidate that is as near as this
    held : share that such a candidate counts, or both arms take the same hand
    root_position : metres by which the root diffuses in a frame at 30 Hz
    root_rotation : radians, 3 degrees, likewise
    spine, neck, clavicle : radians per entry, likewise: they move little within a thirtieth of a second
    shoulder, elbow : radians, likewise: fast arms turn by 6 radians a second
    wrist : radians, likewise
    cap : metres, the largest difference of depths that counts (`d_max`): a limb's width
    depth : cost of a mean squared difference of depths in units of the cap (`lambda_1`)
    silhouette : cost of silhouettes that nowhere agree (`lambda_2`): half of what a missed depth costs
    overlap : cost of squared overlaps in units of the balls' radii (`lambda_3`)
    trunk_margin : metres around the trunk's joints within which it is weighed, at their depth: half a shoulder more
    arm_margin : metres around an arm's joints and its candidates: the box must hold the proposed hands
    """

    count: int = 64
    alpha: float = 0.5
    trunk_columns: int = 80
    arm_columns: int = 160
    bases: int = 16
    spread: float = 0.03
    smoothness: float = 0.1
    least: float = -8.0
    swivel: float = 0.5
    looks: int = 8
    near: float = 0.25
    floor: float = 0.3
    holding: float = 0.15
    held: float = 0.05
    root_position: float = 0.02
    root_rotation: float = 0.052
    spine: float = 0.03
    neck: float = 0.1
    clavicle: float = 0.04
    shoulder: float = 0.2
    elbow: float = 0.25
    wrist: float = 0.1
    cap: float = 0.10
    depth: float = 40.0
    silhouette: float = 20.0
    overlap: float = 10.0
    trunk_margin: float = 0.22
    arm_margin: float = 0.15

    def __post_init__(self) -> None:
        for name in ("count", "trunk_columns", "arm_columns", "bases"):
            if getattr(self, name) < 1:
                raise SettingsError(f"particles.{name} is {getattr(self, name)}; give at least 1")
        if self.looks < 0:
            raise SettingsError(f"particles.looks is {self.looks}; give 0 for none, or a number of swivels")
        if not 0.0 <= self.alpha <= 1.0:
            raise SettingsError(f"particles.alpha is {self.alpha}; it is a share and lies in [0, 1]")
        signed = ("count", "alpha", "looks", "trunk_columns", "arm_columns", "bases", "least")
        for name in (field.name for field in fields(self) if field.name not in signed):
            value = getattr(self, name)
            if not (value > 0 or (value == 0 and name not in ("spread", "near", "cap"))):
                raise SettingsError(f"particles.{name} is {value}; spreads, weights and lengths are not negative")

    def diffusion(self) -> np.ndarray:
        """Spread of every pose entry, float64 (P,), per frame at 30 Hz; 0 for the legs."""
        kinds = {"lumbar": self.spine, "thorax": self.spine, "cervical": self.neck}
        kinds |= {
            f"{side}_{name}": getattr(self, name)
            for side in SIDES
            for name in ("clavicle", "shoulder", "elbow", "wrist")
        }
        spread = np.array([kinds.get(name.rpartition("_")[0], 0.0) for name in skeleton.POSE_NAMES])
        spread[skeleton.ROOT_POSITION] = self.root_position
        spread[skeleton.ROOT_ROTATION] = self.root_rotation
        return spread


class ParticleImage(NamedTuple):
    """A frame at one resolution: seen float32 (h, w), as `Scene.seen`, and intrinsics float64 (4,)."""

    seen: np.ndarray
    intrinsics: np.ndarray

    @classmethod
    def of(
        cls, depth: np.ndarray, unobserved: np.ndarray | None, camera: Camera, columns: int, setting: str
    ) -> ParticleImage:
        """Every n-th pixel of a depth image (H, W), metres, so that at least about `columns` are left.

        Raises
        ------
        SettingsError
            The image is narrower than `columns`, which the setting of this name asks for.
        """
        if columns > camera.width:
            raise SettingsError(f"{setting} is {columns}, finer than the image, which has {camera.width} columns")
        step = max(1, camera.width // columns)
        seen = (
            depth[::step, ::step]
            if unobserved is None
            else np.where(unobserved, np.float32(np.nan), depth)[::step, ::step]
        )
        return cls(
            np.ascontiguousarray(seen, dtype=np.float32), np.array(camera.subsampled(step).intrinsics, dtype=np.float64)
        )

    def tile(self, points: np.ndarray, margin: float, settings: ParticleSettings) -> kernel.Tile:
        """The part of the image within `margin` metres of points (N, 3), camera frame; empty where it is outside."""
        fx, fy, cx, cy = self.intrinsics
        height, width = self.seen.shape
        ahead = points[points[:, 2] > kernel.NEAREST]
        window = np.zeros(4, dtype=np.int64)
        if len(ahead):
            z = ahead[:, 2]
            u, v = fx * ahead[:, 0] / z + cx, fy * ahead[:, 1] / z + cy
            rows, columns = fy * margin / z, fx * margin / z
            ends = np.array([(v - rows).min(), (v + rows).max() + 1, (u - columns).min(), (u + columns).max() + 1])
            window = np.clip(ends, 0, [height, height, width, width]).astype(np.int64)
        part = self.seen[window[0] : window[1], window[2] : window[3]]
        pixels = max(int(np.count_nonzero(part > 0)), 1)
        return kernel.Tile(
            self.seen, self.intrinsics, window, pixels, settings.cap, settings.depth, settings.silhouette
        )


class ParticleFrame(NamedTuple):
    """What the filter is told of a frame.

    Attributes
    ----------
    coarse, fine : the images that trunks and arms are weighed in
    candidates : float64 (M, 3), metres, level frame, where hands may be
    """

    coarse: ParticleImage
    fine: ParticleImage
    candidates: np.ndarray


@dataclass(frozen=True, eq=False)
class Filtered:
    """A frame filtered.

    Attributes
    ----------
    particles : float64 (N, P), of equal weight, for the next frame
    estimate : float64 (P,), the particle of largest weight in the last layer (MAP)
    cost : mean over the three layers of what the estimate costs there
    aimed : share of the arm particles that inverse kinematics moved
    """

    particles: np.ndarray
    estimate: np.ndarray
    cost: float
    aimed: float


def likelihood(costs: np.ndarray) -> np.ndarray:
    """Weights (N,), which sum to 1, of particles by their costs (N,) (Eq. 3); a constant in all costs changes none."""
    weights = np.exp(-(costs - costs.min()))
    return weights / weights.sum()


def by_inverse_kinematics(count: int, alpha: float) -> np.ndarray:
    """Which of the particles are aimed, bool (count,): the share 1 - alpha, spread evenly (Lopez-Mendez 2011, 2.2)."""
    steps = np.floor(np.arange(count + 1) * (1.0 - alpha) + 1e-9)
    return np.diff(steps) > 0


def _drawn(weights: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A column for each row of `weights` (N, M), by the row's weights: int64 (N,)."""
    reached = np.cumsum(weights, axis=1)
    rows = (reached < rng.random((len(weights), 1)) * reached[:, -1:]).sum(axis=1)
    return np.minimum(rows, weights.shape[1] - 1)


class UpperFilter:
    """Filters the poses of an upper body from frame to frame.

    Parameters
    ----------
    settings : see `ParticleSettings`
    """

    def __init__(self, settings: ParticleSettings) -> None:
        self.settings = settings
        self._spread = settings.diffusion()
        self._aim = aiming.Aim(settings.spread, settings.smoothness, settings.least)

    def trunk(
        self, upper: UpperBody, particles: np.ndarray, before: np.ndarray, frame: ParticleFrame, dt: float,
        rng: np.random.Generator,
    ) -> np.ndarray:  # fmt: skip
        """First layer: `particles` (N, P) with their trunks moved, weighed and resampled.

        `before` (P,) is the last estimate, `dt` the seconds since then.
        """
        poses = particles.copy()
        self.move_trunk(poses, dt, rng)
        tile = frame.coarse.tile(self._joints(upper, before, TRUNK_JOINTS), self.settings.trunk_margin, self.settings)
        costs = np.empty(len(poses))
        kernel.trunk_costs(poses, upper.whole, tile, costs)
        return poses[self.resampled(costs, rng)]

    def arms(
        self, upper: UpperBody, particles: np.ndarray, before: np.ndarray, frame: ParticleFrame, dt: float,
        first: int, rng: np.random.Generator,
    ) -> Filtered:  # fmt: skip
        """Second and third layer: the arm `first` (0 left, 1 right), then the other, of `particles` (N, P)."""
        poses = particles.copy()
        bases, base_of = self._bases(upper, poses, frame)
        poses = bases[base_of]
        pictures = np.empty((len(bases), *frame.fine.seen.shape))
        kernel.draw_bases(bases, upper.trunk, self._whole(frame.fine), pictures)
        estimate, aimed = poses[0], 0.0
        for side in (first, 1 - first):
            wanted = self.move_arm(upper, poses, side, frame, dt, rng, look=side == first)
            aimed += 0.5 * float(wanted.mean())
            costs = self.arm_costs(upper, poses, side, before, frame, base_of, pictures)
            estimate = poses[int(costs.argmin())]
            chosen = self.resampled(costs, rng)
            poses, base_of = poses[chosen], base_of[chosen]
        return Filtered(poses, estimate, self.cost(upper, estimate, frame), aimed)

    def arm_costs(
        self, upper: UpperBody, poses: np.ndarray, side: int, before: np.ndarray, frame: ParticleFrame,
        base_of: np.ndarray, pictures: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """What each of `poses` (N, P) costs (N,) around one arm, laid over the `pictures` (K, h, w) of its trunk."""
        tile = frame.fine.tile(self._around_arm(upper, side, before, frame), self.settings.arm_margin, self.settings)
        return self._overlaid(upper, poses, tile, base_of, pictures)

    def _overlaid(
        self, upper: UpperBody, poses: np.ndarray, tile: kernel.Tile, base_of: np.ndarray, pictures: np.ndarray
    ) -> np.ndarray:
        """Costs (N,) of the arms of `poses` (N, P) as balls over the `pictures` (K, h, w) of their trunks."""
        balls = np.empty((len(poses), len(upper.trunk.radii), 3))
        kernel.place_balls(poses, upper.trunk, balls)
        rows = np.concatenate(upper.of_arm)
        costs, overlap = np.empty(len(poses)), np.empty(len(poses))
        arms = np.ascontiguousarray(balls[:, rows])
        kernel.overlay_costs(arms, upper.trunk.radii[rows], base_of, pictures, tile, costs)
        kernel.overlap_costs(balls, upper.trunk.radii, upper.apart, SOFT, overlap)
        return costs + self.settings.overlap * overlap

    def costs_of_arms(self, upper: UpperBody, poses: np.ndarray, frame: ParticleFrame) -> np.ndarray:
        """What each of `poses` (N, P), which share a trunk, costs (N,) over the whole image."""
        return self._over_one_trunk(upper, poses, self._whole(frame.fine))

    def whole_costs(self, upper: UpperBody, poses: np.ndarray, frame: ParticleFrame) -> np.ndarray:
        """What each of `poses` (N, P) costs (N,) over the whole image: for poses that are far apart."""
        costs = np.empty(len(poses))
        kernel.trunk_costs(poses, upper.whole, self._whole(frame.coarse), costs)
        return costs

    def _over_one_trunk(self, upper: UpperBody, poses: np.ndarray, tile: kernel.Tile) -> np.ndarray:
        picture = np.empty((1, *tile.seen.shape))
        kernel.draw_bases(poses[:1], upper.trunk, tile, picture)
        return self._overlaid(upper, poses, tile, np.zeros(len(poses), dtype=np.int64), picture)

    def cost(self, upper: UpperBody, pose: np.ndarray, frame: ParticleFrame) -> float:
        """Mean cost of a pose (P,) over the three layers (the last term of Eq. 7)."""
        tile = frame.coarse.tile(self._joints(upper, pose, TRUNK_JOINTS), self.settings.trunk_margin, self.settings)
        trunk = np.empty(1)
        kernel.trunk_costs(pose[None], upper.whole, tile, trunk)
        arms = []
        for side in range(2):
            tile = frame.fine.tile(self._arm_joints(upper, side, pose), self.settings.arm_margin, self.settings)
            arms.append(self._over_one_trunk(upper, pose[None], tile))
        return float(trunk[0] + arms[0][0] + arms[1][0]) / 3.0

    def move_trunk(self, poses: np.ndarray, dt: float, rng: np.random.Generator) -> None:
        """Diffuse root, spine and neck of `poses` (N, P), in place, `dt` seconds after the frame before."""
        self._diffuse(poses, TRUNK_ENTRIES, dt, rng)

    def move_arm(
        self, upper: UpperBody, poses: np.ndarray, side: int, frame: ParticleFrame, dt: float,
        rng: np.random.Generator, *, look: bool = True,
    ) -> np.ndarray:  # fmt: skip
        """Sample one arm of `poses` (N, P) by Eq. 6, in place; bool (N,), which were moved by inverse kinematics.

        To `look` before half of the aimed ones are drawn takes as long as everything else: arms take turns in it.
        """
        s, arm, entries, candidates = self.settings, upper.arms[side], entries_of(SIDES[side]), frame.candidates
        start = poses.copy()
        self._diffuse(poses, entries, dt, rng)
        wanted = by_inverse_kinematics(len(poses), s.alpha if len(candidates) else 1.0)
        if not wanted.any():
            return wanted
        aimed = poses.copy()
        # Clavicle and wrist diffuse with the others; shoulder and elbow are what inverse kinematics starts from.
        swing = np.array([arm.shoulder_entry, arm.shoulder_entry + 1, arm.shoulder_entry + 2, arm.elbow_entry])
        aimed[:, swing] = start[:, swing]
        weights = self.candidate_weights(upper, start, side, candidates)
        target = candidates[_drawn(weights, rng)]
        if look and s.looks > 0:
            informed = np.flatnonzero(wanted)[::2]
            arms, reached, costs = self._looked(upper, start[0], side, frame)
            if len(arms):
                cells = _drawn(np.tile(likelihood(costs) * weights[0, reached], (len(informed), 1)), rng)
                aimed[np.ix_(informed, swing)] = arms[np.ix_(cells, swing)]
                target[informed] = candidates[reached[cells]]
        target = target + s.spread * rng.standard_normal((len(poses), 3))
        swivels = s.swivel * rng.standard_normal(len(poses))
        scores = np.empty(len(poses))
        aiming.aim_arms(aimed, arm, wanted, target, swivels, self._aim, scores)
        taken = np.isfinite(scores)
        poses[taken] = aimed[taken]
        return taken

    def _looked(
        self, upper: UpperBody, pose: np.ndarray, side: int, frame: ParticleFrame
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """One arm of a pose (P,) at every candidate, at swivels all round, as far as its joints allow.

        Poses (n, P), which candidate each has in its hand (n,), and what each costs (n,).
        """
        anything = self._aim._replace(smoothness=0.0)
        poses, reached = aimed_all_round(pose, upper.arms[side], frame.candidates, self.settings.looks, anything)
        if len(poses) == 0:
            return poses, reached, np.empty(0)
        tile = frame.fine.tile(self._around_arm(upper, side, pose, frame), self.settings.arm_margin, self.settings)
        return poses, reached, self._over_one_trunk(upper, poses, tile)

    def candidate_weights(self, upper: UpperBody, poses: np.ndarray, side: int, candidates: np.ndarray) -> np.ndarray:
        """Weights (N, M), which sum to 1, of the `candidates` (M, 3) for one arm of each of `poses` (N, P) (Eq. 5)."""
        s = self.settings
        own, other = self._far(upper, poses, side, candidates), self._far(upper, poses, 1 - side, candidates)
        weights = np.maximum(np.exp(-own / s.near), s.floor) * np.where(other < s.holding, s.held, 1.0)
        return weights / weights.sum(axis=1, keepdims=True)

    def _far(self, upper: UpperBody, poses: np.ndarray, side: int, candidates: np.ndarray) -> np.ndarray:
        """Distances (N, M) of the candidates from the hand of each pose."""
        hands = np.empty((len(poses), 3))
        aiming.place_hands(poses, upper.arms[side], hands)
        return np.sqrt(((hands[:, None] - candidates[None]) ** 2).sum(axis=2))

    def _diffuse(self, poses: np.ndarray, entries: np.ndarray, dt: float, rng: np.random.Generator) -> None:
        """Add Gaussian noise to some entries of `poses` (N, P), in place, within the joint limits."""
        scale = float(np.sqrt(RATE * min(max(dt, 0.0), LONGEST)))
        noise = rng.standard_normal((len(poses), len(entries)))
        poses[:, entries] += scale * self._spread[entries] * noise
        poses[:, entries] = np.clip(poses[:, entries], *skeleton.POSE_LIMITS[entries].T)

    def resampled(self, costs: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Which particles go on, int64 (N,), by their costs (N,)."""
        chosen = np.empty(len(costs), dtype=np.int64)
        kernel.systematic(likelihood(costs), rng.random(), chosen)
        return chosen

    def _bases(self, upper: UpperBody, poses: np.ndarray, frame: ParticleFrame) -> tuple[np.ndarray, np.ndarray]:
        """The most frequent of the resampled `poses` (N, P), and for each pose the base that stands for it."""
        distinct, member = np.unique(poses, axis=0, return_inverse=True)
        member = member.reshape(-1)
        often = np.argsort(-np.bincount(member), kind="stable")[: self.settings.bases]
        place = np.zeros(len(distinct), dtype=np.int64)
        place[often] = np.arange(len(often))
        return distinct[often], place[member]

    def _whole(self, image: ParticleImage) -> kernel.Tile:
        s, (height, width) = self.settings, image.seen.shape
        pixels = max(int(np.count_nonzero(image.seen > 0)), 1)
        window = np.array([0, height, 0, width])
        return kernel.Tile(image.seen, image.intrinsics, window, pixels, s.cap, s.depth, s.silhouette)

    def _joints(self, upper: UpperBody, pose: np.ndarray, rows: np.ndarray) -> np.ndarray:
        return linear.rotated(upper.body.joint_positions(pose)[rows], upper.whole.from_level.T)

    def _arm_joints(self, upper: UpperBody, side: int, pose: np.ndarray) -> np.ndarray:
        names = [f"{SIDES[side]}_{name}" for name in ("shoulder", "elbow", "wrist", "hand")]
        return self._joints(upper, pose, np.array([skeleton.REPORTED.index(name) for name in names]))

    def _around_arm(self, upper: UpperBody, side: int, pose: np.ndarray, frame: ParticleFrame) -> np.ndarray:
        """Joints of one arm, and the candidates within its reach, (K, 3), camera frame."""
        joints, arm = self._arm_joints(upper, side, pose), upper.arms[side]
        candidates = linear.rotated(frame.candidates, upper.whole.from_level.T)
        lengths = linear.lengths(np.stack([arm.bones.upper, arm.fore, arm.hand]))
        near = linear.lengths(candidates - joints[0]) < lengths.sum() + self.settings.arm_margin
        return np.concatenate([joints, candidates[near]])
