"""Geometry of clothes: garments that hang from the body and garments that stand off it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.errors import UsageError


class Skirt(NamedTuple):
    """Skirt with the level of its hem (0 hips, 1 knees, 2 ankles) and its flare at the hem over stature."""

    hem: float
    flare: float


class Shell(NamedTuple):
    """Cloth at a distance in metres from the skin of some joints."""

    joints: tuple[str, ...]
    distance: float


TRUNK = ("root", "lumbar", "thorax", "left_clavicle", "right_clavicle")
SLEEVES = ("left_shoulder", "right_shoulder", "left_elbow", "right_elbow")
LEGS = ("left_hip", "right_hip", "left_knee", "right_knee")

GARMENTS: dict[str, tuple[Skirt | Shell, ...]] = {
    "skirt": (Skirt(0.9, 0.045),),
    "dress": (Skirt(1.6, 0.07), Shell(TRUNK, 0.012)),
    "coat": (Skirt(0.8, 0.03), Shell(TRUNK, 0.035), Shell(SLEEVES, 0.025)),
    "wide_trousers": (Shell(LEGS, 0.04),),
}
"""Garments by name."""


def dressed(body: Body, garments: Sequence[str]) -> Body:
    """Return the body in clothes: skin below a shell is moved outwards, skirts are added as vertices.

    Joints and end effectors do not change.

    Raises
    ------
    UsageError
        A garment is unknown.
    """
    for name in garments:
        if name not in GARMENTS:
            raise UsageError(f"no garment is called {name!r}; use one of {', '.join(GARMENTS)}")
    parts = [part for name in garments for part in GARMENTS[name]]
    for shell in (part for part in parts if isinstance(part, Shell)):
        body = _with_shell(body, shell)
    for skirt in (part for part in parts if isinstance(part, Skirt)):
        body = _with_skirt(body, skirt)
    return body


def _with_shell(body: Body, shell: Shell) -> Body:
    carriers = [skeleton.JOINT_NAMES.index(name) for name in shell.joints]
    covered = (body.skin_weights * np.isin(body.skin_joints, carriers)).sum(axis=1)
    return replace(body, vertices=body.vertices + shell.distance * covered[:, None] * body.normals)


def _with_skirt(body: Body, skirt: Skirt) -> Body:
    """Add a lofted tube around both legs, open below; its middle follows both legs equally."""
    waist = 0.06 * body.height
    levels = [waist, 0.0, _height_of(body, "knee"), _height_of(body, "ankle")]
    around, along = 48, 16  # vertices of each ring, and rings from waist to hem
    heights = np.interp(np.linspace(-1.0, skirt.hem, along), [-1.0, 0.0, 1.0, 2.0], levels)
    angles = np.linspace(0.0, 2 * np.pi, around, endpoint=False)
    rings = [_ring(body, height, angles) for height in heights]
    for i in range(1, along):
        if heights[i] < levels[1]:  # below the hips cloth hangs vertically
            rings[i] = np.maximum(rings[i], rings[i - 1])
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    below = np.clip((levels[1] - heights) / (levels[1] - heights[-1]), 0.0, 1.0)
    loose = 0.012  # metres between a skirt and the skin below it
    radii = np.array(rings) + loose + skirt.flare * body.height * below[:, None]
    plan = radii[..., None] * directions
    vertices = np.stack([plan[..., 0], np.broadcast_to(heights[:, None], radii.shape), plan[..., 1]], axis=-1)
    joints, weights = _hanging(body, vertices.reshape(-1, 3))
    start, width = len(body.vertices), body.skin_joints.shape[1]
    pad = ((0, 0), (0, width - joints.shape[1]))
    return replace(
        body,
        vertices=np.concatenate([body.vertices, vertices.reshape(-1, 3)]),
        faces=np.concatenate([body.faces, (_tube(along, around) + start).astype(body.faces.dtype)]),
        skin_joints=np.concatenate([body.skin_joints, np.pad(joints, pad)]),
        skin_weights=np.concatenate([body.skin_weights, np.pad(weights, pad)]),
    )


def _height_of(body: Body, joint: str) -> float:
    return float(body.joints[skeleton.JOINT_NAMES.index(f"left_{joint}"), 1])


def _ring(body: Body, height: float, angles: np.ndarray) -> np.ndarray:
    """Return the extent of trunk and legs in directions (N,), radians, at a height of the rest pose: (N,), metres."""
    carriers = [skeleton.JOINT_NAMES.index(name) for name in (*TRUNK[:2], *LEGS)]
    near = np.isin(body.part, carriers) & (np.abs(body.vertices[:, 1] - height) < 0.02 * body.height)
    directions = np.stack([np.cos(angles), np.sin(angles)])
    support = (body.vertices[near][:, [0, 2]] @ directions).max(axis=0, initial=0.05)
    # From the support function h to the radius of the hull along each direction: min over h(b) / cos(b - a).
    cosines = np.cos(angles[:, None] - angles)
    return np.where(cosines > 0.1, support / np.maximum(cosines, 0.1), np.inf).min(axis=1)


def _hanging(body: Body, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return joints and weights (V, 4) of cloth: the root above the hips, the thighs below, each on its side."""
    names = ("root", "left_hip", "right_hip")
    carriers = np.array([skeleton.JOINT_NAMES.index(name) for name in names])
    share = np.clip(0.3 - vertices[:, 1] / (0.12 * body.height), 0.0, 1.0)  # of the legs
    left = np.clip(0.5 + vertices[:, 0] / (0.16 * body.height), 0.0, 1.0)
    weights = np.stack([1.0 - share, share * left, share * (1.0 - left)], axis=1)
    return np.tile(carriers, (len(vertices), 1)), weights


def _tube(rings: int, around: int) -> np.ndarray:
    """Return the triangles between neighbouring rings."""
    ring, side = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = ring * around + side, ring * around + (side + 1) % around
    c, d = a + around, b + around
    return np.concatenate([np.stack([a, b, d], axis=-1), np.stack([a, d, c], axis=-1)]).reshape(-1, 3)
