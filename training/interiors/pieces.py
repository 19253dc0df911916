"""Random furniture: chairs with coats and bags, desks with screens, shelves, lamps, plants, curtains.

Every piece is a function of a random generator and stands on the floor about the origin, its front towards +z. Glass
and black surfaces reflect little infrared light; each part has a reflectance.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from toolkit.simulation.mesh import Mesh, box, joined, moved
from training.interiors.shapes import cloth, cushion, post, slab, turned_profile

GLASS, BLACK, DARK, PLAIN = 0.0, 0.04, 0.15, 0.6
"""Reflectances of surfaces in infrared light."""


class Part(NamedTuple):
    """Surface of one material: `reflectance` is the reflected fraction of infrared light, 0 to 1."""

    mesh: Mesh
    reflectance: float


Piece = list[Part]
Maker = Callable[[np.random.Generator], Piece]


def shifted(piece: Piece, x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Piece:
    """Return the piece rotated by `yaw` (radians, about +y from +z) and then moved, metres."""
    return [Part(moved(part.mesh, x, y, z, yaw), part.reflectance) for part in piece]


def _surface(rng: np.random.Generator) -> float:
    """Draw the reflectance of cloth, wood or plastic, sometimes nearly black."""
    return float(rng.choice([PLAIN, 0.4, DARK, BLACK], p=[0.5, 0.25, 0.17, 0.08]))


def _legs(width: float, depth: float, high: float, thick: float = 0.04) -> Mesh:
    x, z = 0.5 * width - thick, 0.5 * depth - thick
    return joined(
        [box((a, 0.0, b), (a + thick, high, b + thick)) for a in (-0.5 * width, x) for b in (-0.5 * depth, z)]
    )


def coat(rng: np.random.Generator, high: float) -> Piece:
    """Return a coat or jacket that hangs from `high` metres: about as wide as shoulders, sometimes with sleeves."""
    long, wide, reflectance = rng.uniform(0.55, 1.05), rng.uniform(0.34, 0.52), _surface(rng)
    low = max(high - long, 0.1)
    meshes = [cushion((0.0, 0.5 * (low + high), 0.0), (wide, high - low, rng.uniform(0.1, 0.24)), rng)]
    if rng.random() < 0.5:
        for side in (-1.0, 1.0):
            arm = cushion((side * 0.52 * wide, high - 0.34, 0.0), (0.12, 0.6, 0.13), rng)
            meshes.append(arm)
    return [Part(joined(meshes), reflectance)]


def bag(rng: np.random.Generator) -> Piece:
    """Return a bag or rucksack on the floor."""
    size = (rng.uniform(0.25, 0.5), rng.uniform(0.28, 0.52), rng.uniform(0.14, 0.28))
    return [Part(cushion((0.0, 0.5 * size[1], 0.0), size, rng, 0.1), _surface(rng))]


def _dressed_back(rng: np.random.Generator, seat: float, top: float, wide: float, behind: float) -> Piece:
    """Return the objects on a chair: a coat over the back, a bag or a cushion on the seat, often nothing."""
    piece: Piece = []
    if rng.random() < 0.3:
        low = rng.uniform(0.15, seat)
        hung = cushion((0.0, 0.5 * (low + top) + 0.04, behind), (wide + 0.08, top - low + 0.1, 0.17), rng, 0.1)
        piece.append(Part(hung, _surface(rng)))
        if rng.random() < 0.4:  # higher than the back, at the height of shoulders and collar
            piece.append(Part(cushion((0.0, top + 0.06, behind), (0.3, 0.2, 0.16), rng, 0.1), _surface(rng)))
    if rng.random() < 0.25:
        piece += shifted(bag(rng), y=seat, z=0.02, yaw=rng.uniform(-0.6, 0.6))
    return piece


def chair(rng: np.random.Generator, seat: float | None = None) -> Piece:
    """Return a chair on four legs; `seat` is its height in metres, for a sitter with the hips above the origin."""
    seat = rng.uniform(0.42, 0.5) if seat is None else seat
    wide, deep, top = rng.uniform(0.38, 0.5), rng.uniform(0.38, 0.48), seat + rng.uniform(0.32, 0.55)
    reflectance, lean = _surface(rng), rng.uniform(0.0, 0.25)
    behind = -0.5 * deep - 0.05
    low = seat + rng.uniform(0.0, 0.2)
    meshes = [
        slab((0.0, seat - 0.025, 0.0), (wide, 0.05, deep)),
        slab((0.0, 0.5 * (low + top), behind), (wide, top - low, 0.035), lean),
        _legs(wide, deep, seat - 0.05, 0.03),
    ]
    if rng.random() < 0.3:
        for side in (-0.5, 0.5):
            meshes.append(slab((side * wide, seat + 0.21, 0.0), (0.045, 0.035, deep)))
            meshes.append(box((side * wide - 0.02, seat, 0.1), (side * wide + 0.02, seat + 0.2, 0.14)))
    return [Part(joined(meshes), reflectance), *_dressed_back(rng, seat, top, wide, behind)]


def office_chair(rng: np.random.Generator, seat: float | None = None) -> Piece:
    """Return a padded swivel chair on five feet, often with arms and a head rest; `seat` as of `chair`."""
    seat = rng.uniform(0.42, 0.54) if seat is None else seat
    wide, top, lean = rng.uniform(0.42, 0.54), seat + rng.uniform(0.45, 0.75), rng.uniform(0.0, 0.3)
    reflectance = float(rng.choice([PLAIN, 0.35, DARK, BLACK], p=[0.25, 0.3, 0.25, 0.2]))
    meshes = [
        cushion((0.0, seat - 0.05, 0.0), (wide, 0.12, 0.5), rng, 0.03),
        cushion((0.0, 0.5 * (seat + 0.08 + top), -0.29), (wide - 0.04, top - seat - 0.04, 0.1), rng, 0.04),
        post(0.03, 0.1, seat - 0.08),
    ]
    meshes[1] = Mesh(_leant(meshes[1].vertices, seat, lean), meshes[1].faces)
    for k in range(5):
        meshes.append(moved(box((-0.025, 0.05, 0.0), (0.025, 0.1, 0.3)), yaw=2.0 * np.pi * k / 5))
    if rng.random() < 0.6:
        for side in (-0.5, 0.5):
            meshes.append(slab((side * (wide + 0.06), seat + 0.22, -0.02), (0.06, 0.035, 0.26)))
            meshes.append(slab((side * (wide + 0.06), seat + 0.1, -0.1), (0.04, 0.22, 0.05)))
    if rng.random() < 0.25:
        head = cushion((0.0, top + 0.12, -0.3), (0.28, 0.17, 0.09), rng, 0.03)
        meshes.append(Mesh(_leant(head.vertices, seat, lean), head.faces))
    return [Part(joined(meshes), reflectance), *_dressed_back(rng, seat, top, wide, -0.32 - 0.5 * np.sin(lean))]


def _leant(vertices: np.ndarray, pivot: float, lean: float) -> np.ndarray:
    """Return the vertices sheared backwards above the height `pivot` by `lean` radians."""
    out = vertices.copy()
    out[:, 2] -= np.maximum(vertices[:, 1] - pivot, 0.0) * np.tan(lean)
    return out


def stool(rng: np.random.Generator, seat: float | None = None) -> Piece:
    """Return a stool on one post, sometimes as high as a bar stool."""
    if seat is None:
        seat = rng.uniform(0.42, 0.52) if rng.random() < 0.7 else rng.uniform(0.65, 0.8)
    radius = rng.uniform(0.15, 0.2)
    round_top = turned_profile((radius, radius, 0.9 * radius), (seat - 0.07, seat - 0.02, seat), 10)
    return [Part(joined([round_top, post(0.03, 0.02, seat - 0.06), post(0.2, 0.0, 0.03, 10)]), _surface(rng))]


def table(rng: np.random.Generator) -> Piece:
    """Return a square or long table with a few objects on it."""
    wide, deep, high = rng.uniform(0.7, 1.8), rng.uniform(0.6, 0.95), rng.uniform(0.68, 0.78)
    top = [slab((0.0, high - 0.02, 0.0), (wide, 0.04, deep)), _legs(wide - 0.06, deep - 0.06, high - 0.04)]
    return [Part(joined(top), _surface(rng)), *_things(rng, wide, deep, high, 3)]


def _things(rng: np.random.Generator, wide: float, deep: float, high: float, most: int) -> Piece:
    """Return books, bottles, boxes, bags and vases on a top at the height `high`."""
    piece: Piece = []
    for _ in range(rng.integers(0, most + 1)):
        x, z = rng.uniform(-0.42, 0.42) * wide, rng.uniform(-0.4, 0.4) * deep
        kind = rng.integers(4)
        if kind == 0:
            size = rng.uniform((0.1, 0.02, 0.1), (0.35, 0.25, 0.3))
            mesh = box(-0.5 * size * (1, 0, 1), size * (0.5, 1.0, 0.5))
        elif kind == 1:
            mesh = turned_profile((0.04, 0.04, 0.015, 0.015), (0.0, 0.18, 0.22, rng.uniform(0.25, 0.33)))
        elif kind == 2:
            size = rng.uniform((0.2, 0.15, 0.12), (0.4, 0.35, 0.25))
            mesh = cushion((0.0, 0.5 * size[1], 0.0), size, rng, 0.1)
        else:
            radius = rng.uniform(0.06, 0.12)  # a vase, a globe, a helmet: round, similar to a head
            mesh = turned_profile(
                (0.4 * radius, 0.9 * radius, radius, 0.75 * radius, 0.2 * radius),
                (0.0, 0.5 * radius, radius, 1.6 * radius, 2.0 * radius),
            )
        piece += shifted([Part(mesh, _surface(rng))], x, high, z, rng.uniform(-3.0, 3.0))
    return piece


def desk(rng: np.random.Generator) -> Piece:
    """Return a desk with an optional front panel, drawers, and screens that face -z, the side of its chair."""
    wide, deep = rng.uniform(1.1, 1.8), rng.uniform(0.6, 0.85)
    high = rng.uniform(0.7, 0.77) if rng.random() < 0.85 else rng.uniform(0.9, 1.15)
    meshes = [slab((0.0, high - 0.015, 0.0), (wide, 0.03, deep))]
    if rng.random() < 0.5:
        meshes.append(box((-0.5 * wide, 0.2 * high, 0.5 * deep - 0.04), (0.5 * wide, high - 0.03, 0.5 * deep - 0.02)))
    if rng.random() < 0.5:
        meshes.append(box((0.5 * wide - 0.45, 0.05, -0.5 * deep + 0.02), (0.5 * wide - 0.03, high - 0.05, 0.45 * deep)))
    meshes.append(_legs(wide, deep, high - 0.03))
    piece = [Part(joined(meshes), _surface(rng))]
    for k in range(rng.integers(0, 3)):
        piece += shifted(
            _screen(rng), (-0.25 + 0.5 * k) * min(wide, 1.2), high, 0.12 * deep, np.pi + rng.normal(0, 0.2)
        )
    if rng.random() < 0.3:
        piece += shifted(_desk_lamp(rng), rng.uniform(-0.4, 0.4) * wide, high, 0.3 * deep, rng.uniform(-3.0, 3.0))
    return piece + _things(rng, wide, deep, high, 3)


def _screen(rng: np.random.Generator) -> Piece:
    """Return a monitor on its foot; its glass, towards +z, reflects no light, its black case little."""
    wide, tall, foot = rng.uniform(0.42, 0.7), rng.uniform(0.28, 0.4), rng.uniform(0.1, 0.2)
    case = joined(
        [slab((0.0, foot + 0.5 * tall, 0.0), (wide, tall, 0.05)), box((-0.04, 0, -0.04), (0.04, foot, -0.01))]
    )
    base = slab((0.0, 0.01, -0.02), (0.22, 0.02, 0.18))
    face = slab((0.0, foot + 0.5 * tall, 0.03), (wide - 0.03, tall - 0.03, 0.005))
    dark = float(rng.choice([BLACK, DARK, PLAIN], p=[0.4, 0.35, 0.25]))
    return [Part(joined([case, base]), dark), Part(face, GLASS if rng.random() < 0.5 else DARK)]


def _desk_lamp(rng: np.random.Generator) -> Piece:
    high = rng.uniform(0.3, 0.5)
    shade = moved(turned_profile((0.08, 0.03), (high - 0.1, high)), x=0.12)
    return [Part(joined([post(0.012, 0.0, high), post(0.08, 0.0, 0.02), shade]), _surface(rng))]


def shelf(rng: np.random.Generator) -> Piece:
    """Return an open shelf with books and boxes, or a closed cupboard."""
    wide, deep, high = rng.uniform(0.5, 1.2), rng.uniform(0.28, 0.5), rng.uniform(0.8, 2.1)
    if rng.random() < 0.4:
        closed = box((-0.5 * wide, 0.0, -0.5 * deep), (0.5 * wide, high, 0.5 * deep))
        return [Part(closed, _surface(rng)), *_things(rng, wide, deep, high, 2)]
    sides = [box((x, 0.0, -0.5 * deep), (x + 0.025, high, 0.5 * deep)) for x in (-0.5 * wide, 0.5 * wide - 0.025)]
    back = box((-0.5 * wide, 0.0, -0.5 * deep), (0.5 * wide, high, -0.5 * deep + 0.015))
    boards, full = [], []
    levels = np.linspace(0.06, high - 0.02, max(2, int(high / 0.36) + 1))
    for low, top in zip(levels[:-1], levels[1:], strict=True):
        boards.append(slab((0.0, low, 0.0), (wide, 0.025, deep)))
        x = -0.5 * wide + 0.03
        while x < 0.5 * wide - 0.15:
            size = rng.uniform(0.08, 0.3)
            if rng.random() < 0.75:
                end = min(x + size, 0.5 * wide - 0.03)
                tall = low + rng.uniform(0.4, 0.9) * (top - low)
                full.append(box((x, low, -0.4 * deep), (end, tall, rng.uniform(0.1, 0.45) * deep)))
            x += size
    boards.append(slab((0.0, high, 0.0), (wide, 0.025, deep)))
    piece, reflectance = [Part(joined([*sides, back, *boards]), _surface(rng))], _surface(rng)
    return [*piece, Part(joined(full), reflectance)] if full else piece


def sofa(rng: np.random.Generator) -> Piece:
    """Return a sofa or an armchair with cushions."""
    wide, deep, seat = (
        rng.choice([0.65, 1.5, 2.0]) * rng.uniform(0.9, 1.1),
        rng.uniform(0.55, 0.7),
        rng.uniform(0.36, 0.46),
    )
    top = seat + rng.uniform(0.35, 0.5)
    meshes = [
        cushion((0.0, 0.5 * seat, 0.0), (wide, seat, deep + 0.1), rng, 0.02),
        cushion((0.0, 0.5 * (seat + top) - 0.05, -0.5 * deep), (wide, top - seat + 0.15, 0.24), rng, 0.03),
    ]
    for side in (-0.5, 0.5):
        meshes.append(cushion((side * (wide + 0.15), 0.32, 0.0), (0.2, 0.64, deep + 0.2), rng, 0.03))
    piece = [Part(joined(meshes), _surface(rng))]
    for _ in range(rng.integers(0, 4)):
        size = rng.uniform((0.3, 0.3, 0.12), (0.5, 0.5, 0.22))
        place = (rng.uniform(-0.4, 0.4) * wide, seat + 0.5 * size[1], rng.uniform(-0.25, 0.1))
        piece.append(Part(cushion(place, size, rng, 0.1), _surface(rng)))
    return piece


def floor_lamp(rng: np.random.Generator) -> Piece:
    """Return a lamp as tall as a person, its shade at the height of a head."""
    high, radius = rng.uniform(1.3, 1.9), rng.uniform(0.09, 0.24)
    shade = turned_profile((radius, rng.uniform(0.5, 1.0) * radius), (high - rng.uniform(0.18, 0.35), high), 10)
    return [Part(joined([post(0.015, 0.0, high), post(0.14, 0.0, 0.025, 10)]), DARK), Part(shade, _surface(rng))]


def plant(rng: np.random.Generator) -> Piece:
    """Return a pot with leaves, from knee height to above the head."""
    high, radius = rng.uniform(0.5, 2.0), rng.uniform(0.1, 0.2)
    pot = rng.uniform(0.2, 0.4)
    meshes = [turned_profile((0.75 * radius, radius), (0.0, pot), 8), post(0.015, pot, 0.7 * high)]
    for _ in range(rng.integers(6, 18)):
        size = rng.uniform(0.08, 0.35)
        angle, up = rng.uniform(-np.pi, np.pi), rng.uniform(pot, high)
        out = rng.uniform(0.05, 0.3) * (0.5 + 0.5 * high)
        leaf = slab((0.0, 0.0, 0.0), (0.4 * size, 0.01, size), rng.uniform(-1.2, 1.2))
        meshes.append(moved(leaf, out * np.sin(angle), up, out * np.cos(angle), angle))
    return [Part(joined(meshes), 0.5)]


def coat_stand(rng: np.random.Generator) -> Piece:
    """Return a stand with one to four coats and sometimes a hat, the furniture most similar to a standing person."""
    high = rng.uniform(1.55, 1.9)
    piece = [Part(joined([post(0.025, 0.0, high), post(0.2, 0.0, 0.03, 8)]), _surface(rng))]
    for _ in range(rng.integers(1, 5)):
        angle = rng.uniform(-np.pi, np.pi)
        hung = coat(rng, high - rng.uniform(0.05, 0.2))
        piece += shifted(hung, 0.12 * np.sin(angle), 0.0, 0.12 * np.cos(angle), angle + rng.normal(0.0, 0.4))
    if rng.random() < 0.4:
        hat = turned_profile((0.14, 0.1, 0.09, 0.03), (high - 0.05, high - 0.03, high + 0.08, high + 0.1))
        piece.append(Part(hat, _surface(rng)))
    return piece


def curtain(rng: np.random.Generator) -> Piece:
    """Return a curtain from above the head nearly to the floor."""
    return [
        Part(cloth(rng.uniform(0.3, 1.6), rng.uniform(0.02, 0.3), 2.3, rng, rng.uniform(0.02, 0.08)), _surface(rng))
    ]


def window(rng: np.random.Generator) -> Piece:
    """Return a window: glass in a frame, sometimes with a radiator below."""
    wide, low, high = rng.uniform(0.8, 1.8), rng.uniform(0.7, 1.0), rng.uniform(1.9, 2.3)
    half = 0.5 * wide
    frame = [box((-half, y, 0.0), (half, y + 0.06, 0.05)) for y in (low, high)]
    frame += [box((x, low, 0.0), (x + 0.06, high, 0.05)) for x in (-half, half - 0.06)]
    pane = slab((0.0, 0.5 * (low + high), 0.02), (wide, high - low, 0.01))
    piece = [Part(joined(frame), PLAIN), Part(pane, GLASS)]
    if rng.random() < 0.5:
        piece.append(Part(box((-0.4 * wide, 0.12, 0.0), (0.4 * wide, low - 0.1, 0.1)), PLAIN))
    return piece


def door(rng: np.random.Generator) -> Piece:
    """Return a door in its frame, closed or open into the room."""
    wide = rng.uniform(0.75, 0.95)
    frame = [box((x, 0.0, 0.0), (x + 0.07, 2.1, 0.06)) for x in (-0.5 * wide - 0.07, 0.5 * wide)]
    frame.append(box((-0.5 * wide - 0.07, 2.03, 0.0), (0.5 * wide + 0.07, 2.1, 0.06)))
    leaf = joined([box((0.0, 0.02, 0.0), (wide, 2.02, 0.04)), slab((wide - 0.08, 1.02, 0.06), (0.12, 0.02, 0.03))])
    opened = moved(leaf, -0.5 * wide, 0.0, 0.02, -rng.uniform(0.4, 1.6) if rng.random() < 0.4 else 0.0)
    return [Part(joined(frame), _surface(rng)), Part(opened, GLASS if rng.random() < 0.1 else _surface(rng))]


def board(rng: np.random.Generator) -> Piece:
    """Return a whiteboard, a picture or a flat screen on the wall."""
    wide, tall, middle = rng.uniform(0.5, 2.4), rng.uniform(0.4, 1.1), rng.uniform(1.2, 1.7)
    return [Part(slab((0.0, middle, 0.03), (wide, tall, 0.04)), float(rng.choice([PLAIN, DARK, BLACK])))]


def hooks(rng: np.random.Generator) -> Piece:
    """Return a row of hooks on the wall with coats and bags."""
    wide, high = rng.uniform(0.5, 1.6), rng.uniform(1.4, 1.75)
    piece = [Part(slab((0.0, high, 0.02), (wide, 0.1, 0.03)), PLAIN)]
    for x in np.arange(-0.5 * wide + 0.1, 0.5 * wide, rng.uniform(0.22, 0.5)):
        if rng.random() < 0.6:
            piece += shifted(coat(rng, high - rng.uniform(0.0, 0.1)), x=float(x), z=0.12, yaw=rng.normal(0.0, 0.3))
    return piece


def _bin(rng: np.random.Generator) -> Piece:
    """Return a waste bin, a bucket or a drum."""
    radius, high = rng.uniform(0.12, 0.25), rng.uniform(0.3, 0.85)
    return [Part(turned_profile((0.8 * radius, radius), (0.0, high), 10), _surface(rng))]


def boxes(rng: np.random.Generator) -> Piece:
    """Return one to four cardboard boxes in a stack."""
    piece, low = [], 0.0
    for _ in range(rng.integers(1, 5)):
        size = rng.uniform((0.25, 0.15, 0.2), (0.6, 0.45, 0.5))
        mesh = moved(box(-0.5 * size * (1, 0, 1), size * (0.5, 1.0, 0.5)), 0.0, low, 0.0, rng.uniform(-0.4, 0.4))
        piece.append(Part(mesh, PLAIN))
        low += size[1]
    return piece


def partition(rng: np.random.Generator) -> Piece:
    """Return a screen between desks, a flip chart or a clothes rack."""
    wide, high = rng.uniform(0.6, 1.6), rng.uniform(1.1, 1.8)
    low = rng.uniform(0.05, 0.9)
    meshes = [slab((0.0, 0.5 * (low + high), 0.0), (wide, high - low, 0.05), rng.uniform(0.0, 0.15))]
    meshes += [moved(box((-0.02, 0.0, -0.25), (0.02, 0.04, 0.25)), x=x) for x in (-0.4 * wide, 0.4 * wide)]
    meshes += [box((x - 0.02, 0.0, -0.02), (x + 0.02, high, 0.02)) for x in (-0.4 * wide, 0.4 * wide)]
    return [Part(joined(meshes), _surface(rng))]


def column(rng: np.random.Generator) -> Piece:
    """Return a pillar, a fridge or a locker."""
    if rng.random() < 0.4:
        return [Part(post(rng.uniform(0.1, 0.3), 0.0, 2.6, 10), PLAIN)]
    size = rng.uniform((0.35, 1.2, 0.35), (0.7, 2.0, 0.7))
    return [Part(box(-0.5 * size * (1, 0, 1), size * (0.5, 1.0, 0.5)), _surface(rng))]


PIECES: dict[str, Maker] = {
    "chair": chair, "office_chair": office_chair, "stool": stool, "table": table, "desk": desk, "shelf": shelf,
    "sofa": sofa, "floor_lamp": floor_lamp, "plant": plant, "coat_stand": coat_stand, "curtain": curtain,
    "window": window, "door": door, "board": board, "hooks": hooks, "bin": _bin, "boxes": boxes, "bag": bag,
    "partition": partition, "column": column,
}  # fmt: skip
"""Functions of all kinds of furniture, by name."""
SEATS = ("chair", "office_chair", "stool")
"""Kinds whose functions take the height of the seat."""
