"""The suite of scenes: people as they are recorded, and rooms without people, with exact truth.

Seven groups: from the waist up, seated, behind furniture, several people (apart, crossing, touching, coming and going),
children and tilted cameras, clothes, and empty rooms. A third of those with people is already cut out, a third holds
the empty scene, a third neither. Seven more are of furnished rooms without their empty scene.

The splits share no actor and no body, and no actor is in the database of `tests.support.suite`: `tune` is made of
HDM05 actor bk, `report`, for reporting only, of HDM05 actor dg and the CMU subjects 02 and 49. Where the mocap is
absent, bundled `subject` motions take its place.
"""

from collections.abc import Sequence
from dataclasses import astuple, fields, replace
from functools import partial
from pathlib import Path

import numpy as np

from tests.support import acts, clothes, proportions, suite
from tests.support.casting import Actor, Scene, listed
from tests.support.holding import held_mesh
from tests.support.suite import RATE, SHORTEST, cut, digest_of, in_place, motion_of, spun
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SUBJECT_MOTIONS
from toolkit.simulation.furniture import Box
from toolkit.simulation.person import SimulatedPerson, facing_of, prepare_person
from toolkit.simulation.scene import place_camera
from toolkit.simulation.sensors import make_sensor
from toolkit.simulation.simulate import AIM_HEIGHT, CaptureSettings, simulate_scene
from training.interiors.room import KINDS, around_people

GROUPS = ("waist", "seated", "behind", "several", "children", "clothes", "empty")
VIEWS = ("cut", "background", "room")
"""Views: person already segmented, room with its empty scene, room without it."""
ROOM_GROUPS = ("enter", "carry", "together", "crowd", "rooms", "stills", "vacant")
EMPTY_ROOMS, EMPTY_FRAMES, VACANT_FRAMES = 10, 45, 300
"""Number of recordings without people in each split, bare and furnished, and their lengths in frames."""
MARGIN = 0.14
"""Largest distance from a joint to the body's outline, metres."""
PIECES = ((0.35, 1.75, 0.35), (0.85, 0.9, 0.8), (0.8, 2.0, 0.35), (1.2, 0.74, 0.7), (0.3, 1.3, 0.3), (0.5, 0.5, 0.5))
"""Width, height and depth in metres of objects in an empty room: a coat stand, an armchair, a shelf, ..."""


def _empty_rooms(split: str) -> tuple[Scene, ...]:
    """Return rooms with three to six separate objects and random cameras."""
    rooms = []
    for i in range(EMPTY_ROOMS):
        rng = np.random.default_rng([("tune", "report").index(split), i])
        boxes: list[Box] = []
        for _ in range(rng.integers(3, 7)):
            width, height, depth = np.array(PIECES[rng.integers(len(PIECES))]) * rng.uniform(0.85, 1.15, 3)
            x, z = rng.uniform(-1.4, 1.4), rng.uniform(-1.4, 0.4)
            box = Box((x - width / 2, 0.0, z - depth / 2), (x + width / 2, height, z + depth / 2))
            if not any(_touch(box, other) for other in boxes):
                boxes.append(box)
        sensor = ("kinect", "tof")[i % 2]
        height, tilt = float(rng.uniform(0.6, 2.4)), float(rng.uniform(-5.0, 12.0))
        tilt += 12.0 * (height - 1.0)
        distance = float(rng.uniform(2.2, 3.4))
        rooms.append(
            Scene("empty", (), sensor, distance, height=height, tilt=tilt, boxes=tuple(boxes), frames=EMPTY_FRAMES)
        )
    return tuple(rooms)


