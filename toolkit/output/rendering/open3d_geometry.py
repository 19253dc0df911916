"""One frame of a run as geometry of Open3D: measured cloud, fitted bodies, skeletons, ground.

Everything is in the frame of the depth camera, metres: x right, y down, z forward.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from toolkit.body.skeleton import BONE_ROWS
from toolkit.output.rendering.style import ALARM, CARRYING, FLOOR, mesh_colors
from toolkit.sensing.camera import Camera
from toolkit.tracks import EMPTY
from toolkit.tracks.runs import Person

CONFIDENCE_COLORS: np.ndarray = np.array([ALARM, CARRYING, (60, 220, 90)], dtype=np.float64) / 255.0
"""Colours, RGB in [0, 1], of the confidences 0, 0.5 and 1: red, yellow, green."""


class Open3DFrame(NamedTuple):
    """One person in one frame, frame of the depth camera, metres.

    Attributes
    ----------
    cloud : `open3d.geometry.PointCloud`, all measured points of the frame, with the recording's colour if it has one
    mesh : `open3d.geometry.TriangleMesh`, the fitted body with normals; empty where the person is out of sight
    skeleton : `open3d.geometry.LineSet`, the 20 reported joints and the bones, coloured by confidence; empty likewise
    """

    cloud: Any
    mesh: Any
    skeleton: Any


def confidence_colors(confidence: np.ndarray) -> np.ndarray:
    """Return colours (..., 3), RGB in [0, 1], of confidences (...) in [0, 1]: red, yellow at 0.5, green at 1."""
    stops = np.linspace(0.0, 1.0, len(CONFIDENCE_COLORS))
    return np.stack([np.interp(confidence, stops, channel) for channel in CONFIDENCE_COLORS.T], axis=-1)


def cloud_geometry(depth_mm: np.ndarray, camera: Camera, color: np.ndarray | None = None) -> Any:
    """Return the `PointCloud` of a frame in the order of its pixels.

    Parameters
    ----------
    depth_mm : uint16 (H, W), millimetres, 0 = no measurement
    camera : camera of the image, lens distortion included
    color : uint8 (H, W, 3), or None for points of one colour
    """
    import open3d as o3d

    measured = depth_mm > 0
    z = depth_mm[measured] / 1000.0
    points = np.column_stack([camera.rays()[measured] * z[:, None], z])
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    if color is None:
        point_color = np.array([0.45, 0.48, 0.52])  # of points without a colour: darker than any skeleton
        cloud.paint_uniform_color(point_color)
    else:
        cloud.colors = o3d.utility.Vector3dVector(color[measured] / 255.0)
    return cloud


def body_geometries(people: Sequence[Person], frame: int) -> list[Any]:
    """Return the fitted body of each person in a frame as a `TriangleMesh`; empty for a person out of sight.

    One person is coloured by the subject's sides, several have a colour each, as in films.
    """
    import open3d as o3d

    meshes = []
    for person, colors in zip(people, mesh_colors([person.body for person in people]), strict=True):
        mesh = o3d.geometry.TriangleMesh()
        if person.track.state[frame] != EMPTY:
            vertices = person.body.vertex_positions(person.track.pose[frame]) @ person.R_level_camera
            mesh.vertices = o3d.utility.Vector3dVector(vertices)
            mesh.triangles = o3d.utility.Vector3iVector(np.asarray(person.body.faces, dtype=np.int32))
            mesh.vertex_colors = o3d.utility.Vector3dVector(colors / 255.0)
            mesh.compute_vertex_normals()
        meshes.append(mesh)
    return meshes


def wireframe(mesh: Any) -> Any:
    """Return the edges of a mesh as a `LineSet` in the colours of its vertices: a skeleton within it is seen.

    Without a graphics card a frame takes 0.2 s of the processor this way, and 4 s with a lit, transparent mesh.
    """
    import open3d as o3d

    lines = o3d.geometry.LineSet.create_from_triangle_mesh(mesh)
    if lines.has_lines():
        colors = np.asarray(mesh.vertex_colors)[np.asarray(lines.lines)].mean(axis=1)
        lines.colors = o3d.utility.Vector3dVector(colors)
    return lines


def skeleton_geometry(person: Person, frame: int) -> Any:
    """Return the skeleton of a person in a frame as a `LineSet`; bones are coloured by confidence."""
    import open3d as o3d

    lines = o3d.geometry.LineSet()
    track = person.track
    if track.state[frame] != EMPTY:
        lines.points = o3d.utility.Vector3dVector(track.joints[frame].astype(np.float64))
        lines.lines = o3d.utility.Vector2iVector(BONE_ROWS.astype(np.int32))
        colors = confidence_colors(track.confidence[frame][BONE_ROWS].mean(axis=1))
        lines.colors = o3d.utility.Vector3dVector(colors)
    return lines


def ground_geometry(pieces: np.ndarray, rotation: np.ndarray) -> Any:
    """Return pieces of lines (K, 2, 3), level frame, as a `LineSet`; `rotation` is R_level_camera."""
    import open3d as o3d

    lines = o3d.geometry.LineSet()
    lines.points = o3d.utility.Vector3dVector(pieces.reshape(-1, 3) @ rotation)
    lines.lines = o3d.utility.Vector2iVector(np.arange(2 * len(pieces), dtype=np.int32).reshape(-1, 2))
    lines.paint_uniform_color(np.array(FLOOR) / 255.0)
    return lines
