"""The suite of upper bodies: people seen from the waist up, with exact truth.

Six groups: cut by the image, behind a desk, on a chair, near the camera (hands within half a metre), wide (raised arms
leave the image) and turned. The camera is aimed so that the image ends `CUT` below the neck. The splits share no actor,
no motion and no body, and no actor is in the database of `toolkit.testing.suite`: `tune` is made of HDM05 actor bk,
`report`, for reporting only, of HDM05 actor dg and the CMU subject 02, both with bundled `subject` motions. Where the
mocap is absent, these take its place. Two more groups are asked for by name: arms that cross the body, are folded or
touch the head, and laps in view.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.body.shape import subject_body
from toolkit.mocap.procedural import SUBJECT_MOTIONS
from toolkit.simulation.scene import cut_tilt
from toolkit.simulation.seating import neck_height
from toolkit.simulation.sensors import make_sensor
from toolkit.testing import suite
from toolkit.testing.casting import Actor, Scene

GROUPS = ("cut", "desk", "chair", "camera", "wide", "turned")
MORE = ("crossing", "lap")
"""Groups that are no part of the suite's figures."""
CUT = 0.45
"""Metres below the neck at which the image ends: at the waist."""
CUTS = {"lap": 0.95}
"""Where it ends in other groups: below a lap."""
ABOVE = 0.05
"""Metres by which the camera stands above the neck."""


def _take(
    group: str, motion: str, body: str, distance: float, *, view: str = "cut", above: float = ABOVE, **actor: object
) -> Scene:
    """One take; `above` is how far the camera is above the neck, metres, further names are those of `Actor`."""
    people = (Actor(motion, body, **actor),)  # type: ignore[arg-type]
    return Scene(group, people, distance=distance, height=above, view=view)


TUNE = (
    _take("cut", "bk_rotateArms_005", "slim_male", 1.4),
    _take("cut", "bundled_conduct", "average_female", 1.3),
    _take("desk", "bk_throwBasketball_006", "heavy_female", 1.5, view="background", seated=True, furniture=("desk",)),
    _take("desk", "bundled_sit_and_drink", "tall_male", 1.4, view="background", seated=True, furniture=("desk",)),
    _take("chair", "bk_grabHigh_010", "average_male", 1.6, seated=True),
    _take("chair", "bundled_sit_and_read", "slim_female", 1.4, view="background", seated=True),
    _take("camera", "bk_throwBasketball_004", "teenager", 1.15, above=0.2),
    _take("camera", "bundled_half_squat_reach", "heavy_male", 1.2),
    _take("wide", "bk_rotateArms_007", "tall_male", 1.2),
    _take("wide", "bundled_semaphore", "short_female", 1.2),
    _take("turned", "bk_elbowToKnee_008", "athletic_male", 1.5, yaw=35),
    _take("turned", "bk_throwBasketball_005", "elderly", 1.5, yaw=-40),
    _take("crossing", "bundled_hand_to_mouth", "average_male", 1.4),
    _take("crossing", "bundled_hands_to_head", "slim_female", 1.4),
    _take("lap", "bundled_sit_and_drink", "short_female", 2.0, view="background", seated=True, furniture=("chair",)),
    _take("lap", "bundled_sit_and_read", "heavy_male", 2.0, seated=True, furniture=("chair",)),
)
REPORT = (
    _take("cut", "dg_rotateArms_009", "athletic_male", 1.4),
    _take("cut", "02_05", "slim_female", 1.5, start=3.0),
    _take("desk", "dg_throwBasketball_007", "average_male", 1.5, view="background", seated=True, furniture=("desk",)),
    _take("desk", "bundled_sit_and_point", "heavy_female", 1.4, view="background", seated=True, furniture=("desk",)),
    _take("chair", "dg_grabHigh_014", "short_female", 1.6, seated=True),
    _take("chair", "bundled_sit_and_wave", "tall_male", 1.5, view="background", seated=True),
    _take("camera", "dg_throwBasketball_008", "average_female", 1.15, above=0.2),
    _take("camera", "02_07", "heavy_male", 1.3, start=4.0),
    _take("wide", "dg_rotateArms_010", "slim_male", 1.2),
    _take("wide", "bundled_archery", "teenager", 1.2),
    _take("turned", "02_06", "elderly", 1.5, yaw=40, start=5.0),
    _take("turned", "dg_throwBasketball_009", "athletic_male", 1.5, yaw=-35),
    _take("crossing", "bundled_arms_crossed", "tall_male", 1.4),
    _take("crossing", "bundled_reach_across", "average_female", 1.4),
    _take("lap", "bundled_sit_and_stretch", "slim_male", 2.0, view="background", seated=True, furniture=("chair",)),
    _take("lap", "bundled_sit_and_wave", "heavy_female", 2.0, seated=True, furniture=("chair",)),
)


def upper_scenes(split: str, groups: tuple[str, ...] = GROUPS, count: int | None = None) -> list[Scene]:
    """The takes of `tune` or `report`, of some groups only, and of each group at most `count`."""
    base = 0 if split == "tune" else 100
    numbered = list(enumerate({"tune": TUNE, "report": REPORT}[split], start=base))
    chosen = [own for group in groups for own in [own for own in numbered if own[1].group == group][:count]]
    return [_aimed(scene, seed) for seed, scene in chosen]


def _aimed(scene: Scene, seed: int) -> Scene:
    """The scene with its seed, and the camera's height and tilt, which depend on the body."""
    (actor,) = scene.actors
    if not suite.has_mocap() and not actor.motion.startswith("bundled"):
        actor = replace(actor, motion=f"bundled_{SUBJECT_MOTIONS[seed % len(SUBJECT_MOTIONS)]}", start=0.0)
    body = subject_body(actor.body, seed=seed)
    neck = neck_height(body, seated=actor.seated)
    height = neck + scene.height
    tilt = cut_tilt(make_sensor(scene.sensor).camera, height, scene.distance, neck - CUTS.get(scene.group, CUT))
    return replace(scene, actors=(actor,), seed=seed, height=height, tilt=float(np.degrees(tilt)))
