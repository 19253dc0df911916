"""Local optimisation: a pose hypothesis refined against one frame by damped, bounded least squares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.errors import SettingsError
from toolkit.fitting.posed import NormalSystem, PosedBody
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import CloudTerm, ContactTerm, PairTerm, PoseTerm, SurfaceTerm, nearest_drawn
from toolkit.kernels import linear, pairs, twists
from toolkit.sensing.camera import Camera

SUPPORT = 0.04
"""Metres from a measured point at which a vertex no longer supports its joint."""
WITHIN = 0.05
"""Metres: what the confidence of a joint is the probability of being within."""
CALIBRATION: np.ndarray = np.array(
    [(0.0, 0.64), (0.1, 0.76), (0.25, 0.82), (0.5, 0.885), (0.75, 0.93), (1.0, 0.955)], dtype=np.float64
)
"""Support of a joint, and the share of the joints that then were within 5 cm on the tuning split of the benchmark."""


@dataclass(frozen=True)
class FittingSettings:
    """Constants of the local optimisation; the reasons stand beside the values in `configs/*.yaml`.

    Lengths in metres, angles in radians.
    """

    iterations: int = 5
    neighbours: int = 3
    reach: float = 0.5
    unexplained: float = 0.2
    sigma: float = 0.12
    facing: float = 0.1
    hidden_tolerance: float = 0.03
    surface_plane: float = 1.0
    surface_point: float = 0.3
    cloud_samples: int = 400
    cloud_plane: float = 1.0
    cloud_point: float = 0.3
    extremum_weight: float = 3.0
    prior_weight: float = 0.001
    contact_weight: float = 1.0
    angle_damping: float = 1.0
    root_damping: float = 0.1
    converged: float = 0.01
    search: str = "pixels"

    def __post_init__(self) -> None:
        if self.iterations < 1 or not 1 <= self.neighbours <= 9:
            raise SettingsError(
                f"fitting needs at least 1 iteration and 1 to 9 neighbours, not {self.iterations} and {self.neighbours}"
            )
        if self.search not in ("pixels", "open3d"):
            raise SettingsError(f"fitting.search is 'pixels' or 'open3d', not {self.search!r}")


@dataclass(frozen=True, eq=False)
class Comparison:
    """How far a pose is from a frame.

    Attributes
    ----------
    distance : metres, infinite for one that was given up
    gaps : float64 (C,), metres, from each chosen vertex that the camera sees to the nearest measured point; NaN for
        those that it does not see or that have none
    sample_gaps : float64 (M,), metres, from each sample of the frame to the drawn body, capped
    drawn : int64 (M,), the mesh vertex there; -1 where the body is too far
    energy : of the pose terms, 0 for the likeliest pose
    """

    distance: float
    gaps: np.ndarray
    sample_gaps: np.ndarray
    drawn: np.ndarray
    energy: float


WORSE = Comparison(np.inf, np.empty(0), np.empty(0), np.empty(0, dtype=np.int64), np.inf)
"""A pose that was given up because it is farther than asked for."""


class Fitter:
    """Refines poses of one body in front of one camera."""

    def __init__(
        self,
        body: Body,
        camera: Camera,
        level_rotation: np.ndarray,
        settings: FittingSettings,
        pose_terms: Sequence[PoseTerm] = (),
    ) -> None:
        self.settings = settings
        self._pose_terms = tuple(pose_terms)
        self.posed = PosedBody(body, camera, level_rotation)
        self._system = NormalSystem()
        self._damping = np.full(skeleton.POSE_SIZE, settings.angle_damping)
        self._damping[:6] = settings.root_damping
        s = settings
        self.surface = SurfaceTerm(
            s.reach, s.neighbours, s.sigma, s.surface_plane, s.surface_point, s.facing, s.hidden_tolerance
        )
        self.cloud = CloudTerm(s.reach, s.sigma, s.cloud_plane, s.cloud_point, s.extremum_weight)
        self._pair_terms: list[PairTerm] = [self.surface, self.cloud] if s.cloud_samples else [self.surface]
        if s.contact_weight > 0.0:
            self._pair_terms.append(ContactTerm(s.contact_weight))

    def refine(
        self,
        pose: np.ndarray,
        scene: Scene,
        *,
        pair_terms: Sequence[PairTerm] = (),
        iterations: int | None = None,
    ) -> np.ndarray:
        """Refine `pose` (P,), level frame, against the frame, with further pairs if given; returns a new pose (P,)."""
        pose = pose.copy()
        step = np.empty_like(pose)
        system, posed = self._system, self.posed
        for _ in range(iterations or self.settings.iterations):
            posed.place(pose)
            posed.draw()
            system.reset(posed.origins[0])
            for term in (*self._pair_terms, *pair_terms):
                term.add(system, posed, scene)
            system.assemble(posed)
            for prior in self._pose_terms:
                prior.add(system, pose)
            self._solve(pose, step)
            pose += step
            _wrap_root(pose)
            if np.abs(step).max() < self.settings.converged:
                break
        return pose

    def _solve(self, pose: np.ndarray, step: np.ndarray) -> None:
        """Fill `step` (P,) from the assembled normal equations: damped, and within the limits of `pose` (P,)."""
        system = self._system
        twists.bounded_step(system.matrix, system.vector, pose, skeleton.POSE_LIMITS, self._damping, step)

    def compare(self, pose: np.ndarray, scene: Scene, bound: float = np.inf) -> Comparison:
        """A pose against a frame by the sparse symmetric distance (Baak 2013, Eq. 5.7 to 5.9).

        The mean distance of the geodesic extrema (as many as there are) to the nearest mesh vertex, plus the mean
        distance of the visible chosen vertices to the measured points, plus, where the fit uses them, the mean distance
        of the samples to the drawn body: a body that hides a limb behind itself leaves what was seen of it unexplained.
        Distances count `unexplained` at most. As soon as the sum is known to exceed `bound`, the pose is `WORSE`.
        """
        posed, s = self.posed, self.settings
        posed.place(pose)
        distance = pairs.mean_nearest(scene.extrema, posed.vertices, s.unexplained)
        if distance > bound:
            return WORSE
        posed.draw()
        visible = posed.find_visible(s.facing, s.hidden_tolerance)
        points = posed.vertices[posed.chosen]
        nearest = np.full((len(points), 3), np.nan)
        scene.neighbours.medians(points, visible, s.unexplained, 1, nearest)
        gaps = linear.lengths(points - nearest)
        distance += _mean_capped(gaps[visible], s.unexplained)
        if distance > bound:
            return WORSE
        samples = scene.samples[: scene.plain_samples]
        points, drawn = nearest_drawn(posed, samples, s.unexplained)
        sample_gaps = np.where(drawn >= 0, np.fmin(linear.lengths(points - samples), s.unexplained), s.unexplained)
        if len(samples):
            distance += float(sample_gaps.mean())
        if distance > bound:
            return WORSE
        return Comparison(distance, gaps, sample_gaps, drawn, sum(term.energy(pose) for term in self._pose_terms))

    def sparse_distance(self, pose: np.ndarray, scene: Scene, bound: float = np.inf) -> float:
        """The distance of `compare` alone, metres."""
        return self.compare(pose, scene, bound).distance

    def confidence(self, comparison: Comparison) -> np.ndarray:
        """Probability that each reported joint of a compared pose is within 5 cm: float64 (20,), in [0, 1].

        It rises with the support of the joint: of the chosen vertices around it, the share that the camera sees times
        how near measured points are.
        """
        near = np.exp(-(np.nan_to_num(comparison.gaps, nan=np.inf) ** 2) / (2.0 * SUPPORT**2))
        return np.interp(2.0 * (linear.times(self.posed.around_joints, near)), *CALIBRATION.T)


def _mean_capped(lengths: np.ndarray, cap: float) -> float:
    """Mean of `lengths` (N,), each at most `cap`; NaN counts as the cap, no lengths at all as well."""
    return float(np.fmin(lengths, cap).mean()) if len(lengths) else cap


def _wrap_root(pose: np.ndarray) -> None:
    """Keep the root's rotation vector shorter than pi (the same rotation, turned the other way)."""
    vector = pose[skeleton.ROOT_ROTATION]
    angle = math.hypot(*vector)
    if angle > np.pi:
        vector *= 1.0 - 2.0 * np.pi / angle
