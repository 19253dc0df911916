"""Personal shape: coefficients of the shape space estimated from the recording itself, frame by frame.

The mesh is linear in the coefficients for a fixed pose, so each frame gives linear equations in them; they are summed
with a slow forgetting, because the pose that a frame was linearised at was itself fitted with an earlier shape.
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
    """Constants of the shape estimate.

    Attributes
    ----------
    seconds : how long what is seen of a person first takes part, and the first rows wait; 0 keeps the first body
    rate : frames per second of it that take part, at most: more say the same again
    prior : weight of the population's mean against one correspondence of one frame at 1 cm
    forgetting : factor on the equations of earlier frames, per frame: the first were fitted with a wrong shape
    limit : standard deviations that a coefficient may reach
    """

    seconds: float = 3.0
    rate: float = constant(15.0)
    prior: float = constant(3.0)
    forgetting: float = constant(0.97)
    limit: float = constant(3.0)


STEP = 0.25
"""Standard deviations: the finite difference of the mesh in each coefficient, in which it is linear."""
NOISE = 0.01
"""Metres: the residual that counts as one standard deviation."""


class ShapeEstimator:
    """Sums the equations of tracked frames and solves them for the body's coefficients.

    Parameters
    ----------
    body : before the first frame
    settings : see `ShapeSettings`
    placer, terms : place bodies before the camera, and tie their surface to a frame
    statures : metres, the least and the largest: of the bodies between them the likeliest is solved for
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
        """Take in a frame in which the present body was found in `pose` (P,); returns the new body.

        A frame of another camera brings its own `placer`.
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
        for k in range(len(self.coefficients)):
            changed = self.coefficients.copy()
            changed[k] += STEP
            moved = placer.place(paired.body(changed), pose, normals).vertices
            columns[:, k] = linear.dots(normals, moved - base) / STEP
        weight = weight / NOISE**2
        wanted = linear.times(columns, self.coefficients) - linear.dots(normals, residual)
        forget = self._settings.forgetting
        self._matrix = forget * self._matrix + linear.gram(columns, weight)
        self._vector = forget * self._vector + linear.combined(weight * wanted, columns)
        matrix = self._matrix + self._settings.prior * np.eye(len(self.coefficients))
        # Toddlers are no small adults: the mean that they are drawn to, and may deviate from, is that of their size.
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
