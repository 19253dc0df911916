"""Appearance of simulated people: skin, hair, face and clothes as vertex colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body

Color = tuple[int, int, int]


def _palette(codes: str) -> tuple[Color, ...]:
    """Return the colours of hexadecimal RGB codes."""
    return tuple((int(code[:2], 16), int(code[2:4], 16), int(code[4:], 16)) for code in codes.split())


SKINS = _palette("ecc4a8 e0ac8a c68c68 966244 684432")
HAIRS = _palette("231c18 463020 785430 bea06e 8c8884")
CLOTHES = _palette("283c78 a0282c 3c6e46 dcdcd6 2e2e34 d2aa3c 785a8c 5a82a0")
TROUSERS = _palette("2c3654 28282c 786c58 5c6064 46342a")
SHOES = _palette("1e1c1c d2d2cd 5a3c28")
UPPER = ("lumbar", "thorax", "left_clavicle", "right_clavicle", "left_shoulder", "right_shoulder")
FOREARMS, FEET = ("left_elbow", "right_elbow"), ("left_ankle", "right_ankle")
LEGS = ("root", "left_hip", "right_hip", "left_knee", "right_knee")


@dataclass(frozen=True)
class Appearance:
    """Colours of a person, RGB.

    Attributes
    ----------
    skin, hair, shirt, stripes, trousers, shoes : colours; `stripes` is the second colour of the shirt
    long_sleeves, long_hair : extent of cloth and hair
    """

    skin: Color
    hair: Color
    shirt: Color
    stripes: Color
    trousers: Color
    shoes: Color
    long_sleeves: bool
    long_hair: bool

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Appearance:
        """Return a random appearance; half of all shirts have stripes."""
        skin, hair, shirt, other, trousers, shoes = (
            palette[int(rng.integers(len(palette)))] for palette in (SKINS, HAIRS, CLOTHES, CLOTHES, TROUSERS, SHOES)
        )
        striped, long_sleeves, long_hair = (bool(rng.random() < 0.5) for _ in range(3))
        return cls(skin, hair, shirt, other if striped else shirt, trousers, shoes, long_sleeves, long_hair)


def vertex_colors(body: Body, look: Appearance, hanging: int = 0) -> np.ndarray:
    """Return the colours of a body's vertices, float64 (V, 3), 0 to 255; the last `hanging` vertices are a skirt."""
    colors = np.tile(np.array(look.skin, dtype=np.float64), (len(body.vertices), 1))
    height = body.vertices[:, 1]
    stripes = 0.09  # period of the stripes of a shirt, metres
    striped = np.where((height // (0.5 * stripes) % 2 == 0)[:, None], look.shirt, look.stripes)
    above_belt = _carried(body, ("root",)) & (height > 0.05 * body.height)
    shirt = _carried(body, UPPER) | above_belt | (_carried(body, FOREARMS) & look.long_sleeves)
    colors[shirt] = striped[shirt]
    colors[_carried(body, LEGS) & ~above_belt] = look.trousers
    colors[_carried(body, FEET)] = look.shoes
    _draw_head(body, look, colors)
    if hanging:
        colors[-hanging:] = look.trousers
    return colors


def _carried(body: Body, joints: tuple[str, ...]) -> np.ndarray:
    return np.isin(body.part, [skeleton.JOINT_NAMES.index(name) for name in joints])


def _draw_head(body: Body, look: Appearance, colors: np.ndarray) -> None:
    """Draw hair, and a face with brows, eyes and lips, which distinguishes front and back."""
    head = np.flatnonzero(_carried(body, ("cervical",)))
    middle = body.sites[[name for name, _ in skeleton.SITES].index("head")]
    head_width = 0.17  # width in metres of the head for positions on it
    places = (body.vertices[head] - middle) * head_width / np.ptp(body.vertices[head, 0])
    x, y, z = np.abs(places[:, 0]), places[:, 1], places[:, 2]
    front, ear = z > 0.04, (x > 0.07) & (np.abs(z + 0.01) < 0.02) & (y < 0.02)
    # Height of the hairline above the middle of the head by the distance in front of it, metres.
    hairline = ((-0.1, -0.04, 0.0, 0.04, 0.085), (-0.09, -0.06, 0.01, 0.025, 0.065))
    long_hair = -0.15  # lowest height of long hair at the back of the head, metres
    covered = (y > np.interp(z, *hairline)) | (look.long_hair & (z < 0.0) & (y > long_hair))
    skin = np.array(look.skin)
    parts = (
        (covered & ~ear, look.hair),
        (front & (((x - 0.031) / 0.017) ** 2 + ((y - 0.003) / 0.009) ** 2 < 1), (235, 235, 230)),
        (front & ((x - 0.031) ** 2 + (y - 0.003) ** 2 < 0.007**2), (50, 36, 28)),
        (front & (np.abs(x - 0.031) < 0.02) & (np.abs(y - 0.023) < 0.005), look.hair),
        (front & (x < 0.027) & (np.abs(y + 0.063) < 0.009), 0.75 * skin * (1.0, 0.75, 0.75)),
        (front & (x < 0.016) & (np.abs(y + 0.042) < 0.004), 0.7 * skin),
    )
    for where, color in parts:
        colors[head[where]] = color
