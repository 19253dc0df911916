"""Colours, lights and text of all pictures. Colours are RGB; `left` and `right` are the subject's."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from toolkit.body.body import Body
from toolkit.body.skeleton import BONES, JOINT_NAMES, REPORTED
from toolkit.io.display_names import printable

LEFT = (255, 145, 40)
RIGHT = (60, 150, 255)
MIDDLE = (225, 225, 225)
EXTREMUM = (255, 60, 160)
CLOUD = (150, 230, 190)
ALARM = (255, 80, 70)
CARRYING = (250, 225, 60)
FLOOR = (84, 92, 104)
INK = (235, 238, 242)
FAINT = (150, 156, 166)
PAPER = (20, 22, 28)
BAR = (32, 35, 43)
KEY_LIGHT = np.array([-0.45, -0.65, -0.6]) / np.linalg.norm([-0.45, -0.65, -0.6])
"""Direction to the key light, camera frame: from the upper left, in front of the body."""
LIGHTS = np.array([0.28, 0.5, 0.3])
"""Weights of ambient light, key light and a light at the camera."""


def person_color(number: int) -> tuple[int, int, int]:
    """Return the colour of the person with this index (from 0)."""
    # Colours of several people in order of appearance.
    people = ((255, 145, 40), (60, 150, 255), (120, 220, 120), (240, 110, 190), (240, 215, 70), (150, 120, 255))
    return people[number % len(people)]


def side_color(name: str) -> tuple[int, int, int]:
    """Return the colour of a joint by the side in its name."""
    return LEFT if name.startswith("left") else RIGHT if name.startswith("right") else MIDDLE


BONE_COLORS: tuple[tuple[int, int, int], ...] = tuple(side_color(b) for _, b in BONES)
JOINT_COLORS: tuple[tuple[int, int, int], ...] = tuple(side_color(name) for name in REPORTED)
PART_COLORS: np.ndarray = np.array([side_color(name) for name in JOINT_NAMES], dtype=np.float32)
"""Mesh colour of each joint: float32 (18, 3)."""


def mesh_colors(bodies: Sequence[Body]) -> list[np.ndarray]:
    """Return vertex colours of each body, float64 (V, 3): by body part for one person, one colour each for several."""
    if len(bodies) == 1:
        (body,) = bodies
        mixed = (body.skin_weights[..., None] * PART_COLORS[body.skin_joints]).sum(axis=1)
        return [np.asarray(mixed, dtype=np.float64)]
    return [np.tile(np.array(person_color(k), dtype=float), (len(body.vertices), 1)) for k, body in enumerate(bodies)]


@lru_cache(maxsize=256)
def _text_mask(text: str, size: int) -> np.ndarray:
    """Render a line of text as float32 (h, w) in [0, 1], `size` pixels high; control characters are escaped."""
    text = printable(text)
    import matplotlib
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), size)
    width = int(font.getlength(text)) + 2
    image = Image.new("L", (width, size + size // 2))
    ImageDraw.Draw(image).text((0, 0), text, font=font, fill=255)
    return np.asarray(image, dtype=np.float32) / 255.0


def flowed(widths: Sequence[int], total: int, gap: int) -> list[tuple[int, int]]:
    """Return line number and x of boxes in a row, which wraps at `total` pixels."""
    places, line, x = [], 0, gap
    for width in widths:
        if x > gap and x + width > total:
            line, x = line + 1, gap
        places.append((line, x))
        x += width + gap
    return places


def width_of(text: str, size: int) -> int:
    """Return the width of a line of text in pixels."""
    return _text_mask(text, size).shape[1]


def write(image: np.ndarray, text: str, x: int, y: int, size: int = 16, color: tuple[int, int, int] = INK) -> int:
    """Draw a line of text on an RGB image with its upper left corner at (x, y), clipped; return the x of its end."""
    mask = _text_mask(text, size)[: max(image.shape[0] - y, 0), : max(image.shape[1] - x, 0)]
    area = image[y : y + mask.shape[0], x : x + mask.shape[1]]
    area[:] = (area + (np.array(color, dtype=np.float32) - area) * mask[..., None]).astype(np.uint8)
    return x + mask.shape[1]
