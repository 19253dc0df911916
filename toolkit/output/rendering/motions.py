"""Films of stick figures side by side, for the results of a motion search."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from toolkit.output.rendering import style
from toolkit.output.rendering.film import contact_sheet, write_film
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion

FILM_RATE = 30.0
"""Frames per second of the film."""
PANEL = (300, 340)
"""Width and height of a panel, pixels."""

_SPINE = ("root", "belly", "chest", "neck", "head", "headtop")
_LIMBS = tuple(
    (start, *(f"{side}_{joint}" for joint in joints))
    for side in ("left", "right")
    for start, joints in (
        ("neck", ("clavicle", "shoulder", "elbow", "wrist", "fingers")),
        ("root", ("hip", "knee", "ankle", "toes")),
    )
)
_BONES = tuple(
    (NAMED_JOINTS.index(a), NAMED_JOINTS.index(b), style.side_color(b))
    for chain in (_SPINE, *_LIMBS)
    for a, b in zip(chain[:-1], chain[1:], strict=True)
)
_LEFT, _RIGHT, _ROOT = (NAMED_JOINTS.index(name) for name in ("left_hip", "right_hip", "root"))


def film_of_motions(path: str | Path, titled: Sequence[tuple[str, Motion]]) -> Path:
    """Write a film of motions that start together, each in its own panel; shorter ones hold their last pose.

    Parameters
    ----------
    path : the suffix selects the codec (`encoders.FILM_SUFFIXES`)
    titled : title, of one or two lines, and motion of each panel, in reading order

    Raises
    ------
    UsageError
        The suffix is no film suffix.
    OutputError
        The file cannot be written.
    """
    write_film(path, FILM_RATE, _pictures(titled))
    return Path(path)


def _pictures(titled: Sequence[tuple[str, Motion]]) -> Iterator[np.ndarray]:
    pixels = [_projected(motion) for _, motion in titled]
    hold = 15  # number of repetitions of the last pose of the longest motion
    columns = 3
    for frame in range(max(map(len, pixels)) + hold):
        panels = [
            _panel(title, places[min(frame, len(places) - 1)])
            for (title, _), places in zip(titled, pixels, strict=True)
        ]
        yield contact_sheet(panels, columns)


def _projected(motion: Motion) -> np.ndarray:
    """Return pixels (T, 24, 2) of the joints at `FILM_RATE`: view relative to the initial facing, person centred."""
    joints = motion.at_rate(FILM_RATE).joints
    across = joints[0, _LEFT] - joints[0, _RIGHT]
    yaw = np.radians(35.0)  # azimuth of the view relative to the initial facing; shows arms and legs side by side
    turn = np.arctan2(-across[2], across[0]) + yaw
    ground = joints - joints[:, [_ROOT]] * [1.0, 0.0, 1.0]
    x = np.cos(turn) * ground[..., 0] - np.sin(turn) * ground[..., 2]
    y = ground[..., 1] - joints[..., 1].min()
    viewed = 1.6  # height of a panel in body lengths (leg and spine, `BodyLengths.body`)
    scale = PANEL[1] / (viewed * (BodyLengths.of(motion).body or 1.0))
    return np.stack([0.5 * PANEL[0] + scale * x, 0.93 * PANEL[1] - scale * y], axis=-1)


def _panel(title: str, places: np.ndarray) -> np.ndarray:
    import cv2

    image = np.full((PANEL[1], PANEL[0], 3), style.PAPER, dtype=np.uint8)
    floor = round(0.93 * PANEL[1])
    cv2.line(image, (0, floor), (PANEL[0], floor), style.BAR, 2)
    for a, b, color in _BONES:
        start, end = (tuple(int(v) for v in np.rint(places[joint])) for joint in (a, b))
        cv2.line(image, start, end, color, 3, cv2.LINE_AA)
    for number, line in enumerate(title.splitlines()):
        style.write(image, line, 8, 6 + 20 * number, 13)
    return image
