"""Meshes of furniture: slabs, posts, cushions, sheets of cloth; on a floor plan, y up, metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.kernels.linear import rotated
from toolkit.simulation.mesh import BOX_FACES, Mesh, Vector, box


def slab(centre: Vector, size: Vector, lean: float = 0.0) -> Mesh:
    """Return a box of `size` (x, y, z) about `centre`, tilted backwards from +z by `lean` radians."""
    half = 0.5 * np.asarray(size)
    cosine, sine = np.cos(lean), np.sin(lean)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]])
    return Mesh(rotated(box(-half, half).vertices, turn.T) + centre, BOX_FACES)


def turned_profile(radii: Sequence[float], heights: Sequence[float], sides: int = 8) -> Mesh:
    """Return a body of revolution about the y axis: `radii` at rising `heights`, closed at both ends."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.zeros(sides), -np.sin(angle)], axis=1)
    vertices = [r * ring + [0.0, h, 0.0] for r, h in zip(radii, heights, strict=True)]
    vertices.append(np.array([[0.0, heights[0], 0.0], [0.0, heights[-1], 0.0]]))
    faces = []
    here, there = np.arange(sides), (np.arange(sides) + 1) % sides
    for level in range(len(radii) - 1):
        a, b = level * sides + here, level * sides + there
        faces += [np.stack([a, b, b + sides], axis=1), np.stack([a, b + sides, a + sides], axis=1)]
    bottom, top = len(radii) * sides, len(radii) * sides + 1
    last = (len(radii) - 1) * sides
    faces += [
        np.stack([np.full(sides, bottom), there, here], axis=1),
        np.stack([np.full(sides, top), last + here, last + there], axis=1),
    ]
    return Mesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int32))


def post(radius: float, low: float, high: float, sides: int = 6) -> Mesh:
    """Return an upright round post about the y axis."""
    return turned_profile((radius, radius), (low, high), sides)


def _soft_box() -> Mesh:
    """Return a rounded box of edge 2 about the origin: 6 x 16 vertices; the sides do not share vertices."""
    grid = np.linspace(-1.0, 1.0, 4)
    u, v = np.meshgrid(grid, grid, indexing="ij")
    cells = np.array([4 * i + j for i in range(3) for j in range(3)])
    square = np.stack([cells, cells + 4, cells + 5, cells + 1], axis=1)
    vertices, quads = [], []
    for number, (axis, side) in enumerate((axis, side) for axis in range(3) for side in (-1.0, 1.0)):
        plane = np.empty((16, 3))
        plane[:, axis], plane[:, (axis + 1) % 3], plane[:, (axis + 2) % 3] = side, u.ravel(), v.ravel()
        vertices.append(plane)
        quads.append(16 * number + (square if side > 0 else square[:, ::-1]))
    points, four = np.concatenate(vertices), np.concatenate(quads)
    points = points * (0.45 + 0.66 / np.linalg.norm(points, axis=1, keepdims=True))
    return Mesh(points, np.concatenate([four[:, [0, 1, 2]], four[:, [0, 2, 3]]]).astype(np.int32))


_SOFT_BOX = _soft_box()


def cushion(centre: Vector, size: Vector, rng: np.random.Generator, rough: float = 0.08) -> Mesh:
    """Return a soft object of `size` (x, y, z): a rounded box with dents of the fraction `rough` of its size."""
    points = _SOFT_BOX.vertices
    # Dents depend only on the position, so that the sides stay connected.
    waves = rotated(points, rng.uniform(-2.0, 2.0, (3, 3)))
    dents = np.sin(waves + rng.uniform(0.0, 6.0, 3)).sum(axis=1, keepdims=True)
    return Mesh(points * (0.5 * (1.0 + rough * dents)) * np.asarray(size) + centre, _SOFT_BOX.faces)


def cloth(width: float, low: float, high: float, rng: np.random.Generator, folds: float = 0.05) -> Mesh:
    """Return a hanging sheet in the plane z = 0 about x = 0 with folds of a depth in metres, visible from both
    sides.
    """
    columns = max(4, int(width / 0.06))
    x = np.linspace(-0.5 * width, 0.5 * width, columns)
    phase, count = rng.uniform(0.0, 6.0), rng.uniform(5.0, 12.0)
    depth = folds * np.sin(phase + 2.0 * np.pi * count * np.linspace(0.0, 1.0, columns) * width / 1.5)
    top = np.stack([x, np.full(columns, high), 0.5 * depth], axis=1)
    bottom = np.stack([x * rng.uniform(0.9, 1.05), np.full(columns, low), depth], axis=1)
    first = np.arange(columns - 1)
    quads = np.stack([first + columns, first + columns + 1, first + 1, first], axis=1)
    quads = np.concatenate([quads, quads[:, ::-1]])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    return Mesh(np.concatenate([top, bottom]), triangles)
