"""Estimation of the personal shape from the recording, frame by frame.

For a fixed pose the mesh is linear in the shape coefficients, so each frame gives linear equations. They are summed
with slow forgetting, because the pose of an early frame was fitted with an earlier shape.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.fitting.placed import Placer
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import MeshTerm
from toolkit.io.typed_values import constant
from toolkit.kernels import linear


@dataclass(frozen=True)
class ShapeSettings:
    """Settings of the shape estimation.

    Attributes
    ----------
    seconds : duration of the estimation, for which the first rows wait; 0 keeps the initial body
    rate : maximum number of frames per second in the estimation
    prior : weight of the population mean relative to one correspondence of one frame at 1 cm: neighbouring pixels and
        successive frames see the same cloth, so that about 30 of them are one independent observation
    forgetting : factor on the equations of earlier frames per frame, because the first were fitted with a wrong shape
    limit : standard deviations that a coefficient may reach
    """

    seconds: float = 3.0
    rate: float = constant(15.0)
    prior: float = constant(30.0)
    forgetting: float = constant(0.97)
    limit: float = constant(3.0)


MESH_NOISE = 0.01
"""Residual of one standard deviation, metres."""


class ShapeEstimator:
    """Accumulator of the equations of tracked frames, solved for the body's coefficients.

    Parameters
    ----------
    body : before the first frame
    settings : see `ShapeSettings`
    placer, terms : place bodies before the camera, and tie their surface to a frame
    statures : minimum and maximum stature, metres; the most probable body between them is returned
    """

    def __init__(
        self,
        body: Body,
        settings: ShapeSettings,
        placer: Placer,
        terms: Sequence[MeshTerm],
        statures: tuple[float, float] = (0.0, math.inf),
    ) -> None:
        self._settings, self._statures = settings, statures
        self._space = ShapeSpace.load()
        self._placer, self._terms = placer, tuple(terms)
        self.body = body
        size = self._space.size
        self.coefficients = np.array(body.shape, dtype=np.float64)
        self._matrix = np.zeros((size, size))
        self._vector = np.zeros(size)

    def observe(self, pose: np.ndarray, scene: Scene, placer: Placer | None = None) -> Body:
        """Add a frame in which the current body was found in `pose` (P,); return the new body.

        A frame of another camera needs its own `placer`.
        """
        placer = placer or self._placer
        placed = placer.place(self.body, pose)
        pairs = [term.pairs(placed, scene) for term in self._terms]
        vertex = np.concatenate([p.vertex for p in pairs])
        residual = np.concatenate([p.residual for p in pairs])
        weight = np.concatenate([p.weight for p in pairs])
        normals, base = placed.normals[vertex], placed.vertices[vertex]
        columns = np.empty((len(vertex), len(self.coefficients)))
        paired = self._space.at(vertex)
        step = 0.25  # finite difference of the mesh in each coefficient, standard deviations; the mesh is linear in it
        for k in range(len(self.coefficients)):
            changed = self.coefficients.copy()
            changed[k] += step
            moved = placer.place(paired.body(changed), pose, normals).vertices
            columns[:, k] = linear.dots(normals, moved - base) / step
        weight = weight / MESH_NOISE**2
        wanted = linear.times(columns, self.coefficients) - linear.dots(normals, residual)
        forget = self._settings.forgetting
        self._matrix = forget * self._matrix + linear.gram(columns, weight)
        self._vector = forget * self._vector + linear.combined(weight * wanted, columns)
        matrix = self._matrix + self._settings.prior * np.eye(len(self.coefficients))
        # Toddlers have their own mean and variance of the shape coefficients.
        mean = self._space.childhood(self.coefficients[0])
        away = self._vector - linear.times(self._matrix, mean)
        change = linear.solved(matrix, away)
        self._set(mean, change)
        missing = float(np.clip(self.body.height, *self._statures)) - self.body.height
        if missing:
            heights = self.body.vertices[:, 1]
            taller = self._space.basis[:, heights.argmax(), 1] - self._space.basis[:, heights.argmin(), 1]
            easiest = linear.solved(matrix, taller)
            self._set(mean, change + easiest * (missing / linear.dot(taller, easiest)))
        return self.body

    def _set(self, mean: np.ndarray, change: np.ndarray) -> None:
        limit = self._settings.limit
        self.coefficients = mean + np.clip(change, -limit, limit)
        self.body = self._space.body(self.coefficients)
