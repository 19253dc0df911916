"""Local optimisation of a pose for one frame by damped, bounded least squares (Baak 2013, 5.4.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.placed import NormalSystem, Placer
from toolkit.fitting.priors import PoseTerm
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import CloudTerm, ContactTerm, PairTerm, SurfaceTerm
from toolkit.kernels.fit import twists

Solve = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], None]
"""Solver `solve(matrix, vector, pose, limits, damping, step)` of the damped step within the limits."""


def mesh_terms(settings: FittingSettings) -> tuple[SurfaceTerm, CloudTerm]:
    """Return the terms between mesh and measured points: mesh to cloud, cloud to mesh."""
    s = settings
    return (
        SurfaceTerm(s.reach, s.neighbours, s.sigma, s.surface_plane, s.surface_point, s.facing, s.vertices),
        CloudTerm(s.reach, s.sigma),
    )


def pair_terms(settings: FittingSettings) -> tuple[PairTerm, ...]:
    """Return the terms of the settings: mesh terms and self-penetration."""
    surface, cloud = mesh_terms(settings)
    terms: list[PairTerm] = [surface, cloud] if settings.cloud_samples else [surface]
    return (*terms, ContactTerm(settings.contact_weight)) if settings.contact_weight > 0.0 else tuple(terms)


class Refiner:
    """Refiner of poses in front of one camera.

    Parameters
    ----------
    placer : places bodies before that camera
    settings : settings of terms and iterations
    terms : terms of point pairs; None = those of the settings
    pose_terms : in the pose vector itself
    system, solve : assembly and solution of the normal equations
    """

    def __init__(
        self,
        placer: Placer,
        settings: FittingSettings,
        pose_terms: Sequence[PoseTerm] = (),
        *,
        terms: Sequence[PairTerm] | None = None,
        system: NormalSystem | None = None,
        solve: Solve = twists.bounded_step,
    ) -> None:
        self.placer, self.settings = placer, settings
        self.terms = pair_terms(settings) if terms is None else tuple(terms)
        self.pose_terms = tuple(pose_terms)
        self._system, self._solve = system or NormalSystem(), solve
        angle_damping, root_damping = 1.0, 0.1  # damping of the angles, and of the root, which moves the whole body
        self._damping = np.full(skeleton.POSE_SIZE, angle_damping)
        self._damping[:6] = root_damping

    def refine(
        self,
        body: Body,
        pose: np.ndarray,
        scene: Scene,
        *,
        terms: Sequence[PairTerm] = (),
        iterations: int | None = None,
    ) -> np.ndarray:
        """Refine `pose` (P,), level frame, for the frame, with optional further terms; return a new pose (P,)."""
        pose, system = pose.copy(), self._system
        step = np.empty_like(pose)
        # Maximum step entry at convergence, radians and metres; the remaining motion is below 2 mm. With 0.002 no
        # frame is better and most are slower.
        converged = 0.01
        for _ in range(iterations or self.settings.iterations):
            placed = self.placer.place(body, pose)
            system.reset(placed.origins[0])
            for term in (*self.terms, *terms):
                term.add(system, placed, scene)
            for evidence in scene.evidence:
                evidence.attract(system, placed)
            system.assemble(placed)
            for prior in (*self.pose_terms, *scene.priors):
                prior.add(system, pose)
            self._solve(system.matrix, system.vector, pose, skeleton.POSE_LIMITS, self._damping, step)
            if twists.advance(pose, step) < converged:
                break
        return pose
