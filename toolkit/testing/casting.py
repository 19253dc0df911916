"""Actors and scenes of the suite before they are made."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.simulation.furniture import Box

LONGEST = 90
"""Frames of a scene unless it says otherwise."""


@dataclass(frozen=True)
class Actor:
    """A person in a scene before they are made.

    Attributes
    ----------
    motion : `bk_squat_013` (HDM05 actor, motion, number), `02_05` (CMU) or `bundled_archery` (procedural)
    body : name of a subject
    at, yaw, stature, furniture, clothes, enters : as of `Person`
    path : "stays" in place; "walks" as the motion does, and back while others are there; or "passes" once, and is gone.
        Out of `acts.PATHS`, out of sight at the `side` first. "hug" or "give": meets another actor of the same path at
        the same place and parts again
    side : -1 comes from the left or stands there, 1 at the right
    holds : out of `holding.HOLDINGS`; who gives has it until the middle, who is given it from then on
    start : seconds of the motion that are skipped
    spin : degrees by which they are turned evenly until the last frame
    """

    motion: str
    body: str
    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    stature: float | None = None
    seated: bool = False
    furniture: tuple[str, ...] = ()
    clothes: tuple[str, ...] = ()
    enters: float = 0.0
    path: str = "stays"
    side: float = -1.0
    holds: str | None = None
    start: float = 0.0
    spin: float = 0.0


@dataclass(frozen=True)
class Scene:
    """A recording of the suite before it is made.

    Attributes
    ----------
    group : out of `scenes.GROUPS` or `scenes.ROOM_GROUPS`
    actors : who is in it
    sensor, distance, height, tilt, boxes, room : as of `Shot`
    view : out of `scenes.VIEWS`
    frames : length
    seed : of bodies, noise and how a person sits
    """

    group: str
    actors: tuple[Actor, ...]
    sensor: str = "kinect"
    distance: float = 2.6
    height: float = 1.2
    tilt: float | None = None
    boxes: tuple[Box, ...] = ()
    room: str | None = None
    view: str = "cut"
    frames: int = LONGEST
    seed: int = 0

    @property
    def name(self) -> str:
        """What the recording is called."""
        return f"{self.group}_{self.seed:03d}_{self.view}"


def one(
    group: str, motion: str, body: str, distance: float, height: float, tilt: float | None, **more: object
) -> Scene:
    """A scene of one person; `more` goes to the actor, but for what is of the scene."""
    shot = {key: more.pop(key) for key in ("sensor", "boxes", "room", "frames") if key in more}
    return Scene(group, (Actor(motion, body, **more),), distance=distance, height=height, tilt=tilt, **shot)  # type: ignore[arg-type]