def _vacant_rooms(split: str) -> tuple[Scene, ...]:
    """Return furnished rooms without people, cameras 0.5 to 2.5 m above the floor."""
    rooms, first = [], {"tune": 200, "report": 300}[split]
    for i in range(EMPTY_ROOMS):
        rng = np.random.default_rng([first, i])
        height = float(rng.uniform(0.5, 2.5))
        tilt = float(np.clip(14.0 * (height - 1.2) + rng.normal(0.0, 4.0), -8.0, 35.0))
        distance = float(rng.uniform(2.0, 4.0))
        room, sensor = f"{list(KINDS)[i % len(KINDS)]}:{first + i}", "tof" if i % 3 == 2 else "kinect"
        rooms.append(
            Scene(
                "vacant", (), sensor, distance, height=height, tilt=tilt, room=room, view="room", frames=VACANT_FRAMES
            )
        )
    return tuple(rooms)


def _touch(first: Box, second: Box) -> bool:
    return all(first.low[k] < second.high[k] and second.low[k] < first.high[k] for k in (0, 2))


def scenes(split: str, groups: tuple[str, ...] = GROUPS) -> tuple[Scene, ...]:
    """Return the scenes of `tune` or `report` with views and seeds; of bundled motions if there is no mocap."""
    base = 0 if split == "tune" else 100
    chosen = [*listed("recorded", split), *_empty_rooms(split)]
    found = [replace(scene, seed=base + i, view=_view(scene, i)) for i, scene in enumerate(chosen)]
    furnished = [*listed("rooms", split), *_vacant_rooms(split)]
    found += [replace(scene, seed=base + 200 + i) for i, scene in enumerate(furnished)]
    if not suite.has_mocap():
        found = [_bundled(scene, scene.seed) for scene in found]
    return tuple(scene for scene in found if scene.group in groups)


def _view(scene: Scene, number: int) -> str:
    """Return one of the three views in turn; one empty room is segmented, every other one has its empty scene."""
    if scene.group != "empty":
        return VIEWS[number % 3]
    return "cut" if number % EMPTY_ROOMS == 0 else VIEWS[1 + number % 2]


def _bundled(scene: Scene, number: int) -> Scene:
    """Return the scene with bundled motions in place of mocap."""
    names = [f"bundled_{SUBJECT_MOTIONS[(number + k) % len(SUBJECT_MOTIONS)]}" for k in range(len(scene.actors))]
    actors = (replace(actor, clip=name, start=0.0) for actor, name in zip(scene.actors, names, strict=True))
    return replace(scene, actors=tuple(actors))


def chosen_scenes(split: str, groups: tuple[str, ...] = (), count: int | None = None) -> list[Scene]:
    """Return the scenes of a split, of some groups (default `GROUPS`), at most `count` of each."""
    found = scenes(split, groups or GROUPS)
    return [scene for group in groups or GROUPS for scene in [s for s in found if s.group == group][:count]]


def record_scene(scene: Scene, work: Path, frames: int | None = None, *, color: bool = False) -> Path:
    """Return the scene as a recording in `work` of at most `frames` frames, made if missing; optionally in colour."""
    made_by = (shot_of, people_of, distance_needed, _played, cut, in_place, spun, motion_of, clothes, proportions)
    folders = ["toolkit/simulation", "training/interiors", "toolkit/mocap", "toolkit/body"]
    frames = min(scene.frames, frames or scene.frames)
    path = work / "scenes" / f"{scene.name}_{digest_of(made_by, folders, astuple(scene), frames, color)}.npz"
    if not path.exists():
        people = people_of(scene, frames)
        shot = replace(shot_of(scene, people), seconds=frames / RATE, color=color)
        simulate_scene(people, path, shot)
    return path


def shot_of(scene: Scene, people: Sequence[SimulatedPerson]) -> CaptureSettings:
    """Return the render settings of a scene with these people."""
    distance = scene.distance
    if distance is None:
        (person,) = people
        distance = scene.spare * distance_needed(person, scene.sensor, scene.height)
    return CaptureSettings(
        sensor=scene.sensor, distance=distance, height=scene.height, tilt=scene.tilt, frame_rate=RATE,
        furnished=scene.view != "cut", background=scene.view == "background", boxes=scene.boxes,
        room=None if scene.room is None else around_people(scene.room), seed=scene.seed,
    )  # fmt: skip


