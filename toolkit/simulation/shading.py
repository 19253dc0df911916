"""Shaded pictures of coloured meshes: z-buffer, smooth normals, three lights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.body.body import vertex_normals
from toolkit.kernels.image import raster
from toolkit.sensing.camera import Camera
from toolkit.simulation.mesh import Mesh, joined


def visible(mesh: Mesh, camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the projected vertices (V, 3), u, v, 1/z, and the inverse depth (H, W), 0 without a surface, and triangle
    (H, W), -1 without one, of the surface of a mesh in the frame of an undistorted camera.
    """
    projected = np.empty((len(mesh.vertices), 3))
    raster.project(np.ascontiguousarray(mesh.vertices), camera.intrinsics, projected)
    inverse_depth, triangle = np.empty(camera.shape), np.empty(camera.shape, dtype=np.int32)
    raster.rasterise(projected, np.ascontiguousarray(mesh.faces, dtype=np.int64), inverse_depth, triangle)
    return projected, inverse_depth, triangle


def draw(
    image: np.ndarray,
    meshes: Sequence[Mesh],
    camera: Camera,
    lights: np.ndarray,
    key: np.ndarray,
    behind: np.ndarray | None = None,
) -> None:
    """Draw coloured meshes, frame of an undistorted camera, over an RGB image, uint8 (H, W, 3).

    Parameters
    ----------
    lights, key : see `shaded`
    behind : float (H, W), depth in metres that hides what is behind it
    """
    if not meshes:
        return
    mesh = joined(meshes)
    projected, inverse, triangles = visible(mesh, camera)
    seen = triangles >= 0 if behind is None else inverse * behind > 1.0
    v, u = np.nonzero(seen)
    corners = projected[mesh.faces[triangles[seen]]]
    (u1, v1), (u2, v2) = ((corners[:, k, :2] - corners[:, 0, :2]).T for k in (1, 2))
    u0, v0 = u - corners[:, 0, 0], v - corners[:, 0, 1]
    # Shares of the second and third corner in the image, then on the surface.
    scale = 1.0 / ((u1 * v2 - v1 * u2) * inverse[seen])
    uvs = np.column_stack([
        (u0 * v2 - v0 * u2) * scale * corners[:, 1, 2], (u1 * v0 - v1 * u0) * scale * corners[:, 2, 2]
    ])  # fmt: skip
    image[seen] = shaded(mesh, triangles[seen], uvs, camera.rays()[seen], lights, key)


def shaded(
    mesh: Mesh,
    triangles: np.ndarray,
    uvs: np.ndarray,
    slopes: np.ndarray,
    lights: np.ndarray,
    key: np.ndarray,
    lit: np.ndarray | float = 1.0,
) -> np.ndarray:
    """Return the colours of pixels of a coloured mesh, RGB 0 to 255, float32 (N, 3).

    Parameters
    ----------
    triangles, uvs : int (N,) and (N, 2), triangle of a pixel, and shares of its second and third corner
    slopes : (N, 2), x/z and y/z of the ray of a pixel
    lights : (3,), weights of ambient light, key light and a light at the camera
    key : (3,), unit direction to the key light, frame of the mesh
    lit : (N,), share of the key light that reaches a pixel
    """
    assert mesh.colors is not None
    corners = mesh.faces[triangles]
    values = np.concatenate([vertex_normals(mesh.vertices, mesh.faces), mesh.colors], axis=1, dtype=np.float32)
    first, second, third = (values[corners[:, k]] for k in range(3))
    uvs = uvs.astype(np.float32)
    mixed = first + uvs[:, :1] * (second - first) + uvs[:, 1:] * (third - first)
    normals, colors = mixed[:, :3].T, mixed[:, 3:]
    x, y = slopes.T
    length = np.sqrt((normals**2).sum(axis=0)) + 1e-12
    from_key = np.maximum(normals[0] * key[0] + normals[1] * key[1] + normals[2] * key[2], 0.0)
    from_head = np.maximum(-normals[0] * x - normals[1] * y - normals[2], 0.0) / np.sqrt(x * x + y * y + 1.0)
    light = lights[0] + (lights[1] * lit * from_key + lights[2] * from_head) / length
    return np.minimum(colors * light[:, None].astype(np.float32), 255.0)
