"""Randomly furnished rooms: offices, living rooms, classrooms, corridors.

A room has a floor plan: x to the right, y up from the floor, z towards the viewer, metres. Equal kinds and seeds give
equal rooms. The space of people and camera can be kept free.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from toolkit.io.errors import UsageError
from toolkit.kernels.linear import lengths
from toolkit.simulation.mesh import Mesh, joined
from toolkit.simulation.scene import RoomMaker
from training.interiors.pieces import PIECES, PLAIN, Piece, chair, desk, office_chair, shifted, table

FURNITURE_DISTANCE = 0.22
"""Metres from people's joints to the furniture of a room, which may touch their clothes."""
SIGHT = np.linspace(0.1, 1.0, 10)
"""Fractions of the line from the camera to the centre of the people that are kept free."""


class Standing(NamedTuple):
    """Placed piece: its kind, its parts, and the corners (2, 2) of its footprint, x and z, metres."""

    kind: str
    parts: Piece
    footprint: np.ndarray


class Surfaces(NamedTuple):
    """All surfaces of a room.

    mesh : faces outward from the furniture, inward from the walls
    reflectance : float32 (F,), reflected fraction of infrared light, 0 (glass) to 1
    piece : int32 (F,), number of the piece of furniture, -1 for floor, walls and ceiling
    """

    mesh: Mesh
    reflectance: np.ndarray
    piece: np.ndarray


@dataclass(frozen=True, eq=False)
class Room:
    """Furnished room.

    Attributes
    ----------
    kind : name of `KINDS`
    low, high : float64 (3,), corners of the empty room, metres, `low[1]` = 0
    standing : furniture
    finish : reflectance of floor, walls and ceiling
    """

    kind: str
    low: np.ndarray
    high: np.ndarray
    standing: tuple[Standing, ...]
    finish: tuple[float, float, float]

    @cached_property
    def _shell(self) -> list[Mesh]:
        return _shell(self.low, self.high)

    def surfaces(self, away_from: np.ndarray | None = None, clearance: float = 0.0) -> Surfaces:
        """Return all surfaces, without the pieces within `clearance` metres of points (N, 2), x and z."""
        pieces = self.standing
        if away_from is not None:
            pieces = tuple(p for p in pieces if _distance(p.footprint, away_from) >= clearance)
        parts = [part for piece in pieces for part in piece.parts]
        owners = [number for number, piece in enumerate(pieces) for _ in piece.parts]
        shells = self._shell
        finish = (self.finish[0], self.finish[2], *[self.finish[1]] * 4)
        meshes = [*shells, *(part.mesh for part in parts)]
        reflectance = [*finish, *(part.reflectance for part in parts)]
        counts = [len(mesh.faces) for mesh in meshes]
        return Surfaces(
            joined(meshes),
            np.repeat(np.array(reflectance, dtype=np.float32), counts),
            np.repeat(np.array([-1] * len(shells) + owners, dtype=np.int32), counts),
        )


