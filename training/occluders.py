"""What stands before people in recordings: desks and tables, chair backs, crates, door frames, other people."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from toolkit.body.shape import ShapeSpace
from toolkit.kernels.linear import rotated
from toolkit.simulation.mesh import BOX_FACES, Mesh

Draw = Callable[["Situation", np.random.Generator], list[Mesh]]


@dataclass(frozen=True, eq=False)
class Situation:
    """The person before whom something stands.

    root : (3,), metres, level frame; yaw : facing, radians; floor : metres, level frame; size : stature against 1.7 m;
    poses, space : for other people
    """

    root: np.ndarray
    yaw: float
    floor: float
    size: float
    poses: np.ndarray
    space: ShapeSpace


def box(centre: np.ndarray, size: tuple[float, float, float], yaw: float) -> Mesh:
    """Return a box of `size` (width, height, depth along x, y, z), metres, about its centre, turned by `yaw`."""
    corners = 0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = rotated(corners, np.array([[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]]))
    return Mesh(turned + centre, BOX_FACES)


def occluder_meshes(
    poses: np.ndarray,
    space: ShapeSpace,
    root: np.ndarray,
    yaw: float,
    vertices: np.ndarray,
    rng: np.random.Generator,
) -> list[Mesh]:
    """Return meshes that may hide a part of a person.

    Parameters
    ----------
    poses, space : canonical poses (N, P) and shapes of other people
    root : (3,), metres, level frame, where the person's root stands
    yaw : radians, the person's facing
    vertices : (V, 3), metres, the person's surface about the root
    """
    height = float(np.ptp(vertices[:, 1]))
    where = Situation(root, yaw, float(root[1] + vertices[:, 1].min()), np.clip(height / 1.6, 0.6, 1.1), poses, space)
    kinds: tuple[Draw, ...] = (_desk, _desk, _crate, _chair_back, _frame, _person, _person)
    return kinds[rng.integers(len(kinds))](where, rng)


def _ahead(yaw: float) -> np.ndarray:
    return np.array([np.sin(yaw), 0.0, np.cos(yaw)])


def _towards_camera(where: Situation) -> float:
    """Return the yaw of the horizontal direction from the person to the camera."""
    return float(np.arctan2(-where.root[0], -where.root[2]))


def _on_floor(where: Situation, place: np.ndarray, size: tuple[float, float, float], yaw: float) -> Mesh:
    return box(np.array([place[0], where.floor + 0.5 * size[1], place[2]]), size, yaw)


def _desk(where: Situation, rng: np.random.Generator) -> list[Mesh]:
    """Return a desk or table before the person, with or without a front panel; sometimes with a screen on it."""
    yaw = where.yaw + rng.normal(0.0, 0.15) if rng.random() < 0.7 else _towards_camera(where)
    deep, wide, high = rng.uniform(0.5, 0.9), rng.uniform(0.9, 1.9), where.size * rng.uniform(0.62, 0.85)
    near = where.root + (rng.uniform(0.12, 0.4) + 0.5 * deep) * _ahead(yaw)
    top = box(np.array([near[0], where.floor + high, near[2]]), (wide, 0.04, deep), yaw)
    meshes = [top]
    if rng.random() < 0.6:
        far = near + (0.5 * deep - 0.02) * _ahead(yaw)
        meshes.append(_on_floor(where, far, (wide, high, 0.03), yaw))
    if rng.random() < 0.3:
        place = near + 0.1 * _ahead(yaw) + rng.uniform(-0.3, 0.3) * _ahead(yaw + 0.5 * np.pi)
        high += rng.uniform(0.3, 0.45)
        meshes.append(box(np.array([place[0], where.floor + high - 0.18, place[2]]), (0.5, 0.33, 0.04), yaw))
    return meshes


def _crate(where: Situation, rng: np.random.Generator) -> list[Mesh]:
    """Return a crate, a sofa or a counter between the person and the camera."""
    yaw = _towards_camera(where)
    aside = rng.normal(0.0, 0.2) * _ahead(yaw + 0.5 * np.pi)
    place = where.root + rng.uniform(0.45, 0.8) * _ahead(yaw) + aside
    size = (rng.uniform(0.35, 1.6), where.size * rng.uniform(0.3, 1.15), rng.uniform(0.2, 0.5))
    return [_on_floor(where, place, size, yaw + rng.normal(0.0, 0.3))]


def _chair_back(where: Situation, rng: np.random.Generator) -> list[Mesh]:
    """Return the back of the chair that the person sits on, or of one that stands before the person."""
    own = rng.random() < 0.5
    yaw = where.yaw + np.pi if own else _towards_camera(where)
    place = where.root + (rng.uniform(0.2, 0.3) if own else rng.uniform(0.35, 0.6)) * _ahead(yaw)
    low, high = where.size * rng.uniform(0.4, 0.55), where.size * rng.uniform(0.8, 1.15)
    centre = np.array([place[0], where.floor + 0.5 * (low + high), place[2]])
    return [box(centre, (where.size * rng.uniform(0.38, 0.55), high - low, 0.05), yaw)]


def _frame(where: Situation, rng: np.random.Generator) -> list[Mesh]:
    """Return a pillar, a door or a curtain at the person's side, up to the ceiling."""
    yaw = _towards_camera(where)
    wide = rng.uniform(0.1, 0.8)
    side = (1.0 if rng.random() < 0.5 else -1.0) * (0.5 * wide + rng.uniform(-0.1, 0.25))
    place = where.root + rng.uniform(0.3, 0.8) * _ahead(yaw) + side * _ahead(yaw + 0.5 * np.pi)
    return [_on_floor(where, place, (wide, 2.5, 0.05), yaw)]


def _person(where: Situation, rng: np.random.Generator) -> list[Mesh]:
    """Return another person, before the person and at the side."""
    from toolkit.database.canonical import place

    other = where.space.body(np.clip(rng.normal(0.0, 0.9, where.space.size), -2.0, 2.0))
    yaw = _towards_camera(where)
    side = (1.0 if rng.random() < 0.5 else -1.0) * rng.uniform(0.1, 0.55)
    stands = where.root + rng.uniform(0.3, 0.8) * _ahead(yaw) + side * _ahead(yaw + 0.5 * np.pi)
    pose = place(where.poses[rng.integers(len(where.poses))], np.zeros(4), stands, rng.uniform(-np.pi, np.pi))
    vertices = other.vertex_positions(pose)
    vertices[:, 1] += where.floor - vertices[:, 1].min()
    return [Mesh(vertices, where.space.faces)]
