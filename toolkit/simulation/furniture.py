"""Furniture of upright boxes beside a person."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from toolkit.io.errors import UsageError
from toolkit.simulation.mesh import Mesh, box, joined, moved

SEAT_HEIGHT = 0.26
"""Height of a seat over the sitter's stature: 0.45 m for an adult of 1.75 m, less for a child."""


class Box(NamedTuple):
    """Upright box with lowest and highest corner (x, y, z), metres, y = 0 on the floor."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]


def chair(seat: float) -> tuple[Box, ...]:
    """Return a chair with a seat `seat` metres high, for a person with the hips above the origin who faces +z."""
    return (
        Box((-0.22, seat - 0.05, -0.20), (0.22, seat, 0.26)),
        Box((-0.22, seat, -0.25), (0.22, seat + 0.45, -0.20)),
        *_legs(0.22, (-0.25, 0.26), seat - 0.05),
    )


def stool(seat: float) -> tuple[Box, ...]:
    """Return a stool on one post, as `chair`."""
    return (
        Box((-0.17, seat - 0.04, -0.17), (0.17, seat, 0.17)),
        Box((-0.03, 0.03, -0.03), (0.03, seat - 0.04, 0.03)),
        Box((-0.2, 0.0, -0.2), (0.2, 0.03, 0.2)),
    )


def table(height: float) -> tuple[Box, ...]:
    """Return a table `height` metres high, from the origin towards +z."""
    return (
        Box((-0.7, height - 0.04, 0.0), (0.7, height, 0.7)),
        *_legs(0.7, (0.0, 0.7), height - 0.04),
    )


def desk(height: float) -> tuple[Box, ...]:
    """Return a table with a front panel and a screen at the far left."""
    return (
        *table(height),
        Box((-0.66, 0.3 * height, 0.62), (0.66, height - 0.04, 0.65)),
        Box((0.3, height, 0.5), (0.65, height + 0.28, 0.54)),
    )


def crate(height: float) -> tuple[Box, ...]:
    """Return a crate as high as a table, from the origin towards +z."""
    return (Box((-0.3, 0.0, 0.0), (0.3, height, 0.4)),)


def _legs(half: float, depth: tuple[float, float], height: float) -> tuple[Box, ...]:
    """Return four legs 4 cm thick below the corners of a top `2 half` wide."""
    near, far = depth
    return tuple(
        Box((x, 0.0, z), (x + 0.04, height, z + 0.04)) for x in (-half, half - 0.04) for z in (near, far - 0.04)
    )


SEATS = {"chair": chair, "stool": stool}
"""Seats as functions of the seat height."""
OBSTACLES = {"desk": desk, "table": table, "crate": crate}
"""Obstacles in front of a person as functions of their height."""
HEIGHTS = {"desk": 0.42, "table": 0.42, "crate": 0.33}
"""Heights of obstacles over the stature of their person."""


def check_kinds(kinds: Sequence[str]) -> tuple[str, ...]:
    """Return the kinds of furniture unchanged.

    Raises
    ------
    UsageError
        A kind is unknown.
    """
    known = (*SEATS, *OBSTACLES)
    for kind in kinds:
        if kind not in known:
            raise UsageError(f"no furniture is called {kind!r}; use {', '.join(known)}")
    return tuple(kinds)


def boxes_mesh(boxes: Sequence[Box], yaw: float = 0.0, at: tuple[float, float] = (0.0, 0.0)) -> Mesh:
    """Return boxes rotated by `yaw` (radians, about +y from +z) and moved to `at` (x, z), as one mesh."""
    return moved(joined([box(low, high) for low, high in boxes]), at[0], 0.0, at[1], yaw)
