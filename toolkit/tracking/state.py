"""State of a tracked person between two frames, as a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.archives import Column
from toolkit.io.typed_values import Range

FIRST_STEP = 1.0 / 30.0
"""Seconds assumed between a first frame and the one before it."""

_FAR = 1e4
"""Metres, radians: bound of every pose entry in a recording."""
_JOINTS = len(skeleton.REPORTED)
PoseVector = Annotated[np.ndarray, Column("f", (skeleton.POSE_SIZE,), -_FAR, _FAR)]
Effectors = Annotated[np.ndarray, Column("f", (len(skeleton.END_EFFECTORS), 3), -_FAR, _FAR)]
Memory = (
    Annotated[np.ndarray, Column("f", ("rows", skeleton.POSE_SIZE), -_FAR, _FAR)]
    | Annotated[np.ndarray, Column("iuf", ("numbers",))]
)
"""Types of a checkpoint; a search stores poses or numbers."""


@dataclass(frozen=True, eq=False)
class Previous:
    """Result of the previous frame, level frame.

    Attributes
    ----------
    pose : float64 (P,)
    joints, effectors : float64 (20, 3) and (5, 3), metres
    extrema : float64 (5, 3), metres, or None where there were fewer
    before : start (P,) of the local optimisation, or None where another hypothesis won: momentum does not carry over
        between hypotheses
    elapsed : seconds from `before` to `pose`
    """

    pose: PoseVector
    joints: Annotated[np.ndarray, Column("f", (_JOINTS, 3), -_FAR, _FAR)]
    effectors: Effectors
    extrema: Effectors | None
    before: PoseVector | None
    elapsed: Annotated[float, Range(1e-6, 1e9)]

    @classmethod
    def of_pose(
        cls,
        body: Body,
        pose: np.ndarray,
        extrema: np.ndarray | None = None,
        before: np.ndarray | None = None,
        elapsed: float = FIRST_STEP,
    ) -> Previous:
        """Return a body's joints and end effectors in a pose, with the other attributes."""
        return cls(pose, *body.key_points(pose), extrema, before, elapsed)


@dataclass(frozen=True, eq=False)
class PersonState:
    """State that a person's next step depends on besides the sighting.

    Attributes
    ----------
    body : fitted body
    sized : True if the body's size is known; otherwise the first frame tries several
    generator : state of the random generator, as NumPy's `bit_generator.state` has it
    previous : result of the previous frame; None where the person has to be detected again
    last_seen : last result before a short absence
    last_seen_at : timestamp of that frame, seconds
    pose : last estimated pose (P,), also before a loss; None before the first
    centre : float64 (3,), metres, level frame, of the frame before
    facing : float64 (2,), smoothed direction in the ground plane, or None
    timestamp : seconds, of the frame before
    lost : seconds since a pose last explained a frame; 0 while one does
    in_view : float64 (20,), probability that each reported joint was in view lately; None for a person who
        was never truncated
    network : float64 (20, 2), last inputs of the confidence from the joint network, see `network_features`
    turn : tracked frames since the start; periodic searches count by it
    smoothed : pose (P,) last reported by the smoother, and its timestamp
    memory : state of each search, by its name
    """

    body: Body
    sized: bool
    generator: Mapping[str, Any]
    previous: Previous | None = None
    last_seen: Previous | None = None
    last_seen_at: float | None = None
    pose: PoseVector | None = None
    centre: Annotated[np.ndarray, Column("f", (3,), -_FAR, _FAR)] | None = None
    facing: Annotated[np.ndarray, Column("f", (2,), -_FAR, _FAR)] | None = None
    timestamp: float | None = None
    lost: float = 0.0
    in_view: Annotated[np.ndarray, Column("f", (_JOINTS,), 0, 1)] | None = None
    network: Annotated[np.ndarray, Column("f", (_JOINTS, 2), 0, 1)] | None = None
    turn: Annotated[int, Range(0)] = 0
    smoothed: tuple[PoseVector, float] | None = None
    memory: Mapping[str, Mapping[str, Memory]] = field(default_factory=dict)

    @classmethod
    def begin(cls, body: Body, *, sized: bool, seed: int) -> PersonState:
        """Return the state before the first frame."""
        return cls(body, sized, np.random.Generator(np.random.PCG64(seed)).bit_generator.state)

    def elapsed(self, timestamp: float) -> float:
        """Return the seconds between the previous frame and `timestamp`, in either direction of time."""
        return FIRST_STEP if self.timestamp is None else abs(timestamp - self.timestamp)

    def is_due(self, period: int, ahead: int = 1) -> bool:
        """Return True if periodic work is due: the person is lost, or `turn` is `ahead` of a multiple of `period`."""
        return bool(self.lost) or (self.turn + ahead) % period == 0

    def rng(self) -> np.random.Generator:
        """Return the generator in its state; after a step its new state belongs into the next `PersonState`."""
        bits = np.random.PCG64()
        bits.state = dict(self.generator)  # type: ignore[assignment]
        return np.random.Generator(bits)
