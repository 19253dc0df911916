"""How far poses are from a frame: the sparse symmetric distance (Baak 2013, 5.4.4), and what a joint can be trusted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.placed import PlacedBody, Placer
from toolkit.fitting.priors import PoseTerm
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import nearest_drawn, visible_chosen
from toolkit.kernels.fit import pairs

SUPPORT = 0.04
"""Metres from a measured point at which a vertex no longer supports its joint."""
WITHIN = 0.05
"""Metres: the confidence of a joint is the probability of an error below it."""
ODDS: tuple[float, float, float, float] = (-0.43, 2.61, 0.98, -3.44)
"""Log odds of a joint to be within 5 cm: constant of an unobserved one; per root of its support; for being
observed; per natural logarithm of the surface's distance in units of `USUAL`. A logistic regression over the tuning
splits of `bench scenes` and `bench accuracy`."""
USUAL = 0.025
"""Metres: distance of the surface of a good pose from its frame."""
NEAREST, FARTHEST = 0.0185, 0.185
"""Metres: distances beyond which a pose is taken to be no better and no worse."""
OBSERVED = 0.4
"""Share of the vertices around a joint that has to be observed for the joint to count as wholly so."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """How far a pose is from a frame.

    Attributes
    ----------
    distance : metres, infinite for one that was given up
    surface : metres, how far the body and what was measured of it lie apart: the distance without `Scene.evidence`
    gaps : float64 (C,), metres, from each chosen vertex that the camera sees to the nearest measured point; NaN for
        those that it does not see or that have none
    sample_gaps : float64 (M,), metres, from each sample of the frame to the drawn body, capped
    drawn : int64 (M,), the mesh vertex there; -1 where the body is too far
    energy : of the pose terms, 0 for the likeliest pose
    placed, scene : the body in that pose and the frame, None for one that was given up
    """

    distance: float
    surface: float
    gaps: np.ndarray
    sample_gaps: np.ndarray
    drawn: np.ndarray
    energy: float
    placed: PlacedBody | None
    scene: Scene | None

    @cached_property
    def observed(self) -> np.ndarray:
        """Which chosen vertices lie where something was observed: float64 (C,), 1 or 0; none for one given up."""
        if self.placed is None or self.scene is None:
            return np.empty(0)
        out = np.empty(len(self.placed.chosen_points))
        pairs.observed_points(self.placed.chosen_points, self.scene.seen, self.scene.intrinsics, out)
        return out


WORSE = Comparison(np.inf, np.inf, np.empty(0), np.empty(0), np.empty(0, dtype=np.int64), np.inf, None, None)
"""A pose whose comparison stopped beyond the bound."""


class Objective:
    """Compares poses of bodies with frames of one camera.

    Parameters
    ----------
    placer : places bodies before that camera
    settings : what counts as visible and as explained
    pose_terms : whose energy is part of a comparison
    """

    def __init__(self, placer: Placer, settings: FittingSettings, pose_terms: Sequence[PoseTerm] = ()) -> None:
        self.placer, self.settings = placer, settings
        self.pose_terms = tuple(pose_terms)

    def costs(self, body: Body, poses: np.ndarray, scene: Scene) -> np.ndarray:
        """Distances (N,), metres, of `poses` (N, P), level frame; infinite where one is farther than one before it.

        Only the nearest is asked for.
        """
        costs, bound = np.full(len(poses), np.inf), np.inf
        for k, pose in enumerate(poses):
            costs[k] = self.compare(body, pose, scene, bound).distance
            bound = min(bound, costs[k])
        return costs

    def compare(self, body: Body, pose: np.ndarray, scene: Scene, bound: float = np.inf) -> Comparison:
        """A pose (P,), level frame, against a frame by the sparse symmetric distance (Baak 2013, Eq. 5.7 to 5.9).

        The mean distance of the visible chosen vertices to the measured points (Eq. 5.7), plus the mean distance of the
        frame's samples to the drawn body: a body that hides a limb behind itself leaves what was seen of it
        unexplained. A frame without samples is compared by its geodesic extrema in their place (Eq. 5.8), as in the
        paper. Samples decide where there are any, for in a furnished room most extrema may lie on what a person touches
        or carries, and few samples do. Each distance counts `unexplained` at most. What else is known of the frame adds
        its disagreement. As soon as the sum is known to exceed `bound`, the pose is `WORSE`.
        """
        s = self.settings
        placed = self.placer.place(body, pose)
        distance = sum(evidence.cost(placed) for evidence in scene.evidence)
        if distance > bound:
            return WORSE
        visible, points = visible_chosen(placed, scene, s.facing, s.vertices), placed.chosen_points
        nearest, gaps = np.full(points.shape, np.nan), np.empty(len(points))
        scene.medians(points, visible, s.unexplained, 1, nearest)
        surface = pairs.vertex_gaps(points, nearest, visible, s.unexplained, gaps)
        if distance + surface > bound:
            return WORSE
        samples = scene.samples[: scene.plain_samples]
        points, drawn = nearest_drawn(placed, scene, samples, s.unexplained)
        sample_gaps = np.empty(len(samples))
        surface += pairs.sample_gaps(points, drawn, samples, s.unexplained, sample_gaps)
        if len(samples) == 0:
            surface += pairs.mean_nearest(scene.extrema, placed.vertices, s.unexplained)
        distance += surface
        if distance > bound:
            return WORSE
        energy = sum(term.energy(pose) for term in (*self.pose_terms, *scene.priors))
        return Comparison(distance, surface, gaps, sample_gaps, drawn, energy, placed, scene)

    def confidence(self, comparison: Comparison) -> np.ndarray:
        """Probability that each reported joint of a compared pose is within 5 cm: float64 (20,), in [0, 1].

        Its odds rise with the support of the joint (of the chosen vertices around it, the share that the camera sees
        times how near measured points are) and with the share of these vertices that lie where something was observed.
        They fall with the distance of the surface: where the whole is off, no part can be trusted.
        """
        distance = math.log(min(max(comparison.surface, NEAREST), FARTHEST) / USUAL)
        none, supported, seen, far = ODDS
        support, observed = np.empty((2, len(self.placer.around_joints)))
        pairs.support_of_joints(
            self.placer.around_joints, comparison.gaps, comparison.observed, SUPPORT, support, observed
        )
        odds = none + supported * np.sqrt(support) + seen * np.minimum(observed / OBSERVED, 1.0) + far * distance
        return np.asarray(1.0 / (1.0 + np.exp(-odds)))
