"""The suite of scenes: people as they are recorded, and rooms without people, with exact truth.

Seven groups: from the waist up, seated, behind furniture, several people (apart, crossing, touching, coming and going),
children and tilted cameras, clothes, and empty rooms. A third of those with people is already cut out, a third holds
the empty scene, a third neither. Seven more are of furnished rooms without their empty scene (`room_scenes`).

The splits share no actor and no body, and no actor is in the database of `toolkit.testing.suite`: `tune` is made of
HDM05 actor bk, `report`, for reporting only, of HDM05 actor dg and the CMU subjects 02 and 49. Where the mocap is
absent, bundled `subject` motions take its place.
"""

from __future__ import annotations

from dataclasses import astuple, replace
from pathlib import Path

import numpy as np

from toolkit.body.shape import subject_body
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SUBJECT_MOTIONS
from toolkit.simulation.furniture import Box
from toolkit.simulation.person import Person, facing_of, grown_to
from toolkit.simulation.sensors import make_sensor
from toolkit.simulation.simulate import Shot, simulate_scene
from toolkit.testing import acts, room_scenes, suite
from toolkit.testing.casting import Actor, Scene, one
from toolkit.testing.suite import RATE, SHORTEST, cut, digest_of, in_place, motion_of, spun

GROUPS = ("waist", "seated", "behind", "several", "children", "clothes", "empty")
VIEWS = ("cut", "background", "room")
"""Already cut out, in a room with its empty scene, in a room without it."""
BARRIER = Box((-0.5, 0.0, 0.5), (0.1, 1.05, 0.7))
"""What hides one side of a person up to the waist."""
ROOM_GROUPS = ("enter", "carry", "together", "crowd", "rooms", "stills", "vacant")
EMPTY_ROOMS, EMPTY_FRAMES = 10, 45
"""Recordings without people in each split, and their length."""


