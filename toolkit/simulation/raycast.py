"""Depth images by Open3D's ray caster, without OpenGL and display.

Rays pass through pixel centres at integer coordinates (Open3D's own pinhole rays pass through u + 0.5) with direction
`(x/z, y/z, 1)`, so that the distance along a ray is the depth along z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.body.body import Body
from toolkit.sensing.camera import Camera


@dataclass(frozen=True)
class Hits:
    """Visible surface of each pixel.

    Attributes
    ----------
    depth : float32 (H, W), metres along z, 0 without a hit
    triangles : int32 (H, W), index of the triangle, -1 without a hit
    normals : float32 (H, W, 3), unit normals of the triangles in the camera frame, 0 without a hit
    uvs : float32 (H, W, 2), barycentric coordinates of the second and the third corner in the triangle
    """

    depth: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray


def cast(vertices_camera: np.ndarray, faces: np.ndarray, camera: Camera) -> Hits:
    """Return the nearest surface of a mesh along every pixel's ray.

    Parameters
    ----------
    vertices_camera : (V, 3), metres, camera frame; parts behind the camera are ignored
    faces : int (F, 3)
    camera : camera, lens distortion included
    """
    from open3d.core import Tensor

    hits = Hits(
        np.zeros(camera.shape, dtype=np.float32),
        np.full(camera.shape, -1, dtype=np.int32),
        np.zeros((*camera.shape, 3), dtype=np.float32),
        np.zeros((*camera.shape, 2), dtype=np.float32),
    )
    slopes = camera.rays()
    window = window_of(vertices_camera, camera)
    seen = slopes[window]
    if seen.size == 0:
        return hits
    rays = np.zeros((*seen.shape[:2], 6), dtype=np.float32)
    rays[..., 3:5], rays[..., 5] = seen, 1.0
    answer = scene_of(vertices_camera, faces).cast_rays(Tensor.from_numpy(rays))
    distance = answer["t_hit"].numpy()
    hit = np.isfinite(distance)
    hits.depth[window] = np.where(hit, distance, 0.0)
    hits.triangles[window] = np.where(hit, answer["primitive_ids"].numpy().astype(np.int64), -1)
    normals = answer["primitive_normals"].numpy()
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    hits.normals[window] = np.where(hit[..., None], normals / np.maximum(length, 1e-12), 0.0)
    hits.uvs[window] = answer["primitive_uvs"].numpy()
    return hits


def scene_of(vertices: np.ndarray, faces: np.ndarray) -> Any:
    """Return a mesh as a `RaycastingScene`."""
    from open3d.core import Tensor
    from open3d.t.geometry import RaycastingScene

    scene = RaycastingScene()
    scene.add_triangles(Tensor.from_numpy(vertices.astype(np.float32)), Tensor.from_numpy(faces.astype(np.uint32)))
    return scene


def render_depth(body: Body, pose_level: np.ndarray, camera: Camera, R_level_camera: np.ndarray) -> np.ndarray:  # noqa: N803
    """Return the depth image of a body: float32 (H, W), metres along z, 0 without a hit.

    Parameters
    ----------
    pose_level : float (P,), pose in the level frame (y up along gravity, origin at the camera)
    R_level_camera : float (3, 3), rotation from the camera frame to the level frame

    Raises
    ------
    BodyError
        The pose has a wrong length or is not finite.
    """
    return cast(body.vertex_positions(pose_level) @ R_level_camera, body.faces, camera).depth


def window_of(vertices_camera: np.ndarray, camera: Camera) -> tuple[slice, slice]:
    """Return rows and columns that may see the mesh: all for a vertex beside the camera or a distorted lens."""
    if not len(vertices_camera):
        return slice(0, 0), slice(0, 0)
    if camera.distortion is not None or (vertices_camera[:, 2] <= 0.01).any():
        return slice(0, camera.height), slice(0, camera.width)
    pixels = camera.project(vertices_camera)
    limit = (camera.width, camera.height)
    low = np.clip(np.floor(pixels.min(axis=0)), 0, limit).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 1, 0, limit).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])
