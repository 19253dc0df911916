"""What simulated people look like: skin, hair, face and clothes as colours of the mesh's vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body

Color = tuple[int, int, int]

SKINS: tuple[Color, ...] = ((236, 196, 168), (224, 172, 138), (198, 140, 104), (150, 98, 68), (104, 68, 50))
HAIRS: tuple[Color, ...] = ((35, 28, 24), (70, 48, 32), (120, 84, 48), (190, 160, 110), (140, 136, 132))
CLOTHES: tuple[Color, ...] = (
    (40, 60, 120), (160, 40, 44), (60, 110, 70), (220, 220, 214), (46, 46, 52), (210, 170, 60), (120, 90, 140),
    (90, 130, 160),
)  # fmt: skip
TROUSERS: tuple[Color, ...] = ((44, 54, 84), (40, 40, 44), (120, 108, 88), (92, 96, 100), (70, 52, 42))
SHOES: tuple[Color, ...] = ((30, 28, 28), (210, 210, 205), (90, 60, 40))
HEAD_WIDTH = 0.17
"""Metres: width of the head to which places on it are relative."""
HAIRLINE = ((-0.1, -0.04, 0.0, 0.04, 0.085), (-0.09, -0.06, 0.01, 0.025, 0.065))
"""Height of the hairline over the middle of the head by the distance in front of it, metres."""
LONG_HAIR = -0.15
"""Height down to which long hair covers the back of the head."""
STRIPES = 0.09
"""Metres from one stripe of a shirt to the next."""
UPPER = ("lumbar", "thorax", "left_clavicle", "right_clavicle", "left_shoulder", "right_shoulder")
FOREARMS, FEET = ("left_elbow", "right_elbow"), ("left_ankle", "right_ankle")
LEGS = ("root", "left_hip", "right_hip", "left_knee", "right_knee")


@dataclass(frozen=True)
class Appearance:
    """Colours of a person, RGB.

    Attributes
    ----------
    skin, hair, shirt, stripes, trousers, shoes : `stripes` is the other colour of the shirt
    long_sleeves, long_hair : how far cloth and hair reach
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
        """A person's at random; half of all shirts have stripes."""
        skin, hair, shirt, other, trousers, shoes = (
            palette[int(rng.integers(len(palette)))] for palette in (SKINS, HAIRS, CLOTHES, CLOTHES, TROUSERS, SHOES)
        )
        striped, long_sleeves, long_hair = (bool(rng.random() < 0.5) for _ in range(3))
        return cls(skin, hair, shirt, other if striped else shirt, trousers, shoes, long_sleeves, long_hair)


def vertex_colors(body: Body, look: Appearance, hanging: int = 0) -> np.ndarray:
    """Colours of a body's vertices, float64 (V, 3), 0 to 255; the last `hanging` vertices are a skirt's cloth."""
    colors = np.tile(np.array(look.skin, dtype=np.float64), (len(body.vertices), 1))
    height = body.vertices[:, 1]
    striped = np.where((height // (0.5 * STRIPES) % 2 == 0)[:, None], look.shirt, look.stripes)
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
    """Hair, and a face with brows, eyes and lips: what tells a front from a back."""
    head = np.flatnonzero(_carried(body, ("cervical",)))
    middle = body.sites[[name for name, _ in skeleton.SITES].index("head")]
    places = (body.vertices[head] - middle) * HEAD_WIDTH / np.ptp(body.vertices[head, 0])
    x, y, z = np.abs(places[:, 0]), places[:, 1], places[:, 2]
    front, ear = z > 0.04, (x > 0.07) & (np.abs(z + 0.01) < 0.02) & (y < 0.02)
    covered = (y > np.interp(z, *HAIRLINE)) | (look.long_hair & (z < 0.0) & (y > LONG_HAIR))
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