TUNE = (
    one("waist", "bk_rotateArms_005", "slim_male", 1.3, 1.35, 0),
    one("waist", "bk_throwBasketball_004", "heavy_female", 1.4, 1.2, 0, yaw=-25),
    one("waist", "bk_elbowToKnee_008", "tall_male", 1.4, 1.6, 4, yaw=15),
    one("waist", "bk_grabHigh_009", "average_female", 1.5, 1.25, 0, sensor="tof"),
    one("waist", "bk_throwBasketball_005", "teenager", 1.4, 1.15, 0, spin=180),
    one("waist", "bk_rotateArms_007", "neutral", 1.3, 1.45, 5, yaw=35),
    one("seated", "bk_throwBasketball_006", "slim_male", 2.0, 1.2, 8, seated=True),
    one("seated", "bk_rotateArms_006", "heavy_female", 1.6, 1.0, 3, seated=True, yaw=30, furniture=("stool",)),
    one("seated", "bk_grabHigh_010", "tall_male", 1.9, 1.5, 18, seated=True, furniture=("desk",)),
    one("seated", "bk_elbowToKnee_010", "teenager", 2.2, 1.8, 28, seated=True, yaw=-50),
    one("seated", "bk_throwBasketball_005", "average_female", 1.9, 1.3, 10, seated=True, furniture=("desk",), yaw=-15),
    one("seated", "bk_rotateArms_008", "neutral", 2.4, 1.0, 5, seated=True, yaw=75, sensor="tof"),
    one("behind", "bk_throwBasketball_004", "slim_male", 2.6, 1.4, None, furniture=("table",)),
    one("behind", "bk_elbowToKnee_009", "heavy_female", 2.4, 1.2, None, furniture=("crate",), yaw=20),
    one("behind", "bk_grabHigh_008", "tall_male", 2.8, 1.6, None, furniture=("desk",), sensor="tof"),
    one("behind", "bk_rotateArms_006", "average_female", 2.6, 1.3, None, boxes=(BARRIER,)),
    Scene("several", (
        Actor("bk_throwBasketball_005", "slim_male", (-0.6, 0.0)),
        Actor("bk_elbowToKnee_008", "heavy_female", (0.6, 0.1)),
    ), distance=3.2),
    Scene("several", (
        Actor("bk_rotateArms_005", "tall_male", (-1.0, 0.2)),
        Actor("bk_throwBasketball_004", "teenager", (0.1, -0.4)),
        Actor("bk_grabHigh_009", "average_female", (1.0, 0.2)),
    ), distance=3.5, height=1.5),
    Scene("several", (
        Actor("bk_sneak_004", "tall_male", (0.0, 0.45), 90, path="walks"),
        Actor("bk_sneak_005", "average_female", (0.0, -0.4), -90, path="walks"),
    ), distance=3.0, height=1.4),
    Scene("several", (
        Actor("bk_jog_007", "slim_male", (0.0, 0.9), 90, path="passes", enters=0.5),
        Actor("bk_throwBasketball_006", "teenager", (0.1, -0.6)),
    ), distance=3.4),
    Scene("several", (
        Actor("bk_grabHigh_010", "neutral", (-0.26, 0.0)),
        Actor("bk_rotateArms_007", "heavy_female", (0.28, -0.05)),
    ), distance=2.7),
    Scene("several", (
        Actor("bk_squat_013", "slim_male", (-0.7, 0.0), 40),
        Actor("bk_throwBasketball_004", "average_female", (-0.05, -0.25), -20),
        Actor("bk_rotateArms_005", "child", (0.55, 0.15), -30, stature=1.1),
    ), distance=3.2, height=1.6, sensor="tof"),
    one("children", "bk_throwBasketball_006", "child", 2.0, 1.4, None, stature=1.05),
    one("children", "bk_squat_015", "child", 1.8, 2.0, 38, stature=0.85, yaw=20),
    one("children", "bk_elbowToKnee_011", "tall_male", 2.4, 2.4, 32, yaw=-20),
    one("children", "bk_grabHigh_009", "heavy_female", 2.2, 0.5, -12, sensor="tof"),
    one("clothes", "bk_rotateArms_006", "average_female", 2.5, 1.2, None, clothes=("skirt",)),
    one("clothes", "bk_throwBasketball_004", "heavy_female", 2.6, 1.3, None, clothes=("dress",), yaw=30),
    one("clothes", "bk_kick_009", "tall_male", 2.8, 1.1, None, clothes=("coat",)),
    one("clothes", "bk_elbowToKnee_012", "slim_male", 2.6, 1.5, None, clothes=("wide_trousers",), sensor="tof"),
)  # fmt: skip
REPORT = (
    one("waist", "dg_rotateArms_009", "athletic_male", 1.3, 1.4, 2),
    one("waist", "02_07", "average_male", 1.4, 1.3, 0, yaw=-20, start=4.0),
    one("waist", "dg_throwBasketball_008", "slim_female", 1.3, 1.4, 5, yaw=20),
    one("waist", "49_10", "short_female", 1.5, 1.2, 0, start=2.0, sensor="tof"),
    one("waist", "02_05", "heavy_male", 1.4, 1.4, 2, start=3.0, spin=-200),
    one("waist", "dg_grabHigh_015", "elderly", 1.3, 1.25, 0, yaw=-40),
    one("seated", "dg_throwBasketball_007", "athletic_male", 1.9, 1.3, 12, seated=True),
    one("seated", "02_06", "heavy_male", 1.7, 1.1, 3, seated=True, furniture=("stool",), yaw=-30, start=5.0),
    one("seated", "dg_grabHigh_014", "short_female", 1.9, 1.4, 16, seated=True, furniture=("desk",)),
    one("seated", "02_08", "slim_female", 2.1, 1.9, 30, seated=True, yaw=45, start=2.0),
    one("seated", "49_11", "average_male", 2.0, 1.3, 10, seated=True, furniture=("desk",), yaw=20, start=1.0),
    one("seated", "dg_elbowToKnee_016", "elderly", 2.5, 1.1, 5, seated=True, yaw=-70, sensor="tof"),
    one("behind", "dg_throwBasketball_009", "average_male", 2.5, 1.4, None, furniture=("table",), yaw=-15),
    one("behind", "02_05", "short_female", 2.4, 1.2, None, furniture=("crate",), start=6.0),
    one("behind", "49_12", "heavy_male", 2.8, 1.6, None, furniture=("desk",), start=1.0, sensor="tof"),
    one("behind", "dg_rotateArms_010", "slim_female", 2.6, 1.3, None, boxes=(BARRIER,)),
    Scene("several", (
        Actor("dg_throwBasketball_008", "athletic_male", (-0.65, 0.1)),
        Actor("49_10", "short_female", (0.6, 0.0), start=2.0),
    ), distance=3.3),
    Scene("several", (
        Actor("02_07", "heavy_male", (-1.0, 0.1), start=4.0),
        Actor("dg_elbowToKnee_016", "slim_female", (0.0, -0.4)),
        Actor("dg_grabHigh_014", "elderly", (1.0, 0.3)),
    ), distance=3.6, height=1.4),
    Scene("several", (
        Actor("02_01", "average_male", (0.0, 0.45), 90, path="passes"),
        Actor("dg_sneak_007", "slim_female", (0.0, -0.4), -90, path="walks"),
    ), distance=3.1, height=1.5),
    Scene("several", (
        Actor("02_02", "athletic_male", (0.0, 0.4), -90, path="passes", enters=0.6),
        Actor("49_03", "short_female", (0.0, -0.7), start=3.0),
    ), distance=3.3),
    Scene("several", (
        Actor("dg_grabHigh_015", "elderly", (-0.27, 0.0)),
        Actor("49_11", "average_male", (0.27, -0.05), start=1.0),
    ), distance=2.7),
    Scene("several", (
        Actor("dg_squat_027", "athletic_male", (-0.7, 0.1), 35),
        Actor("02_05", "short_female", (0.0, -0.25), -10, start=3.0),
        Actor("dg_rotateArms_009", "child", (0.6, 0.15), -30, stature=1.15),
    ), distance=3.3, height=1.6, sensor="tof"),
    one("children", "02_07", "child", 2.0, 1.5, None, stature=1.0, start=4.0),
    one("children", "dg_squat_034", "child", 1.8, 2.1, 40, stature=0.8, yaw=-20),
    one("children", "dg_throwBasketball_007", "average_male", 2.4, 2.5, 34, yaw=25),
    one("children", "49_12", "short_female", 2.2, 0.5, -14, start=1.0, sensor="tof"),
    one("clothes", "dg_rotateArms_010", "slim_female", 2.5, 1.3, None, clothes=("skirt",)),
    one("clothes", "02_05", "short_female", 2.6, 1.2, None, clothes=("dress",), yaw=-30, start=3.0),
    one("clothes", "dg_kick_016", "heavy_male", 2.8, 1.1, None, clothes=("coat",)),
    one("clothes", "dg_elbowToKnee_016", "average_male", 2.6, 1.5, None, clothes=("wide_trousers",), sensor="tof"),
)  # fmt: skip

