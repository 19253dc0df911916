"""The tracker's mesh: a closed, even, mirror-symmetric surface of about 1,200 vertices on MakeHuman's skin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

CELL = 0.006
"""Voxel size of the closed surface, metres."""
GAP = 0.022
"""Closing radius, metres: narrower gaps are closed, which merges fingers and toes."""
FLESH = 0.012
"""Offset of the surface during remeshing, metres, because coarse triangles would shrink thin hands and toes."""
NEAREST = 12
"""Number of skin vertices per vertex of the tracker's mesh."""
Surface = tuple[np.ndarray, np.ndarray]
"""Vertices (V, 3) and triangles (F, 3)."""
REGIONS: tuple[tuple[str, tuple[float, ...]], ...] = (
    ("(x0>-1)", (0.010, 0.014, 0.018, 0.022, 0.026)),
    ("(x0<=0.42)", (0.029, 0.032, 0.034)),
    ("(x0<=0.32)&&(y0>=-0.58)", (0.037, 0.041, 0.045, 0.049, 0.049)),
)
"""Edge lengths (metres), in coarser steps: everything; all but the hand; all but hand, forearm, ankle and foot.

Regions are in the A-pose of the average adult, in pymeshlab's syntax for the first corner of a face. Thin parts need
shorter edges; hands and feet are the hardest parts to track.
"""


@dataclass(frozen=True)
class TrackerMesh:
    """Faces int32 (F, 3) and carriers: row v of `index` (V, 12), `share` (V, 12) defines vertex v by skin vertices.

    `mirror` int64 (V,) names the mirror image of each vertex.
    """

    faces: np.ndarray
    index: np.ndarray
    share: np.ndarray
    mirror: np.ndarray

    def carry(self, values: np.ndarray) -> np.ndarray:
        """Return values of the skin (13380, C) on the mesh (V, C)."""
        return np.einsum("vk,vkc->vc", self.share, values[self.index])


def tracker_mesh(skin_a: np.ndarray, faces: np.ndarray) -> TrackerMesh:
    """Remesh the A-pose skin (13380, 3): close gaps between fingers, halve, coarsen evenly, mirror, bind to the
    skin."""
    half, half_faces = _coarse_half(*_closed(skin_a, faces))
    middle = np.flatnonzero(half[:, 0] == 0.0)
    count = len(half)
    mirrored = np.full(count, -1)
    mirrored[middle] = middle
    others = np.flatnonzero(mirrored < 0)
    mirrored[others] = count + np.arange(len(others))
    all_faces = np.concatenate([half_faces, mirrored[half_faces][:, ::-1]]).astype(np.int32)
    mirror = np.concatenate([mirrored, others])

    index, share = _affine_shares(half, skin_a)
    twin = cKDTree(skin_a).query(skin_a * (-1, 1, 1))[1]
    return TrackerMesh(
        faces=all_faces,
        index=np.concatenate([index, twin[index[others]]]),
        share=np.concatenate([share, share[others]]),
        mirror=mirror,
    )


def _closed(vertices: np.ndarray, faces: np.ndarray) -> tuple[Surface, Surface]:
    """Return the outer surface after morphological closing on a voxel grid, offset by FLESH, and without offset."""
    import pymeshlab

    surfaces = []
    meshes = _mesh_set(vertices, faces)
    for offset in (GAP, FLESH - GAP, -FLESH):
        meshes.generate_resampled_uniform_mesh(
            cellsize=pymeshlab.PureValue(CELL), offset=pymeshlab.PureValue(offset), mergeclosevert=True
        )
        meshes.meshing_remove_connected_component_by_face_number(mincomponentsize=3000)
        mesh = meshes.current_mesh()
        surfaces.append((mesh.vertex_matrix(), mesh.face_matrix()))
    return surfaces[1], surfaces[2]


def _coarse_half(grown: Surface, true: Surface) -> Surface:
    """Remesh the half x >= 0 with isotropic triangles, projected onto the fine surface in each step against
    shrinking."""
    import open3d as o3d
    import pymeshlab

    whole = o3d.t.geometry.TriangleMesh(o3d.core.Tensor(grown[0]), o3d.core.Tensor(grown[1].astype(np.int64)))
    half = whole.clip_plane([0, 0, 0], [1, 0, 0])
    meshes = _mesh_set(half.vertex.positions.numpy().astype(float), half.triangle.indices.numpy())
    meshes.meshing_remove_duplicate_vertices()
    meshes.meshing_merge_close_vertices(threshold=pymeshlab.PureValue(1e-5))
    for region, lengths in REGIONS:
        for length in lengths:
            meshes.compute_selection_by_condition_per_face(condselect=region)
            meshes.meshing_isotropic_explicit_remeshing(
                iterations=3, targetlen=pymeshlab.PureValue(length), selectedonly=True, checksurfdist=False,
                featuredeg=180,
            )  # fmt: skip
            triangles = meshes.current_mesh().face_matrix()
            meshes = _mesh_set(_drawn_onto(grown, meshes.current_mesh().vertex_matrix(), triangles), triangles)
    return _drawn_onto(true, meshes.current_mesh().vertex_matrix(), triangles), triangles


def _drawn_onto(surface: Surface, points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Project points onto a surface; the border of the half mesh stays on the plane x = 0, all others off it."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(surface[0].astype(np.float32)), o3d.core.Tensor(surface[1].astype(np.uint32)))
    nearest = scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))["points"].numpy().astype(float)
    nearest[:, 0] = np.maximum(nearest[:, 0], 1e-4)
    nearest[_border(faces), 0] = 0.0
    return nearest


def _mesh_set(vertices: np.ndarray, faces: np.ndarray) -> Any:
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    return meshes


def _border(faces: np.ndarray) -> np.ndarray:
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(unique[count == 1])


def _affine_shares(points: np.ndarray, skin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return weights (V, 12) of the nearest skin vertices that sum to 1 and reproduce each point exactly.

    Among them the smoothest (decreasing with distance) are returned, so that a point in a closed gap depends on both
    fingers, and morph targets and weights transfer smoothly.
    """
    distance, index = cKDTree(skin).query(points, k=NEAREST)
    smooth = np.exp(-((distance / distance[:, -1:]) ** 2) * 2.0)
    smooth /= smooth.sum(axis=1, keepdims=True)
    near = skin[index]
    share = np.empty_like(smooth)
    for v, (start, base) in enumerate(zip(smooth, near, strict=True)):
        rows = np.concatenate([base.T - points[v][:, None], np.ones((1, NEAREST))])
        wanted = np.array([0.0, 0.0, 0.0, 1.0])
        share[v] = start + np.linalg.pinv(rows, rcond=1e-3) @ (wanted - rows @ start)
        share[v] /= share[v].sum()
    return index, share
