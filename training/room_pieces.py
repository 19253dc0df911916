"""Furniture and objects around simulated people."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.kernels.linear import times
from toolkit.simulation.mesh import moved
from training.interiors.pieces import BLACK, DARK, PLAIN, Part, Piece, shifted
from training.interiors.shapes import cushion, slab

TOUCHING = ("chair", "office_chair", "table", "desk", "shelf", "sofa", "curtain", "coat_stand", "column", "partition",
            "plant", "boxes", "bag", "floor_lamp", "stool", "door")  # fmt: skip
"""Kinds of furniture that stand beside people."""


def moved_up(
    piece: Piece, to: np.ndarray, gap: float, angle: float, yaw: float | None, rng: np.random.Generator
) -> Piece:
    """Place a piece with its nearest side `gap` metres from a place in the direction `angle`; `yaw` relative to it."""
    turn = angle + (rng.uniform(-np.pi, np.pi) if yaw is None else yaw + rng.normal(0.0, 0.15))
    standing = shifted(piece, yaw=turn)
    direction = np.array([np.sin(angle), 0.0, np.cos(angle)])
    near = min(float(times(part.mesh.vertices, direction).min()) for part in standing)
    place = to + (gap - near) * direction
    return shifted(standing, place[0], 0.0, place[2])


def held(joints: np.ndarray, rng: np.random.Generator) -> Piece:
    """Draw a box between the hands, a tablet in one of them, or a bag that hangs from it."""
    hands = joints[[skeleton.REPORTED.index(f"{side}_wrist") for side in ("left", "right")]]
    hand, yaw = hands[rng.integers(2)], rng.uniform(-np.pi, np.pi)
    kind = rng.integers(3)
    if kind == 0:
        size = rng.uniform((0.2, 0.12, 0.15), (0.5, 0.4, 0.4))
        mesh, at = slab((0.0, 0.0, 0.0), size), hands.mean(axis=0)
    elif kind == 1:
        mesh, at = (
            slab((0.0, 0.05, 0.0), (rng.uniform(0.15, 0.3), rng.uniform(0.2, 0.32), 0.02), rng.uniform(0, 1)),
            hand,
        )
    else:
        size = rng.uniform((0.2, 0.25, 0.1), (0.45, 0.5, 0.25))
        mesh, at = cushion((0.0, -0.5 * size[1] - 0.1, 0.0), size, rng, 0.1), hand
    return [Part(moved(mesh, at[0], at[1], at[2], yaw), float(rng.choice([PLAIN, DARK, BLACK])))]


def reflectances(body: Body, rng: np.random.Generator) -> np.ndarray:
    """Draw the reflectance (V,) of hair, skin, shirt and trousers; any but the skin may be nearly black."""
    hair, shirt, trousers = rng.choice([PLAIN, 0.35, DARK, BLACK], 3, p=[0.4, 0.25, 0.2, 0.15])
    names = np.array(skeleton.JOINT_NAMES)[body.part]
    legs = np.char.endswith(names, "hip") | np.char.endswith(names, "knee") | (names == "root")
    bare = np.char.endswith(names, "wrist") | (names == "cervical")
    out = np.where(legs, trousers, np.where(bare, PLAIN, shirt))
    top = (names == "cervical") & (body.vertices[:, 1] > np.quantile(body.vertices[names == "cervical", 1], 0.6))
    return np.where(top, hair, out)