def distance_needed(person: SimulatedPerson, sensor: str, height: float) -> float:
    """Return the smallest distance in metres, in steps of 10 cm, with the person's whole motion in the image.

    The camera is `height` metres above the floor and looks at the middle of the body as it stands.
    """
    performer, camera = prepare_person(person, RATE, np.random.default_rng(0)), make_sensor(sensor).camera
    body = performer.body
    joints = body.joint_positions(performer.poses).reshape(-1, 3)
    for distance in np.arange(1.8, 7.0, 0.1):
        tilt = float(np.arctan2(height - AIM_HEIGHT * body.height, distance))
        view = place_camera(distance=float(distance), height=height, tilt=tilt)
        seen = view.to_camera(joints)
        border = camera.fx * MARGIN / np.maximum(seen[:, 2], 1e-3)
        pixels = camera.project(seen)
        inside = (pixels >= border[:, None]) & (pixels <= np.array([camera.width, camera.height]) - 1 - border[:, None])
        if (seen[:, 2] > 0.8).all() and inside.all():
            return float(distance)
    return 7.0


def people_of(scene: Scene, frames: int, body: Body | None = None) -> list[SimulatedPerson]:
    """Return the actors with motions of at most `frames` frames; people who stay last as long as the longest motion.

    Their bodies are their own unless one is given for all of them.
    """
    cast = []
    for k, actor in enumerate(scene.actors):
        own = body or subject_body(actor.body, seed=scene.seed + 1000 * k)
        if actor.stature is not None:
            own = proportions.grown_to(own, actor.stature)
        late = min(round(actor.enters * RATE), frames // 2)
        poses = motion_of(actor.clip, own, seed=scene.seed, fast=scene.group == "fast").poses
        shortest = frames - late if actor.path in MOVED else SHORTEST
        cast.append((actor, own, late, cut(poses, actor.start, frames - late, shortest), poses))
    length = max((late + len(once) for _, _, late, once, _ in cast), default=0)
    people = []
    for actor, own, late, once, poses in cast:
        played = once if actor.path == "passes" else cut(poses, actor.start, length - late, shortest=length - late)
        played = spun(_played(actor, scene, played), actor.spin)
        at, yaw = actor.at, actor.yaw
        if actor.path in MOVED:
            at = (float(played[:, 0].mean()), float(played[:, 2].mean()))
            yaw = float(np.degrees(facing_of(played[0])))
        middle = (late + 0.5 * (length - late)) / RATE
        halves = {-1.0: (0.0, middle), 1.0: (middle, np.inf)}
        made = {field.name: getattr(actor, field.name) for field in fields(SimulatedPerson)}
        made |= {"clip": PoseClip(actor.clip, played, RATE, ""), "body": own}
        made |= {"at": at, "yaw": yaw, "enters": late / RATE}
        made["dress"] = partial(clothes.dressed, garments=actor.clothes) if actor.clothes else None
        made["holds"] = None if actor.carries is None else partial(held_mesh, actor.carries)
        if actor.path == "give":
            made["held"] = halves[actor.side]
        people.append(SimulatedPerson(**made))
    return people


MOVED = (*acts.PATHS, "hug", "give")
"""Paths that determine a person's place in each frame."""


def _played(actor: Actor, scene: Scene, poses: np.ndarray) -> np.ndarray:
    """Return poses (T, P) of an actor along the path, with the held object."""
    if actor.path not in ("walks", "passes"):
        poses = in_place(poses)
    if actor.carries is not None and actor.path != "give":
        poses = acts.with_arms(poses, actor.carries)
    if actor.path in ("hug", "give"):
        return acts.meeting(actor.path, actor.side, actor.at, poses)
    if actor.path in acts.PATHS:
        camera = make_sensor(scene.sensor).camera
        assert scene.distance is not None  # for people who enter from outside the image
        far = acts.out_of_sight(actor.side, actor.at[1], scene.distance, camera.cx / camera.fx)
        return acts.travelled(poses, *acts.path_of(actor.path, actor.at, far, len(poses)))
    return poses
