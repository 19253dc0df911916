"""A mesh of few vertices out of a body's own: what is drawn where many poses are tried (Qammaz, 2.1)."""

from __future__ import annotations

import heapq

import numpy as np

FEW = 360
"""Vertices: a third of the body's; hands and feet lose most, which a small image does not show."""
FLATTEST = 0.2
"""Cosine between the normals of a triangle before and after: a surface is not folded."""


def simplified(vertices: np.ndarray, faces: np.ndarray, count: int = FEW) -> np.ndarray:
    """Triangles int64 (G, 3) of a coarser closed surface that uses `count` of the vertices (V, 3), or as few as it can.

    The shortest edge is collapsed onto one of its ends, again and again, wherever the surface stays one, does not fold
    and both ends have two common neighbours. Vertices stay where they are, so that skinning weights hold.
    """
    triangles = {k: [int(v) for v in face] for k, face in enumerate(faces)}
    around: list[set[int]] = [set() for _ in vertices]
    for k, face in triangles.items():
        for v in face:
            around[v].add(k)
    waiting = [_edge(vertices, face[i], face[i - 1]) for face in triangles.values() for i in range(3)]
    heapq.heapify(waiting)
    left = sum(bool(near) for near in around)
    while left > count and waiting:
        _, kept, gone = heapq.heappop(waiting)
        if not _collapses(vertices, triangles, around, kept, gone):
            continue
        for k in around[gone] & around[kept]:
            for v in triangles.pop(k):
                around[v].discard(k)
        for k in around[gone]:
            triangles[k] = [kept if v == gone else v for v in triangles[k]]
        around[kept] |= around[gone]
        around[gone] = set()
        left -= 1
        for v in sorted(_neighbours(triangles, around, kept)):
            heapq.heappush(waiting, _edge(vertices, kept, v))
            heapq.heappush(waiting, _edge(vertices, v, kept))
    return np.array([triangles[k] for k in sorted(triangles)], dtype=np.int64)


def _edge(vertices: np.ndarray, kept: int, gone: int) -> tuple[float, int, int]:
    off = vertices[kept] - vertices[gone]
    return float((off * off).sum()), kept, gone


def _neighbours(triangles: dict[int, list[int]], around: list[set[int]], vertex: int) -> set[int]:
    return {v for k in around[vertex] for v in triangles[k]} - {vertex}


def _collapses(
    vertices: np.ndarray, triangles: dict[int, list[int]], around: list[set[int]], kept: int, gone: int
) -> bool:
    """Whether the edge is still there, and the surface stays a surface without it."""
    if len(around[kept] & around[gone]) != 2:
        return False
    common = _neighbours(triangles, around, kept) & _neighbours(triangles, around, gone)
    if len(common) != 2:
        return False
    for k in around[gone] - around[kept]:
        before = _normal(vertices[triangles[k]])
        after = _normal(vertices[[kept if v == gone else v for v in triangles[k]]])
        if (before * after).sum() < FLATTEST * np.sqrt((before * before).sum() * (after * after).sum()):
            return False
    return True


def _normal(corners: np.ndarray) -> np.ndarray:
    return np.cross(corners[1] - corners[0], corners[2] - corners[0])