def furnished(
    kind: str,
    rng: np.random.Generator,
    *,
    camera: tuple[float, float] | None = None,
    reach: np.ndarray | None = None,
    free: np.ndarray | None = None,
    clearance: float = 0.3,
) -> Room:
    """Return a randomly furnished room of a kind.

    Parameters
    ----------
    kind : name of `KINDS`
    rng : source of all randomness
    camera : x and z of a camera inside the room
    reach : (2, 3), lowest and highest corner of a space inside the room
    free : (N, 2), x and z of points at least `clearance` metres away from furniture

    Raises
    ------
    UsageError
        The kind is unknown.
    """
    if kind not in KINDS:
        raise UsageError(f"no room is called {kind!r}; use one of {', '.join(KINDS)}")
    plan = KINDS[kind]
    width, depth, height = rng.uniform(*plan.size)
    low, high = np.array([-0.5 * width, 0.0, -0.5 * depth]), np.array([0.5 * width, height, 0.5 * depth])
    needed = [] if reach is None else [np.asarray(reach) + [[-0.35, 0.0, -0.35], [0.35, 0.2, 0.35]]]
    if camera is not None:
        needed.append(np.array([[camera[0] - 0.4, 0.0, camera[1] - 0.3], [camera[0] + 0.4, 2.3, camera[1] + 0.3]]))
    if needed:
        # The required space determines the position; the rest of the size is split between both sides at random.
        least, most = np.min([n[0] for n in needed], axis=0), np.max([n[1] for n in needed], axis=0)
        spare = np.maximum([width, 0.0, depth] - (most - least), 0.0)
        share = rng.random(3)
        low = (least - share * spare) * (1, 0, 1)
        high = np.array([0.0, max(height, most[1]), 0.0]) + (most + (1.0 - share) * spare) * (1, 0, 1)
    camera_distance = 0.55  # metres, free distance around the camera
    occupied = [] if camera is None else [np.array(camera) + camera_distance * np.array([[-1, -1], [1, 1]])]
    standing: list[Standing] = []
    for name, piece in plan.furnish(low, high, rng):
        points = np.concatenate([part.mesh.vertices for part in piece])
        footprint = np.array([points[:, [0, 2]].min(axis=0), points[:, [0, 2]].max(axis=0)])
        inside = (footprint[0] >= low[[0, 2]] - 0.02).all() and (footprint[1] <= high[[0, 2]] + 0.02).all()
        apart = not any(_overlap(footprint, other) for other in (*occupied, *(s.footprint for s in standing)))
        clear = free is None or _distance(footprint, free) >= clearance
        if inside and apart and clear:
            standing.append(Standing(name, piece, footprint))
    finish = tuple(rng.uniform((0.12, 0.3, 0.4), (0.7, 0.8, 0.8)).tolist())
    return Room(kind, low, high, tuple(standing), finish)


def _overlap(first: np.ndarray, second: np.ndarray) -> bool:
    piece_distance = 0.03  # metres, smallest distance of two pieces of furniture
    return bool((first[0] < second[1] + piece_distance).all() and (second[0] < first[1] + piece_distance).all())


def _distance(footprint: np.ndarray, places: np.ndarray) -> float:
    """Return the smallest distance of points (N, 2) from a footprint (2, 2), metres; infinite without points."""
    if not len(places):
        return np.inf
    outside = np.maximum(np.maximum(footprint[0] - places, places - footprint[1]), 0.0)
    return float(np.hypot(*outside.T).min())


def _shell(low: np.ndarray, high: np.ndarray) -> list[Mesh]:
    """Return floor, ceiling and four walls of the empty room in tiles, faces inwards."""
    x, y, z = high - low
    sides = (
        (low, (x, 0, 0), (0, 0, z)), (low + [0, y, 0], (0, 0, z), (x, 0, 0)), (low, (0, y, 0), (x, 0, 0)),
        (high, (0, -y, 0), (-x, 0, 0)), (low, (0, 0, z), (0, y, 0)), (high, (0, 0, -z), (0, -y, 0)),
    )  # fmt: skip
    return [_tiles(np.asarray(corner), np.array(a, float), np.array(b, float)) for corner, a, b in sides]


def _tiles(corner: np.ndarray, first: np.ndarray, second: np.ndarray) -> Mesh:
    """Return a rectangle from a corner along two edges; its front has `second` to the right of `first`."""
    tile = 0.5  # metres, edge of the tiles of walls and floor; tiles beside the camera are not drawn
    rows, columns = (max(1, int(np.ceil(length / tile))) for length in lengths(np.stack([first, second])))
    a, b = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    vertices = corner + a.reshape(-1, 1) * first + b.reshape(-1, 1) * second
    cell = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    quads = np.stack([cell, cell + 1, cell + columns + 2, cell + columns + 1], axis=1)
    return Mesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32))


Furnisher = Callable[[np.ndarray, np.ndarray, np.random.Generator], Iterator[tuple[str, Piece]]]


class Furnishing(NamedTuple):
    """Furnishing of a kind of room: smallest and largest width, depth and height, metres, and a function."""

    size: tuple[tuple[float, float, float], tuple[float, float, float]]
    furnish: Furnisher


