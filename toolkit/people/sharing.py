"""Seeds of the segmentation: pixels near a predicted body, of a visible head, or of a torso that did not move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from toolkit.kernels.image import raster, sharing
from toolkit.kernels.image.growth import mark_seeds
from toolkit.people.detection import SEED_RADIUS
from toolkit.people.sighting import PredictedBody
from toolkit.people.view import CoarseCamera, View

BODY_GATE = 0.12
"""Maximum distance from a measured point to the surface of its body, metres."""


def body_seeds(view: View, coarse: CoarseCamera, bodies: Mapping[int, PredictedBody], seeds: np.ndarray) -> None:
    """Give each foreground pixel to the body whose expected surface is nearest, within `BODY_GATE`.

    All bodies are drawn into one z-buffer, so that an occluded body claims no pixel of the one before it.

    Parameters
    ----------
    bodies : by the number that `seeds` int32 (h, w) shall hold; only entries that are 0 are filled
    """
    intrinsics = coarse.camera.intrinsics
    nearest, owner = np.zeros(view.depth.shape), np.zeros(view.depth.shape, dtype=np.int32)
    inverse_depth, triangle = np.empty(view.depth.shape), np.empty(view.depth.shape, dtype=np.int32)
    for number, body in bodies.items():
        vertices = np.ascontiguousarray(body.vertices, dtype=np.float64)
        projected = np.empty_like(vertices)
        raster.project(vertices, intrinsics, projected)
        raster.rasterise(projected, np.ascontiguousarray(body.faces, dtype=np.int64), inverse_depth, triangle)
        sharing.draw_body(inverse_depth, number, nearest, owner)
    sharing.nearest_owner(view.depth, view.foreground, nearest, owner, intrinsics, BODY_GATE, seeds)


def stayed_seeds(view: View, stayed: np.ndarray, places: Sequence[np.ndarray], seeds: np.ndarray) -> None:
    """Mark heads, and torsos that stayed where they were, with 1, 2, ... in `seeds` int32 (h, w) where it is 0.

    Parameters
    ----------
    stayed : int32 (h, w), label of a pixel in the previous frame, where its surface did not move; 0 = none
    places : (3,) each, where the heads are or are expected, level frame, metres

    Limbs are segmented again in every frame, so that no mistake outlasts the contact that caused it.
    """
    rows = np.array(places, dtype=np.float64).reshape(-1, 3)
    torso = 0.25  # horizontal radius around the head's axis, metres, that keeps its label between frames
    mark_seeds(view.points, view.foreground, stayed, rows, SEED_RADIUS, torso, seeds)
