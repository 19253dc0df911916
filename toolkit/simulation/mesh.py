"""Meshes of boxes on a floor plan, y up, metres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from toolkit.kernels.linear import rotated

Vector = Sequence[float] | np.ndarray


class Mesh(NamedTuple):
    """Vertices float64 (V, 3), metres, outward triangles int32 (F, 3), and colours of vertices (V, 3), RGB 0 to 255."""

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray | None = None


_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
BOX_FACES: np.ndarray = np.array([(q[i], q[j], q[k]) for i, j, k in ((0, 1, 2), (0, 2, 3)) for q in _QUADS], np.int32)
"""Triangles of the eight corners of a box; the last coordinate changes fastest."""
_BITS: np.ndarray = np.array([[k >> 2 & 1, k >> 1 & 1, k & 1] for k in range(8)])


def box(low: Vector, high: Vector) -> Mesh:
    """Return an upright box between its lowest and highest corner."""
    return Mesh(np.where(_BITS == 0, low, high).astype(np.float64), BOX_FACES)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return all meshes as one; an empty mesh for none."""
    if not meshes:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)])
    colors = [mesh.colors for mesh in meshes if mesh.colors is not None]
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    return Mesh(vertices, faces.astype(np.int32), np.concatenate(colors) if colors else None)


def moved(mesh: Mesh, x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Mesh:
    """Return the mesh rotated by `yaw` (radians, about +y from +z) and then moved."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    return Mesh(rotated(mesh.vertices, turn.T) + [x, y, z], mesh.faces)
