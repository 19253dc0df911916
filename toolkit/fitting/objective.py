"""Objective of the selection: sparse symmetric distance (Baak 2013, 5.4.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.joint_confidence import JointConfidence, joint_confidence, joint_features
from toolkit.fitting.placed import PlacedBody, Placer
from toolkit.fitting.priors import PoseTerm
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import visible_chosen
from toolkit.kernels.fit import pairs


@dataclass(frozen=True, eq=False)
class Comparison:
    """Distance of a pose from a frame.

    Attributes
    ----------
    distance : metres, infinite for one that was given up
    surface : distance between the body and the measured depth, metres, without `Scene.evidence`
    gaps : float64 (C,), metres, from each visible chosen vertex to the nearest measured point; NaN for invisible ones
        and those without a point
    sample_gaps : float64 (M,), metres, from each sample of the frame to the drawn body, capped
    energy : energy of the pose terms, 0 for the likeliest pose
    placed, scene : the body in that pose and the frame, None for one that was given up
    """

    distance: float
    surface: float
    gaps: np.ndarray
    sample_gaps: np.ndarray
    energy: float
    placed: PlacedBody | None
    scene: Scene | None

    @cached_property
    def observed(self) -> np.ndarray:
        """Return which chosen vertices lie at observed pixels: float64 (C,), 1 or 0; none for an aborted comparison."""
        if self.placed is None or self.scene is None:
            return np.empty(0)
        out = np.empty(len(self.placed.chosen_points))
        pairs.observed_points(self.placed.chosen_points, self.scene.seen, self.scene.intrinsics, out)
        return out


WORSE = Comparison(np.inf, np.inf, np.empty(0), np.empty(0), np.inf, None, None)
"""Result of a comparison that stopped beyond the bound."""


class Objective:
    """Comparison of poses with frames of one camera.

    Parameters
    ----------
    placer : places bodies before that camera
    settings : thresholds of visible and of explained points
    pose_terms : terms with an energy that is part of a comparison
    regressions : regressions of the confidence; default: those of the package
    """

    def __init__(
        self,
        placer: Placer,
        settings: FittingSettings,
        pose_terms: Sequence[PoseTerm] = (),
        regressions: JointConfidence | None = None,
    ) -> None:
        self.placer, self.settings = placer, settings
        self.pose_terms = tuple(pose_terms)
        self._regressions = regressions or joint_confidence()

    def compare(self, body: Body, pose: np.ndarray, scene: Scene, bound: float = np.inf) -> Comparison:
        """Compare a pose (P,), level frame, with a frame by the sparse symmetric distance (Baak 2013, Eq. 5.7 to 5.9).

        The distance is the mean over the visible chosen vertices of their distance to the measured points (Eq. 5.7),
        plus the mean over the frame's samples of their distance to the drawn body, which penalises occluded limbs with
        visible measurements. A frame without samples uses its geodesic extrema instead (Eq. 5.8), as in the paper;
        samples are more reliable in furnished rooms, where extrema lie on touched or carried objects. Each distance is
        capped at `unexplained`. The cost of other evidence is added. The comparison stops with `WORSE` once the sum
        exceeds `bound`.
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
        points, drawn = scene.nearest_drawn(placed, samples, s.unexplained)
        sample_gaps = np.empty(len(samples))
        surface += pairs.sample_gaps(points, drawn, samples, s.unexplained, sample_gaps)
        if len(samples) == 0:
            surface += pairs.mean_nearest(scene.extrema, placed.vertices, s.unexplained)
        distance += surface
        if distance > bound:
            return WORSE
        energy = sum(term.energy(pose) for term in (*self.pose_terms, *scene.priors))
        return Comparison(distance, surface, gaps, sample_gaps, energy, placed, scene)

    def confidence(
        self,
        comparison: Comparison,
        joints: np.ndarray,
        spread: np.ndarray | None = None,
        network: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the probability that each reported joint of a compared pose is within 10 cm: float64 (20,), in [0, 1].

        See `joint_features` for the parameters.
        """
        known = np.zeros(len(joints)) if spread is None else spread
        return self._regressions.of(joint_features(comparison, joints, known, network))

    def confidence_of_both(self, confidence: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """Return the probabilities (20,) of joints that another pass has `apart` (20,) metres away, given their own."""
        return self._regressions.of_both(confidence, apart)