PIECES = ((0.35, 1.75, 0.35), (0.85, 0.9, 0.8), (0.8, 2.0, 0.35), (1.2, 0.74, 0.7), (0.3, 1.3, 0.3), (0.5, 0.5, 0.5))
"""Width, height and depth in metres of what stands in an empty room: a coat stand, an armchair, a shelf, ..."""


def _empty_rooms(split: str) -> tuple[Scene, ...]:
    """Rooms with three to six things that stand apart from each other; the camera is anywhere."""
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
        rooms.append(Scene("empty", (), sensor, distance, height, tilt, tuple(boxes), frames=EMPTY_FRAMES))
    return tuple(rooms)


def _touch(first: Box, second: Box) -> bool:
    return all(first.low[k] < second.high[k] and second.low[k] < first.high[k] for k in (0, 2))


def scenes(split: str, groups: tuple[str, ...] = GROUPS) -> tuple[Scene, ...]:
    """The scenes of `tune` or `report`, each with its view and seed; of bundled motions where there is no mocap."""
    base = 0 if split == "tune" else 100
    chosen = [*{"tune": TUNE, "report": REPORT}[split], *_empty_rooms(split)]
    found = [replace(scene, seed=base + i, view=_view(scene, i)) for i, scene in enumerate(chosen)]
    furnished = {"tune": room_scenes.TUNE, "report": room_scenes.REPORT}[split]
    found += [replace(scene, seed=base + 200 + i, view="room") for i, scene in enumerate(furnished)]
    if not suite.has_mocap():
        found = [_bundled(scene, scene.seed) for scene in found]
    return tuple(scene for scene in found if scene.group in groups)


def _view(scene: Scene, number: int) -> str:
    """The three views in turn; of empty rooms one is cut out, and every other one holds its empty scene."""
    if scene.group != "empty":
        return VIEWS[number % 3]
    return "cut" if number % EMPTY_ROOMS == 0 else VIEWS[1 + number % 2]


