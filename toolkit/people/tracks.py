"""Track of a person: a head that moves over the floor plan."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from toolkit.io.archives import Column
from toolkit.people.evidence import Evidence

GATE = 0.4  # m from where a head is expected: it nods, and its middle moves as it turns


LEVEL = np.array([1.0, 0.0, 1.0])
"""Mask of the horizontal components of a displacement in the level frame."""
UNKNOWN = np.full(3, np.nan)
"""Place of an unknown point."""
Place = Annotated[np.ndarray, Column("f", (3,), -1e3, 1e3)]
"""Place or velocity in a checkpoint."""


@dataclass(frozen=True, eq=False)
class KnownPerson:
    """State of a tracked person.

    Attributes
    ----------
    id : 1, 2, ...
    head : float64 (3,), level frame, metres
    velocity : float64 (3,), metres a second
    first, last : timestamps of the first and the last frame with the person in view, seconds
    tallest : height at which the head stands, level frame, metres
    middle : float64 (3,), median of the measured points, level frame, metres
    area : measured area without occlusion, m^2, as if it faced the camera
    stature : metres, from the person's follower; 0 = unknown
    borne_out : True once a head was detected where the tracked body has it; from then on the body overrides detected
        heads
    body_head : float64 (3,), level frame, metres, head of the tracked body in the last frame; NaN = unknown
    gone : True after leaving the image: unseen in the last frame, and expected outside it or at its border
    looked : time of the last sample of evidence, seconds
    evidence : accumulated evidence that the track is a person
    """

    id: int
    head: Place
    velocity: Place
    first: float
    last: float
    tallest: float
    middle: Place
    area: float
    stature: float = 0.0
    borne_out: bool = False
    body_head: Annotated[np.ndarray, Column("f", (3,), -1e3, 1e3, gaps=True)] = field(default_factory=UNKNOWN.copy)
    gone: bool = False
    looked: float = -1e9  # before every timestamp
    evidence: Evidence = Evidence()

    def expected(self, timestamp: float) -> np.ndarray:
        """Return the expected place of the head: float64 (3,), level frame, metres."""
        longest_forecast = 0.5  # s over which a velocity holds
        return self._start + self.velocity * min(max(timestamp - self.last, 0.0), longest_forecast)

    @property
    def _start(self) -> np.ndarray:
        """Return the place of the head in the last frame."""
        return self.body_head if self.borne_out and np.isfinite(self.body_head).all() else self.head

    def faced(self, head: np.ndarray, distance: float) -> KnownPerson:
        """Return the person whose head is at `head` (3,); within `distance` metres it verifies the person's body."""
        near = ((self.body_head - head) ** 2).sum() < distance**2  # never, where that is not known
        return replace(self, borne_out=self.borne_out or bool(near))

    def with_sample(self, score: float, moved: float, timestamp: float) -> KnownPerson:
        """Return the person with one more sample of evidence."""
        return replace(self, looked=timestamp, evidence=self.evidence.after(score, moved))

    def gate(self, timestamp: float) -> float:
        """Return the radius of the search for the head, metres; it does not grow after the person left the image."""
        if self.gone:
            return GATE
        gate_growth = 1.5  # m/s by which the gate widens while the person is unseen: a brisk walk
        widest_gate = 1.5  # m
        return min(GATE + gate_growth * max(timestamp - self.last, 0.0), widest_gate)

    def seen(self, head: np.ndarray | None, middle: np.ndarray, area: float, timestamp: float) -> KnownPerson:
        """Return the person after a new frame.

        Parameters
        ----------
        head : (3,), where the head is seen, or None
        middle, area : those of their measured surface
        """
        elapsed = max(timestamp - self.last, 0.0)
        whole_share = 0.7  # of a person's area: less, and they are half hidden
        whole = area > whole_share * self.area
        place, before = head, self.head
        if place is None:  # the visible part of a half occluded person is no measure of their velocity
            before = self._start
            moved = (middle - self.middle) * LEVEL  # what hides legs or shows them again lifts the middle, not the head
            place = before + moved if whole else self.expected(timestamp)
        velocity = self.velocity
        velocity_memory = 0.2  # s over which a velocity is averaged
        if elapsed > 0 and (head is not None or whole):
            share = min(elapsed / velocity_memory, 1.0)
            velocity = (1 - share) * velocity + share * (place - before) / elapsed
        tallest = self.tallest
        tallest_memory = 1.0  # s in which the height of a head that stands is learnt
        if head is not None and head[1] > tallest:
            rising = self.last - self.first < tallest_memory
            tallest += (1.0 if rising else min(elapsed / tallest_memory, 1.0)) * (float(head[1]) - tallest)
        area_fading = 0.1  # a second, by which the known area fades as a person walks away
        kept = max(area, self.area * (1 - area_fading * elapsed))
        return replace(
            self, head=place, velocity=velocity, middle=middle, area=kept, last=timestamp, tallest=tallest, gone=False
        )
