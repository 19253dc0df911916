"""Actors and scenes of the simulated suites, as `scenes.yaml` lists them."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

from toolkit.io.errors import UsageError
from toolkit.io.yaml_reader import read_yaml
from toolkit.simulation.furniture import Box
from toolkit.simulation.person import SimulatedPerson

FILE = Path(__file__).with_name("scenes.yaml")
LONGEST = 90
"""Default number of frames of a scene."""


@dataclass(frozen=True)
class Actor(SimulatedPerson):
    """A person in a scene before they are made: what is not said here is as of `SimulatedPerson`.

    Attributes
    ----------
    clip : `bk_squat_013` (HDM05 actor, motion, number), `02_05` (CMU) or `bundled_archery` (procedural)
    body : name of a subject
    path : "stays" in place; "walks" as the motion does, and back while others are there; or "passes" once, and is gone.
        Out of `acts.PATHS`, out of sight at the `side` first. "hug" or "give": meets another actor of the same path at
        the same place and parts again
    side : -1 comes from the left or stands there, 1 at the right
    start : seconds of the motion that are skipped
    spin : degrees by which they are turned evenly until the last frame
    carries : object of `holding.HOLDINGS` in their hands
    stature : metres to which the body is scaled
    clothes : names of `clothes.GARMENTS`
    """

    clip: str
    body: str = "neutral"
    path: str = "stays"
    side: float = -1.0
    start: float = 0.0
    spin: float = 0.0
    carries: str | None = None
    stature: float | None = None
    clothes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Scene:
    """A recording of a suite before it is made.

    Attributes
    ----------
    group : of the suite, out of `suite.GROUPS`, `scenes.GROUPS`, `scenes.ROOM_GROUPS` or `upper.GROUPS`
    actors : who is in it
    sensor, distance, height, tilt, boxes, room : as of `Shot`; a `distance` of None is the smallest at which all of the
        one actor's motion is in the image, times `spare`
    view : out of `scenes.VIEWS`
    frames : length
    seed : of bodies, procedural motions, noise and how a person sits
    """

    group: str
    actors: tuple[Actor, ...]
    sensor: str = "kinect"
    distance: float | None = 2.6
    spare: float = 1.05
    height: float = 1.2
    tilt: float | None = None
    boxes: tuple[Box, ...] = ()
    room: str | None = None
    view: str = "cut"
    frames: int = LONGEST
    seed: int = 0

    @property
    def actor(self) -> Actor:
        """The scene's only actor."""
        (actor,) = self.actors
        return actor

    @property
    def name(self) -> str:
        """Name of the recording."""
        if len(self.actors) != 1:
            return f"{self.group}_{self.seed:03d}_{self.view}"
        return f"{self.group}_{self.actor.clip}_{self.actor.body}_{self.sensor}"


def listed(suite: str, split: str) -> list[Scene]:
    """Return the scenes of a suite's split in the order of the file, all with seed 0."""
    own = _suites()[suite]
    shared = own.get("defaults", {})
    return [_scene(group, shared | entry) for group, entries in own[split].items() for entry in entries]


@cache
def _suites() -> dict[str, Any]:
    content: dict[str, Any] = read_yaml(FILE, str(FILE), UsageError, "it is a part of the checkout")
    return content


def _scene(group: str, entry: Mapping[str, Any]) -> Scene:
    """Return a scene of several `actors`, or of one whose fields stand beside the rest."""
    of_actors = {field.name for field in fields(Actor)}
    alone = {name: value for name, value in entry.items() if name in of_actors}
    shot = {name: value for name, value in entry.items() if name not in (*of_actors, "actors", "boxes")}
    actors = tuple(
        Actor(**{name: _fixed(value) for name, value in own.items()}) for own in entry.get("actors", [alone])
    )
    boxes = tuple(Box(*_fixed(corners)) for corners in entry.get("boxes", ()))
    return Scene(group, actors, boxes=boxes, **shot)


def _fixed(value: Any) -> Any:
    """Return lists as tuples."""
    return tuple(map(_fixed, value)) if isinstance(value, list) else value