def _made(kinds: Sequence[str], rng: np.random.Generator) -> tuple[str, Piece]:
    """Return a piece of one of the kinds in `PIECES`."""
    kind = str(rng.choice(kinds))
    return kind, PIECES[kind](rng)


def _along_walls(
    low: np.ndarray, high: np.ndarray, kinds: Sequence[str], count: int, rng: np.random.Generator,
) -> Iterator[tuple[str, Piece]]:  # fmt: skip
    """Yield pieces with their backs to the walls; longer walls get more of them."""
    x, _, z = high - low
    for _ in range(count):
        made = _made(kinds, rng)
        depth = -min(part.mesh.vertices[:, 2].min() for part in made[1]) + 0.01
        wall = int(rng.choice(4, p=np.array([x, z, x, z]) / (2.0 * (x + z))))
        t = rng.random()
        place = (
            (low[0] + t * x, low[2] + depth), (low[0] + depth, low[2] + t * z),
            (low[0] + t * x, high[2] - depth), (high[0] - depth, low[2] + t * z),
        )[wall]  # fmt: skip
        yield made[0], shifted(made[1], place[0], 0.0, place[1], (0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi)[wall])


def _about(
    low: np.ndarray, high: np.ndarray, kinds: Sequence[str], count: int, rng: np.random.Generator,
) -> Iterator[tuple[str, Piece]]:  # fmt: skip
    """Yield pieces at random positions and angles."""
    for _ in range(count):
        made = _made(kinds, rng)
        x, _, z = rng.uniform(low, high)
        yield made[0], shifted(made[1], x, 0.0, z, rng.uniform(-np.pi, np.pi))


def _workplace(rng: np.random.Generator, *, school: bool = False) -> Piece:
    """Return a desk or table that faces +z with its chair, close to it or pushed back."""
    seats = (chair,) if school else (office_chair, office_chair, chair)
    piece = table(rng) if school else desk(rng)
    near = min(part.mesh.vertices[:, 2].min() for part in piece)
    if rng.random() < 0.9:
        seat = seats[rng.integers(len(seats))]
        aside, back = rng.normal(0.0, 0.12), near - rng.uniform(-0.05, 0.45)
        piece = [*piece, *shifted(seat(rng), aside, 0.0, back, rng.normal(0.0, 0.5))]
    return piece


def _dining(rng: np.random.Generator) -> Piece:
    """Return a table with chairs around it."""
    piece = table(rng)
    points = piece[0].mesh.vertices
    x, z = np.abs(points[:, 0]).max(), np.abs(points[:, 2]).max()
    for angle, out in ((0.0, z), (0.5 * np.pi, x), (np.pi, z), (-0.5 * np.pi, x)):
        if rng.random() < 0.7:
            reach = out + rng.uniform(0.15, 0.4)
            yaw = angle + np.pi + rng.normal(0.0, 0.2)
            piece = [*piece, *shifted(chair(rng), reach * np.sin(angle), 0.0, reach * np.cos(angle), yaw)]
    return piece


