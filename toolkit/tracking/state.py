"""State of a tracked person between two frames, as a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.io.archives import Column
from toolkit.io.checkpoint import HINT, check_state
from toolkit.io.errors import TrackError

FIRST_STEP = 1.0 / 30.0
"""Seconds assumed between a first frame and the one before it."""

State = dict[str, Any]
"""Nested arrays, numbers, text and None by name: the types that `checkpoint.py` writes."""


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

    pose: np.ndarray
    joints: np.ndarray
    effectors: np.ndarray
    extrema: np.ndarray | None
    before: np.ndarray | None
    elapsed: float

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
    pose: np.ndarray | None = None
    centre: np.ndarray | None = None
    facing: np.ndarray | None = None
    timestamp: float | None = None
    lost: float = 0.0
    in_view: np.ndarray | None = None
    network: np.ndarray | None = None
    turn: int = 0
    smoothed: tuple[np.ndarray, float] | None = None
    memory: Mapping[str, Mapping[str, np.ndarray]] = field(default_factory=dict)

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

    def export(self) -> State:
        """Return the state as plain arrays, numbers and text."""
        state: State = {
            "body": body_state(self.body),
            # JSON keeps integers of any size only as text in every reader.
            "generator": {key: str(value) for key, value in _flat(self.generator).items()},
            "memory": {name: dict(kept) for name, kept in self.memory.items()},
            "previous": None if self.previous is None else dict(vars(self.previous)),
            "last_seen": None if self.last_seen is None else dict(vars(self.last_seen)),
            "smoothed": None if self.smoothed is None else {"pose": self.smoothed[0], "timestamp": self.smoothed[1]},
        }
        return state | {name: getattr(self, name) for name in _NUMBERS}

    @classmethod
    def restore(cls, state: Mapping[str, Any]) -> PersonState:
        """Restore what `export` returned.

        Raises
        ------
        TrackError, BodyError
            The state belongs to another object.
        """
        check_state(state, _NUMBERS, _NESTED, "person")
        for name in ("previous", "last_seen"):
            if state[name] is not None:
                check_state(state[name], _PREVIOUS, what="frame before")
        if state["smoothed"] is not None:
            check_state(state["smoothed"], {"pose": _POSE, "timestamp": _NUMBERS["lost"]}, what="smoother")
        for name, kept in state["memory"].items():
            check_state(kept, {key: _remembered(kept[key]) for key in kept}, what=f"search {name}")
        smoothed = state["smoothed"]
        return cls(
            body=body_of(state["body"]),
            generator=_generator(state["generator"]),
            previous=None if state["previous"] is None else Previous(**state["previous"]),
            last_seen=None if state["last_seen"] is None else Previous(**state["last_seen"]),
            smoothed=None if smoothed is None else (smoothed["pose"], smoothed["timestamp"]),
            **{name: state[name] for name in (*_NUMBERS, "memory")},
        )


_FAR = 1e4
"""Metres, radians: bound of every pose entry in a recording."""
_POSE = Column("f", (skeleton.POSE_SIZE,), -_FAR, _FAR)
_REPORTED, _ENDS = (len(skeleton.REPORTED),), (len(skeleton.END_EFFECTORS), 3)
_NUMBERS = {
    "sized": Column("b", ()),
    "last_seen_at": Column("iuf", (), optional=True),
    "pose": replace(_POSE, optional=True),
    "centre": Column("f", (3,), -_FAR, _FAR, optional=True),
    "facing": Column("f", (2,), -_FAR, _FAR, optional=True),
    "timestamp": Column("iuf", (), optional=True),
    "lost": Column("iuf", ()),
    "in_view": Column("f", _REPORTED, 0, 1, optional=True),
    "network": Column("f", (*_REPORTED, 2), 0, 1, optional=True),
    "turn": Column("iu", (), 0),
}
_NESTED = ("body", "generator", "memory", "previous", "last_seen", "smoothed")
_BODY = {
    "shape": Column("f", ("coefficients",), -100, 100),
    "scale": Column("iuf", (), 0.01, 100),
    "name": Column("U", ()),
    "offsets": Column("f", ("vertices",), -0.1, 0.1, optional=True),
}
_PREVIOUS = {
    "pose": _POSE,
    "joints": Column("f", (*_REPORTED, 3), -_FAR, _FAR),
    "effectors": Column("f", _ENDS, -_FAR, _FAR),
    "extrema": Column("f", _ENDS, -_FAR, _FAR, optional=True),
    "before": replace(_POSE, optional=True),
    "elapsed": Column("iuf", (), 1e-6, 1e9),
}
"""Columns of a person's state by name."""


def _remembered(value: Any) -> Column:
    """Check the memory of a search: poses in rows, or single numbers."""
    rows = len(value) if isinstance(value, np.ndarray) and value.ndim == 2 else 0
    most_remembered = 4096  # columns of the poses that a search stores
    if rows > most_remembered:
        raise TrackError(f"a search keeps {rows} poses; {HINT}")
    return Column("f", ("rows", skeleton.POSE_SIZE), -_FAR, _FAR) if rows else Column("iuf")


def _generator(texts: Any) -> dict[str, Any]:
    """Restore the state of a random generator from its texts."""
    try:
        values = _nested({key: _number(value[:60]) for key, value in texts.items()})
        np.random.PCG64().state = values  # type: ignore[assignment]
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
        raise TrackError(f"the saved state of the person has no valid random generator; {HINT}") from error
    return values


def body_state(body: Body) -> State:
    """Return a body of the shape space as plain arrays, numbers and text."""
    return {"shape": body.shape, "scale": float(body.scale), "name": body.name, "offsets": body.offsets}


def body_of(state: Mapping[str, Any]) -> Body:
    """Restore the body that `body_state` described; raises TrackError or BodyError for anything else."""
    check_state(state, _BODY, what="body")
    return ShapeSpace.load().body(state["shape"], scale=state["scale"], name=state["name"], offsets=state["offsets"])


def _flat(values: Mapping[str, Any], where: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in values.items():
        found |= _flat(value, f"{where}{key}/") if isinstance(value, Mapping) else {f"{where}{key}": value}
    return found


def _nested(values: Mapping[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in values.items():
        *outer, last = key.split("/")
        inner = found
        for name in outer:
            inner = inner.setdefault(name, {})
        inner[last] = value
    return found


def _number(text: str) -> int | str:
    return int(text) if text.lstrip("-").isdigit() else text
