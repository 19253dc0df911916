"""Person or furniture: what was seen of something with a head, over the frames of a recording, and what it speaks for.

Nothing here is decided in a single frame. Every head above shoulders is a hypothesis; motion, a person's shape
and what the regressor says of its pixels are evidence for it, and so is its absence against it. Log odds add up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.people.detection import near_head
from toolkit.people.evidence import MOST_JUDGED
from toolkit.people.view import CoarseCamera, View
from toolkit.sensing.camera import Camera

PRIOR_LOG_ODDS = -1.8
"""Log odds of something with a head and without other evidence: rooms hold more such things than people."""
MOVED, MOVED_AT_ALL, HEAD_MOVED_AT_ALL = 4.0, 2.0, 3.0
"""Log odds of what stood elsewhere in the other frames; of one whose surface, and whose head, moves in place."""
ENOUGH, ENOUGH_HEAD = 0.02, 0.1
"""Share of the pixels of a body (a hand) and of a head that move in place, and that is all the evidence they give."""
SHAPED = 3.0
"""Log odds between what never has a person's shape and what has it in all frames in which it is seen."""
JUDGED, UNDECIDED = 2.2, 1.2
"""Log odds for each of the mean that the judge gives, and the mean at which it says nothing: what has a head looks more
like a person than the walls and desks among which it learnt."""
ALONE = 0.7
"""Log odds by which less is enough where only one frame is known: no later frame finds a person who is missed."""
HEAD_HEIGHT = (0.5, 2.4)
"""Metres of a head's middle above the floor: a child of 0.8 m who squats, an adult of 2.2 m on a step."""
LOW = 2.0
"""Log odds against a low head: chairs, boxes and low cupboards end there."""
SEATED, LOWEST = 1.0, 0.75
"""Metres above the floor: no head of a seated adult is lower than the first; below the second it is low altogether."""


class PersonClassifier(Protocol):
    """Says of single pixels how likely they are of a person, whatever moves."""

    def log_odds(self, depth: np.ndarray, camera: Camera, rotation: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """Log odds that pixels are of a person and not of a room: float64 (N,).

        Parameters
        ----------
        depth : float32 (h, w), metres along z, 0 = no measurement; the whole image as it was measured
        camera : of that image
        rotation : float64 (3, 3), `R_level_camera`
        pixels : int64 (N,), flat indices of pixels that were measured
        """
        ...


def possible_height(place: np.ndarray, floor: float | None) -> bool:
    """Whether a head at `place` (3,), level frame, metres, is as high above the floor (its y) as a head can be that is
    above shoulders; any is where the floor is not known.
    """
    return floor is None or HEAD_HEIGHT[0] <= place[1] - floor <= HEAD_HEIGHT[1]


def lowness(place: np.ndarray, floor: float | None) -> float:
    """How low a head at `place` (3,), level frame, metres, is above the floor (its y): from 0 of a person who sits or
    stands to 1; 0 where the floor is not known.
    """
    return 0.0 if floor is None else float(np.clip((SEATED - (place[1] - floor)) / (SEATED - LOWEST), 0.0, 1.0))


def judged_head(view: View, lens: CoarseCamera, place: np.ndarray, judge: PersonClassifier | None) -> float | None:
    """Mean log odds that the pixels around a head's place (3,), level frame, metres, are of a person; None without a
    judge or a measured pixel.
    """
    pixels = np.flatnonzero(near_head(view, place) & view.foreground)
    if judge is None or len(pixels) == 0:
        return None
    return float(np.mean(judge.log_odds(view.depth, lens.camera, lens.rotation, pixels)))


@dataclass(frozen=True)
class EvidenceSample:
    """What one frame says of something with a head.

    Attributes
    ----------
    shaped : whether it has a person's shape
    moved : share of the head's pixels that stand before the room as it lasts
    alive, head_alive : share of its pixels, and of the head's, that show other depths close by in other frames
    judged : mean log odds of the judge over the head's pixels; None without a judge
    low : how low its head is, see `lowness`
    """

    shaped: bool
    moved: float
    alive: float = 0.0
    head_alive: float = 0.0
    judged: float | None = None
    low: float = 0.0


def log_odds(glimpses: Sequence[EvidenceSample]) -> float:
    """Log odds that something is a person and not furniture, by glimpses of it, at least one."""

    def mean(values: list[float]) -> float:
        return float(np.mean(values))

    judged = [g.judged - UNDECIDED for g in glimpses if g.judged is not None]
    return float(
        PRIOR_LOG_ODDS
        + MOVED * mean([g.moved for g in glimpses])
        + MOVED_AT_ALL * min(mean([g.alive for g in glimpses]) / ENOUGH, 1.0)
        + HEAD_MOVED_AT_ALL * min(mean([g.head_alive for g in glimpses]) / ENOUGH_HEAD, 1.0)
        + SHAPED * (mean([g.shaped for g in glimpses]) - 0.5)
        - LOW * mean([g.low for g in glimpses])
        + JUDGED * float(np.clip(mean(judged or [0.0]), -MOST_JUDGED, MOST_JUDGED))
    )


def alone_log_odds(shaped: bool, judged: float | None, low: float = 0.0) -> float:
    """Log odds that something with a head is a person, by the only frame that there is."""
    return ALONE + log_odds([EvidenceSample(shaped, 0.0, judged=judged, low=low)])
