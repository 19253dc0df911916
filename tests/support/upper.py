"""Suite of upper bodies: people seen from the waist up, with exact truth.

Six groups: cut by the image, behind a desk, on a chair, near the camera (hands within half a metre), wide (raised arms
leave the image) and turned. The camera is aimed so that the image ends `CUT` below the neck. The splits share no actor,
no motion and no body, and no actor is in the database of `tests.support.suite`: `tune` is made of HDM05 actor bk,
`report`, for reporting only, of HDM05 actor dg and the CMU subject 02, both with bundled `subject` motions. Where the
mocap is absent, these take its place. Two more groups are asked for by name: arms that cross the body, are folded or
touch the head, and laps in view.
"""

from dataclasses import replace

import numpy as np

from tests.support import suite
from tests.support.casting import Scene, listed
from toolkit.body.shape import subject_body
from toolkit.mocap.procedural import SUBJECT_MOTIONS
from toolkit.simulation.scene import cut_tilt
from toolkit.simulation.seating import neck_height
from toolkit.simulation.sensors import make_sensor

GROUPS = ("cut", "desk", "chair", "camera", "wide", "turned")
CUT = 0.45
"""Metres below the neck at which the image ends (waist)."""
CUTS = {"lap": 0.95}
"""The same for other groups: below a lap."""


def upper_scenes(split: str, groups: tuple[str, ...] = GROUPS, count: int | None = None) -> list[Scene]:
    """Return the takes of `tune` or `report`, of some groups, at most `count` of each."""
    base = 0 if split == "tune" else 100
    numbered = list(enumerate(listed("upper", split), start=base))
    chosen = [own for group in groups for own in [own for own in numbered if own[1].group == group][:count]]
    return [_aimed(scene, seed) for seed, scene in chosen]


def _aimed(scene: Scene, seed: int) -> Scene:
    """Return the scene with its seed, and the camera's height and tilt for the body."""
    actor = scene.actor
    if not suite.has_mocap() and not actor.clip.startswith("bundled"):
        actor = replace(actor, clip=f"bundled_{SUBJECT_MOTIONS[seed % len(SUBJECT_MOTIONS)]}", start=0.0)
    body = subject_body(actor.body, seed=seed)
    neck = neck_height(body, seated=actor.seated)
    height = neck + scene.height
    assert scene.distance is not None
    tilt = cut_tilt(make_sensor(scene.sensor).camera, height, scene.distance, neck - CUTS.get(scene.group, CUT))
    return replace(scene, actors=(actor,), seed=seed, height=height, tilt=float(np.degrees(tilt)))