def _office(low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> Iterator[tuple[str, Piece]]:
    yield from _along_walls(low, high, ("window", "door", "board", "curtain", "hooks"), 5, rng)
    for _ in range(rng.integers(5, 12)):
        x, _, z = rng.uniform(low, high)
        yaw = 0.5 * np.pi * rng.integers(4) + rng.normal(0.0, 0.06)
        yield "workplace", shifted(_workplace(rng), x, 0.0, z, yaw)
    yield from _along_walls(low, high, ("shelf", "shelf", "plant", "bin", "coat_stand", "boxes"), 9, rng)
    spread = (
        "chair",
        "office_chair",
        "coat_stand",
        "plant",
        "partition",
        "boxes",
        "bag",
        "bin",
        "floor_lamp",
        "column",
    )
    yield from _about(low, high, spread, int(rng.integers(8, 22)), rng)


def _living(low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> Iterator[tuple[str, Piece]]:
    yield from _along_walls(low, high, ("window", "curtain", "curtain", "board", "door"), 7, rng)
    yield from _along_walls(low, high, ("sofa", "sofa", "shelf", "floor_lamp", "plant", "desk"), 12, rng)
    for _ in range(rng.integers(1, 4)):
        x, _, z = rng.uniform(low, high)
        yield "dining", shifted(_dining(rng), x, 0.0, z, rng.uniform(-np.pi, np.pi))
    spread = ("sofa", "table", "chair", "stool", "plant", "floor_lamp", "bag", "boxes", "coat_stand", "bin")
    yield from _about(low, high, spread, int(rng.integers(8, 18)), rng)


def _classroom(low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> Iterator[tuple[str, Piece]]:
    yield from _along_walls(low, high, ("board", "board", "window", "hooks", "door", "curtain"), 6, rng)
    yield from _along_walls(low, high, ("shelf", "bin", "coat_stand"), 3, rng)
    yaw = 0.5 * np.pi * rng.integers(4)
    step = rng.uniform((1.5, 1.4), (2.2, 1.8))
    for x in np.arange(low[0] + 1.0, high[0] - 0.7, step[0]):
        for z in np.arange(low[2] + 1.0, high[2] - 0.7, step[1]):
            if rng.random() < 0.75:
                place = np.array([x, z]) + rng.normal(0.0, 0.08, 2)
                piece = _workplace(rng, school=True)
                yield "school_desk", shifted(piece, place[0], 0.0, place[1], yaw + rng.normal(0.0, 0.06))
    yield from _about(low, high, ("chair", "chair", "bag", "bag", "partition", "boxes"), 10, rng)


def _corridor(low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> Iterator[tuple[str, Piece]]:
    yield from _along_walls(low, high, ("door", "door", "board", "window", "hooks"), 9, rng)
    spread = ("chair", "bin", "boxes", "plant", "shelf", "column", "coat_stand", "bag", "stool")
    yield from _along_walls(low, high, spread, 11, rng)


KINDS: dict[str, Furnishing] = {
    "office": Furnishing(((3.5, 4.0, 2.4), (7.0, 8.0, 3.2)), _office),
    "living": Furnishing(((3.2, 3.5, 2.3), (6.0, 7.0, 2.9)), _living),
    "classroom": Furnishing(((5.5, 6.0, 2.6), (9.0, 10.0, 3.4)), _classroom),
    "corridor": Furnishing(((1.6, 6.0, 2.4), (2.8, 12.0, 3.0)), _corridor),
}
"""Furnishings by name."""


def named_room(text: str) -> tuple[str, int]:
    """Return kind and seed of a text such as `office:7`; `office` alone has seed 0.

    Raises
    ------
    UsageError
        The kind is unknown, or the seed is no whole number from 0 on.
    """
    kind, _, seed = text.partition(":")
    if kind not in KINDS:
        raise UsageError(f"no room is called {kind!r}; use one of {', '.join(KINDS)}, and a seed such as {text}:7")
    if seed and not seed.isdecimal():
        raise UsageError(f"the room {text!r} has the seed {seed!r}; give a whole number from 0 on, such as {kind}:7")
    return kind, int(seed or 0)


def around_people(name: str) -> RoomMaker:
    """Return a function that makes a room around people, for `CaptureSettings.room`.

    Furniture stays `FURNITURE_DISTANCE` metres away from the people and from the line of sight of the camera.

    Parameters
    ----------
    name : kind and seed, see `named_room`

    Raises
    ------
    UsageError
        The name is invalid.
    """
    kind, seed = named_room(name)

    def made(points: np.ndarray, camera: np.ndarray) -> tuple[Mesh, np.ndarray]:
        reach = np.array([points.min(axis=0), points.max(axis=0)])
        reach[1, 1] = max(reach[1, 1], camera[1] + 0.1)
        own, eye = points[:, [0, 2]], camera[[0, 2]]
        sight = eye + SIGHT[:, None] * (own.mean(axis=0) - eye)
        free = np.concatenate([np.unique(np.round(own, 1), axis=0), sight])
        place, rng = (float(eye[0]), float(eye[1])), np.random.default_rng(seed)
        around = furnished(kind, rng, camera=place, reach=reach, free=free, clearance=FURNITURE_DISTANCE).surfaces()
        return around.mesh, around.reflectance / PLAIN

    return made