def _bundled(scene: Scene, number: int) -> Scene:
    """The scene with bundled motions instead of mocap."""
    names = [f"bundled_{SUBJECT_MOTIONS[(number + k) % len(SUBJECT_MOTIONS)]}" for k in range(len(scene.actors))]
    actors = (replace(actor, motion=name, start=0.0) for actor, name in zip(scene.actors, names, strict=True))
    return replace(scene, actors=tuple(actors))


def chosen_scenes(split: str, groups: tuple[str, ...] = (), count: int | None = None) -> list[Scene]:
    """Scenes of a split, of some groups only (of `GROUPS` unless they are named), and of each group at most `count`."""
    found = scenes(split, groups or GROUPS)
    return [scene for group in groups or GROUPS for scene in [s for s in found if s.group == group][:count]]


def record_scene(scene: Scene, work: Path, frames: int | None = None) -> Path:
    """The scene as a recording in `work`, of at most `frames` frames, made if it is not there yet."""
    made_by = (record_scene, _people, _played, cut, in_place, spun, motion_of)
    frames = min(scene.frames, frames or scene.frames)
    digest = digest_of(
        made_by, ["toolkit/simulation", "toolkit/interiors", "toolkit/mocap", "toolkit/body"], astuple(scene), frames
    )
    path = work / "scenes" / f"{scene.name}_{digest}.npz"
    if not path.exists():
        shot = Shot(
            sensor=scene.sensor, distance=scene.distance, height=scene.height, tilt=scene.tilt, frame_rate=RATE,
            furnished=scene.view != "cut", background=scene.view == "background", boxes=scene.boxes,
            room=scene.room, seconds=frames / RATE, seed=scene.seed,
        )  # fmt: skip
        simulate_scene(_people(scene, frames), path, shot)
    return path


def _people(scene: Scene, frames: int) -> list[Person]:
    """The actors with their bodies and motions; who does not pass stays as long as the longest motion lasts."""
    cast = []
    for k, actor in enumerate(scene.actors):
        body = subject_body(actor.body, seed=scene.seed + 1000 * k)
        if actor.stature is not None:
            body = grown_to(body, actor.stature)
        late = min(round(actor.enters * RATE), frames // 2)
        poses = motion_of(actor.motion, body, seed=scene.seed).poses
        shortest = frames - late if actor.path in MOVED else SHORTEST
        cast.append((actor, body, late, cut(poses, actor.start, frames - late, shortest), poses))
    length = max((late + len(once) for _, _, late, once, _ in cast), default=0)
    people = []
    for actor, body, late, once, poses in cast:
        played = once if actor.path == "passes" else cut(poses, actor.start, length - late, shortest=length - late)
        played = spun(_played(actor, scene, played), actor.spin)
        at, yaw = actor.at, actor.yaw
        if actor.path in MOVED:
            at = (float(played[:, 0].mean()), float(played[:, 2].mean()))
            yaw = float(np.degrees(facing_of(played[0])))
        middle = (late + 0.5 * (length - late)) / RATE
        halves = {-1.0: (0.0, middle), 1.0: (middle, np.inf)}
        people.append(
            Person(
                PoseClip(actor.motion, played, RATE, ""),
                body,
                at,
                yaw,
                seated=actor.seated,
                furniture=actor.furniture,
                clothes=actor.clothes,
                enters=late / RATE,
                holds=actor.holds,
                held=halves[actor.side] if actor.path == "give" else (0.0, np.inf),
            )  # fmt: skip
        )
    return people


MOVED = (*acts.PATHS, "hug", "give")
"""Paths that say where a person is in every frame."""


def _played(actor: Actor, scene: Scene, poses: np.ndarray) -> np.ndarray:
    """Poses (T, P) of an actor as their path and what they hold have it."""
    if actor.path not in ("walks", "passes"):
        poses = in_place(poses)
    if actor.holds is not None and actor.path != "give":
        poses = acts.with_arms(poses, actor.holds)
    if actor.path in ("hug", "give"):
        return acts.meeting(actor.path, actor.side, actor.at, poses)
    if actor.path in acts.PATHS:
        camera = make_sensor(scene.sensor).camera
        far = acts.out_of_sight(actor.side, actor.at[1], scene.distance, camera.cx / camera.fx)
        return acts.travelled(poses, *acts.path_of(actor.path, actor.at, far, len(poses)))
    return poses
