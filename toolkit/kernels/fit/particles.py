"""Cost of particles for a depth image, and resampling, compiled (Lopez-Mendez 2011, 2.1)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from toolkit.kernels.fit.swarm import Buffers, Figure, View, draw, place
from toolkit.kernels.kinematics import carry


class Tile(NamedTuple):
    """Image window of a layer, and its weights.

    window : int64 (4,), rows v0 to v1 and columns u0 to u1, ends excluded, within the image
    depth, silhouette : weights of the two terms (`lambda_1`, `lambda_2`) of a pixel
    """

    window: np.ndarray
    depth: float
    silhouette: float


class Contacts(NamedTuple):
    """Balls of a body that must not overlap (`c_p`).

    joint, offset, radius : int64 (B,), float64 (B, 3) and (B,), see `fitting.placed.Balls`
    pairs : int64 (K, 2), balls that a pose can bring together
    soft : fraction of the sum of both radii at which balls start to overlap
    weight : weight of a squared overlap in units of that sum (`lambda_3`)
    """

    joint: np.ndarray
    offset: np.ndarray
    radius: np.ndarray
    pairs: np.ndarray
    soft: float
    weight: float


@njit(cache=True)
def particle_costs(
    poses: np.ndarray, figure: Figure, view: View, contacts: Contacts, tile: Tile, buffers: Buffers, costs: np.ndarray
) -> None:
    """Compute the costs of `poses` (N, P), level frame (Eq. 3): fills `costs` (N,).

    The capped squared depth difference of a measured pixel is relative to that of `View.clamp`, which is also the cost
    without the figure; the silhouette term counts pixels in exactly one silhouette. Unobserved pixels have no cost.
    """
    centres = np.empty(contacts.offset.shape)
    for n in range(poses.shape[0]):
        place(poses[n], figure, view, buffers)
        draw(figure, view, buffers)
        carry(contacts.joint, contacts.offset, buffers.rotations, buffers.origins, centres)
        costs[n] = picture_cost(buffers.inverse, view, tile) + contacts.weight * _overlap(centres, contacts)


@njit(cache=True)
def picture_cost(inverse: np.ndarray, view: View, tile: Tile) -> float:
    """Return the cost of a drawn picture, inverse depth (H, W), 0 in the background, within the tile's window."""
    total = 0.0
    for v in range(tile.window[0], tile.window[1]):
        for u in range(tile.window[2], tile.window[3]):
            seen, w = view.depth[v, u], inverse[v, u]
            if seen > 0.0 and w > 0.0:
                gap = min(abs(1.0 / w - seen) / view.clamp, 1.0)
                total += tile.depth * gap * gap
            elif seen > 0.0:
                total += tile.depth + tile.silhouette
            elif seen == 0.0 and w > 0.0:
                total += tile.silhouette
    return total


@njit(cache=True)
def _overlap(centres: np.ndarray, contacts: Contacts) -> float:
    """Return the sum of the squared overlaps of balls at `centres` (B, 3)."""
    total = 0.0
    for k in range(contacts.pairs.shape[0]):
        i, j = contacts.pairs[k, 0], contacts.pairs[k, 1]
        dx, dy, dz = centres[i, 0] - centres[j, 0], centres[i, 1] - centres[j, 1], centres[i, 2] - centres[j, 2]
        apart = np.sqrt(dx * dx + dy * dy + dz * dz) / (contacts.radius[i] + contacts.radius[j])
        total += max(contacts.soft - apart, 0.0) ** 2
    return total


@njit(cache=True)
def systematic(weights: np.ndarray, shift: float, chosen: np.ndarray) -> None:
    """Resample systematically: fills `chosen` (M,) with rows of `weights` (N,), which sum to 1, rising.

    `shift` in [0, 1) is the one random number. A row of weight w is chosen floor(M w) or ceil(M w) times.
    """
    count = chosen.shape[0]
    row = 0
    reached = weights[0]
    for k in range(count):
        while reached * count <= k + shift and row < weights.shape[0] - 1:
            row += 1
            reached += weights[row]
        chosen[k] = row
