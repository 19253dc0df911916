"""Scenes of people in furnished rooms: they come and go, carry things, embrace, stand in crowds; stills; no person.

Every room is another one. What is looked for: a person cut by the border as they enter; a thing that is no part of
a person who carries it; two people who are one surface; four to six people; cameras 0.8 to 2.5 m above the floor; one
frame alone; and rooms in which no person ever is.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from toolkit.testing.casting import Actor, Scene, one

PASSING, VACANT = 120, 300
"""Frames of scenes in which a person comes and goes, and of rooms without people."""
PASSES = {"frames": PASSING}
KINDS = ("office", "living", "classroom", "corridor")


def _pair(
    path: str, first: tuple[str, str], second: tuple[str, str], room: str, camera: tuple[float, float, float]
) -> Scene:
    """Two people, motion and body each, who meet before a camera (distance, height, tilt); who gives has a box."""
    holds = "box" if path == "give" else None
    actors = tuple(
        Actor(motion, body, path=path, side=side, holds=holds)
        for (motion, body), side in zip((first, second), (-1.0, 1.0), strict=True)
    )
    distance, height, tilt = camera
    return Scene("together", actors, distance=distance, height=height, tilt=tilt, room=room, frames=PASSING)


def _crowd(people: tuple[tuple[str, str, float, float, float], ...], room: str, **scene: float) -> Scene:
    """People by motion, body, place (x, z) and yaw."""
    actors = tuple(Actor(motion, body, (x, z), yaw) for motion, body, x, z, yaw in people)
    return Scene("crowd", actors, room=room, **scene)  # type: ignore[arg-type]


Still = tuple[str, str, float, float, float, str, dict[str, Any]]


def _stills(rows: tuple[Still, ...]) -> tuple[Scene, ...]:
    """Scenes of one frame by motion, body, distance, height, tilt, room, and what else is of the actor."""
    return tuple(
        one("stills", motion, body, distance, height, tilt, room=room, frames=1, **more)
        for motion, body, distance, height, tilt, room, more in rows
    )


def _vacant(first: int) -> tuple[Scene, ...]:
    """Ten rooms without people, cameras from 0.5 to 2.5 m above the floor."""
    rooms = []
    for i in range(10):
        rng = np.random.default_rng([first, i])
        height = float(rng.uniform(0.5, 2.5))
        tilt = float(np.clip(14.0 * (height - 1.2) + rng.normal(0.0, 4.0), -8.0, 35.0))
        distance = float(rng.uniform(2.0, 4.0))
        room = f"{KINDS[i % 4]}:{first + i}"
        sensor = "tof" if i % 3 == 2 else "kinect"
        rooms.append(Scene("vacant", (), sensor, distance, height, tilt, room=room, frames=VACANT))
    return tuple(rooms)


TUNE = (
    one("enter", "bk_sneak_004", "slim_male", 2.8, 1.4, 6, path="crosses", room="office:21", **PASSES),
    one("enter", "bk_sneak_005", "heavy_female", 2.6, 2.3, 25, path="comes", room="classroom:22", **PASSES),
    one("enter", "bk_sneak_004", "tall_male", 2.5, 0.9, -3, path="visits", side=1.0, room="living:23", **PASSES),
    Scene("enter", (
        Actor("bk_throwBasketball_004", "average_female", (-0.5, -0.3)),
        Actor("bk_sneak_005", "teenager", (0.5, 0.2), path="visits", side=1.0),
    ), distance=3.2, height=1.6, tilt=10, room="office:24", frames=PASSING),
    one("carry", "bk_sneak_004", "slim_male", 2.6, 1.4, 7, holds="box", room="office:31"),
    one("carry", "bk_grabHigh_009", "heavy_female", 2.2, 1.3, 6, holds="tablet", room="corridor:32"),
    one("carry", "bk_sneak_005", "tall_male", 2.9, 1.8, 14, holds="bag", path="crosses", room="living:33", **PASSES),
    one("carry", "bk_squat_013", "average_female", 2.5, 1.1, 3, holds="box", room="classroom:34", yaw=35),
    _pair("hug", ("bundled_conduct", "slim_male"), ("bundled_semaphore", "average_female"), "living:41", (2.7, 1.4, 6)),
    _pair("hug", ("bundled_semaphore", "tall_male"), ("bundled_conduct", "heavy_female"), "office:42", (2.8, 2.2, 24)),
    _pair("give", ("bundled_conduct", "teenager"), ("bk_rotateArms_006", "tall_male"), "classroom:43", (2.8, 1.5, 8)),
    _crowd((
        ("bk_throwBasketball_004", "slim_male", -1.2, 0.1, 10), ("bk_rotateArms_005", "heavy_female", -0.4, -0.5, 0),
        ("bk_grabHigh_009", "tall_male", 0.4, 0.3, -20), ("bk_elbowToKnee_008", "average_female", 1.2, -0.2, 0),
    ), "office:51", distance=3.6, height=1.5, tilt=8),
    _crowd((
        ("bk_rotateArms_006", "tall_male", -1.5, -0.4, 30), ("bk_throwBasketball_005", "teenager", -0.8, 0.3, 0),
        ("bk_squat_013", "slim_male", -0.1, -0.6, 0), ("bk_grabHigh_010", "average_female", 0.6, 0.2, -10),
        ("bk_elbowToKnee_009", "heavy_female", 1.4, -0.3, -40),
    ), "classroom:52", distance=4.0, height=2.2, tilt=20),
    _crowd((
        ("bk_rotateArms_007", "slim_male", -1.5, 0.0, 30), ("bk_throwBasketball_006", "teenager", -0.9, -0.8, 0),
        ("bk_grabHigh_008", "average_female", -0.3, 0.2, 0), ("bk_elbowToKnee_010", "tall_male", 0.4, -0.6, 10),
        ("bk_squat_015", "neutral", 0.9, 0.3, -20), ("bk_rotateArms_008", "heavy_female", 1.6, -0.4, -40),
    ), "office:53", distance=4.2, height=1.9, tilt=13),
    one("rooms", "bk_throwBasketball_006", "slim_male", 2.6, 0.8, -4, room="office:61"),
    one("rooms", "bk_grabHigh_010", "heavy_female", 2.6, 2.5, 30, room="living:62"),
    one("rooms", "bk_elbowToKnee_011", "tall_male", 3.0, 1.6, 10, room="corridor:63"),
    one("rooms", "bk_rotateArms_006", "teenager", 2.4, 1.2, 8, room="classroom:64", seated=True, furniture=("desk",)),
    one("rooms", "bk_throwBasketball_005", "average_female", 2.2, 2.0, 25, room="office:65", seated=True, yaw=40),
    one("rooms", "bk_squat_014", "neutral", 3.2, 2.3, 25, room="classroom:66", sensor="tof"),
    *_stills((
        ("bk_throwBasketball_004", "slim_male", 2.6, 1.4, 6, "office:71", {}),
        ("bk_rotateArms_005", "heavy_female", 1.6, 1.2, 4, "living:72", {"seated": True}),
        ("bk_grabHigh_009", "tall_male", 3.0, 2.2, 22, "classroom:73", {}),
        ("bk_elbowToKnee_008", "average_female", 2.0, 0.9, 0, "office:74", {"yaw": 60}),
        ("bk_rotateArms_008", "teenager", 2.2, 1.5, 10, "corridor:75", {"yaw": 180}),
        ("bk_throwBasketball_006", "neutral", 1.8, 1.3, 6, "office:76", {"seated": True, "furniture": ("desk",)}),
    )),
    *_vacant(200),
)  # fmt: skip
REPORT = (
    one("enter", "02_01", "athletic_male", 2.8, 1.5, 7, path="crosses", room="office:121", **PASSES),
    one("enter", "02_02", "short_female", 2.6, 2.4, 27, path="comes", room="classroom:122", side=1.0, **PASSES),
    one("enter", "02_01", "heavy_male", 2.5, 1.0, -2, path="visits", room="living:123", **PASSES),
    Scene("enter", (
        Actor("dg_throwBasketball_008", "slim_female", (0.5, -0.3)),
        Actor("02_02", "average_male", (-0.5, 0.2), path="visits"),
    ), distance=3.2, height=1.7, tilt=11, room="office:124", frames=PASSING),
    one("carry", "02_01", "average_male", 2.6, 1.5, 8, holds="box", room="office:131"),
    one("carry", "dg_grabHigh_014", "slim_female", 2.2, 1.2, 5, holds="tablet", room="corridor:132"),
    one("carry", "02_02", "heavy_male", 2.9, 1.9, 15, holds="bag", path="crosses", room="living:133", **PASSES),
    one("carry", "dg_squat_027", "short_female", 2.5, 1.2, 4, holds="box", room="classroom:134", yaw=-35),
    _pair("hug", ("bundled_semaphore", "athletic_male"), ("bundled_conduct", "slim_female"), "living:141", (2.7, 1.5, 7)
    ),
    _pair("hug", ("bundled_conduct", "elderly"), ("bundled_semaphore", "heavy_male"), "office:142", (2.8, 2.3, 25)),
    _pair("give", ("bundled_conduct", "short_female"), ("dg_rotateArms_009", "elderly"), "office:143", (2.8, 1.6, 9)),
    _crowd((
        ("dg_throwBasketball_007", "athletic_male", -1.2, 0.0, 10), ("02_05", "short_female", -0.4, -0.5, 0),
        ("dg_grabHigh_014", "heavy_male", 0.4, 0.3, -20), ("49_10", "slim_female", 1.2, -0.2, 0),
    ), "office:151", distance=3.6, height=1.6, tilt=9),
    _crowd((
        ("dg_rotateArms_009", "average_male", -1.5, -0.3, 30), ("02_07", "elderly", -0.8, 0.3, 0),
        ("dg_squat_028", "athletic_male", -0.1, -0.6, 0), ("49_11", "slim_female", 0.6, 0.2, -10),
        ("dg_elbowToKnee_016", "heavy_male", 1.4, -0.3, -40),
    ), "classroom:152", distance=4.0, height=2.3, tilt=21),
    _crowd((
        ("dg_rotateArms_010", "slim_female", -1.5, 0.0, 30), ("dg_throwBasketball_009", "average_male", -0.9, -0.8, 0),
        ("dg_grabHigh_015", "short_female", -0.3, 0.2, 0), ("02_06", "heavy_male", 0.4, -0.6, 10),
        ("dg_squat_029", "athletic_male", 0.9, 0.3, -20), ("49_12", "elderly", 1.6, -0.4, -40),
    ), "office:153", distance=4.2, height=2.0, tilt=14),
    one("rooms", "dg_throwBasketball_008", "athletic_male", 2.6, 0.8, -4, room="office:161"),
    one("rooms", "dg_grabHigh_015", "short_female", 2.6, 2.5, 30, room="living:162"),
    one("rooms", "dg_elbowToKnee_016", "average_male", 3.0, 1.7, 11, room="corridor:163"),
    one("rooms", "02_07", "slim_female", 2.4, 1.3, 9, room="classroom:164", seated=True, furniture=("desk",)),
    one("rooms", "dg_throwBasketball_007", "heavy_male", 2.2, 2.1, 26, room="office:165", seated=True, yaw=-40),
    one("rooms", "dg_squat_030", "elderly", 3.2, 2.2, 24, room="classroom:166", sensor="tof"),
    *_stills((
        ("dg_throwBasketball_007", "athletic_male", 2.6, 1.5, 7, "office:171", {}),
        ("dg_rotateArms_009", "short_female", 1.6, 1.1, 3, "living:172", {"seated": True}),
        ("02_05", "heavy_male", 3.0, 2.3, 23, "classroom:173", {"start": 3.0}),
        ("dg_elbowToKnee_016", "slim_female", 2.0, 1.0, 1, "office:174", {"yaw": -60}),
        ("49_10", "average_male", 2.2, 1.6, 11, "corridor:175", {"yaw": 180, "start": 2.0}),
        ("02_08", "elderly", 1.8, 1.2, 5, "office:176", {"seated": True, "furniture": ("desk",), "start": 2.0}),
    )),
    *_vacant(300),
)  # fmt: skip
