"""Key poses of the procedural motions, in the controls that `procedural.poses_from_controls` explains (degrees)."""

from __future__ import annotations

from toolkit.mocap.motion import Motion, both, left, right
from toolkit.mocap.seated import SEATED, SEATED_SUBJECT


def _base() -> dict[str, float]:
    base = dict.fromkeys(("yaw", "pitch", "bend", "lean", "turn", "nod", "tilt", "look", "hop"), 0.0)
    return base | both(lift=10, plane=20, roll=0, elbow=12, flex=4, open=4, toe=6, knee=8, point=0, spread=0)


BASE: dict[str, float] = _base()
"""Standing at ease: every control and its value."""


def _ranges() -> dict[str, tuple[float, float]]:
    ranges = {
        "bend": (-10.0, 45.0), "lean": (-20.0, 20.0), "turn": (-35.0, 35.0),
        "nod": (-20.0, 30.0), "tilt": (-15.0, 15.0), "look": (-45.0, 45.0),
    }  # fmt: skip
    one_side = {
        "lift": (5, 165),
        "plane": (-25, 115),
        "roll": (-35, 35),
        "elbow": (5, 130),
        "flex": (-15, 80),
        "open": (0, 30),
    }
    for side in ("left", "right"):
        ranges |= {f"{side}_{name}": (float(low), float(high)) for name, (low, high) in one_side.items()}
    return ranges


LIMITS: dict[str, tuple[float, float]] = _ranges()
"""Natural ranges of random poses; the other controls keep their base values (knees follow the hips)."""

REST: dict[str, float] = {}

DATABASE: dict[str, Motion] = {
    "idle": Motion(((0.0, {"lean": 4}), (0.5, {"lean": -4, "look": 20})), 3.0, 1),
    "walk": Motion(
        (
            (
                0.0,
                left(flex=28, knee=8, point=-10)
                | right(flex=-18, knee=12, point=25)
                | left(plane=-30, lift=22)
                | right(plane=80, lift=28, elbow=25),
            ),
            (0.25, left(flex=6, knee=12) | right(flex=22, knee=58, point=12)),
            (
                0.5,
                right(flex=28, knee=8, point=-10)
                | left(flex=-18, knee=12, point=25)
                | right(plane=-30, lift=22)
                | left(plane=80, lift=28, elbow=25),
            ),
            (0.75, right(flex=6, knee=12) | left(flex=22, knee=58, point=12)),
        ),
        1.2,
        4,
    ),
    "march": Motion(
        (
            (0.0, left(flex=75, knee=85, lift=25, plane=-40) | right(lift=55, plane=85, elbow=70)),
            (0.25, REST),
            (0.5, right(flex=75, knee=85, lift=25, plane=-40) | left(lift=55, plane=85, elbow=70)),
            (0.75, REST),
        ),
        1.2,
        3,
    ),
    "wave": Motion(
        ((0.0, right(lift=80, plane=15, roll=75, elbow=95)), (0.5, right(lift=105, plane=15, roll=75, elbow=45))),
        1.0,
        4,
        sided=True,
    ),
    "raise_sideways": Motion(((0.0, both(lift=90, plane=0, elbow=5)), (0.5, REST))),
    "raise_forward": Motion(((0.0, both(lift=90, plane=88, elbow=5)), (0.5, REST))),
    "raise_overhead": Motion(
        ((0.0, both(lift=90, plane=10, elbow=8)), (0.3, both(lift=170, plane=10, elbow=8)), (0.65, REST)), 2.6
    ),
    "raise_one_forward": Motion(
        ((0.0, right(lift=95, plane=85, elbow=6)), (0.4, right(lift=165, plane=70)), (0.7, REST)), sided=True
    ),
    "raise_one_sideways": Motion(
        ((0.0, right(lift=90, plane=0, elbow=6)), (0.4, right(lift=160, plane=5)), (0.7, REST)), sided=True
    ),
    "arm_circles": Motion(
        (
            (0.0, both(lift=90, plane=85, elbow=8)),
            (0.25, both(lift=168, plane=50, elbow=8)),
            (0.5, both(lift=95, plane=-15, elbow=8)),
            (0.75, both(lift=30, plane=20, elbow=8)),
        ),
        2.2,
        3,
    ),
    "boxing": Motion(
        (
            (0.0, right(lift=92, plane=95, elbow=8) | {"turn": 25}),
            (0.25, REST),
            (0.5, left(lift=92, plane=95, elbow=8) | {"turn": -25}),
            (0.75, REST),
        ),
        1.3,
        4,
        hold=both(lift=38, plane=75, elbow=128) | left(flex=18) | right(flex=-6) | both(knee=18) | {"bend": 8},
    ),
    "hook_punch": Motion(
        (
            (0.0, right(lift=82, plane=60, elbow=85) | {"turn": 30}),
            (0.4, right(lift=70, plane=-5, elbow=100) | {"turn": -20}),
        ),
        1.4,
        3,
        hold=both(lift=38, plane=75, elbow=125) | {"bend": 8},
        sided=True,
    ),
    "kick_front": Motion(
        (
            (0.0, right(flex=60, knee=85)),
            (0.25, right(flex=80, knee=8, point=30) | {"bend": 12}),
            (0.5, right(flex=50, knee=70)),
            (0.75, REST),
        ),
        1.8,
        2,
        hold=both(lift=35, plane=30, elbow=50),
        sided=True,
    ),
    "kick_side": Motion(
        ((0.0, right(flex=45, open=25, knee=60)), (0.3, right(flex=8, open=55, knee=8) | {"lean": 18}), (0.7, REST)),
        2.0,
        2,
        hold=both(lift=45, plane=20, elbow=50),
        sided=True,
    ),
    "leg_back": Motion(
        ((0.0, right(flex=-22, knee=30, point=20) | both(lift=50, plane=80) | {"bend": 15}), (0.5, REST)), sided=True
    ),
    "heel_to_seat": Motion(
        ((0.0, right(flex=-2, knee=110, point=30)), (0.5, left(flex=-2, knee=110, point=30))), 1.4, 3
    ),
    "knee_lift": Motion(((0.0, right(flex=95, knee=100) | both(lift=40, plane=70, elbow=60)), (0.5, REST)), sided=True),
    "squat": Motion(
        ((0.0, both(flex=92, knee=112, open=12, toe=15, lift=85, plane=85, elbow=5) | {"bend": 22}), (0.55, REST)),
        2.6,
        2,
    ),
    "squat_arms_down": Motion(
        ((0.0, both(flex=70, knee=88, open=14, toe=18, lift=25, plane=60) | {"bend": 25}), (0.55, REST)), 2.2, 2
    ),
    "bend_forward": Motion(
        ((0.0, both(flex=30, lift=70, plane=88, elbow=6) | {"bend": 62, "pitch": 25, "nod": 15}), (0.6, REST)), 2.8, 2
    ),
    "pick_up": Motion(
        (
            (
                0.0,
                both(flex=75, knee=85)
                | right(lift=65, plane=85, elbow=5)
                | left(lift=40, plane=60)
                | {"bend": 50, "lean": -8, "nod": 15},
            ),
            (0.5, right(lift=50, plane=80, elbow=95)),
            (0.8, REST),
        ),
        3.0,
        2,
        sided=True,
    ),
    "bend_sideways": Motion(
        (
            (0.0, {"lean": 28} | right(lift=160, plane=5)),
            (0.25, REST),
            (0.5, {"lean": -28} | left(lift=160, plane=5)),
            (0.75, REST),
        ),
        3.2,
        2,
    ),
    "twist": Motion(
        ((0.0, {"turn": 50, "look": 20}), (0.5, {"turn": -50, "look": -20})),
        2.0,
        3,
        hold=both(lift=75, plane=65, elbow=85),
    ),
    "turn_around": Motion(
        (
            (0.0, {"yaw": 0}),
            (0.25, {"yaw": 45} | left(flex=20, knee=30)),
            (0.5, {"yaw": 80}),
            (0.75, {"yaw": 40} | right(flex=20, knee=30)),
        ),
        3.0,
        1,
        sided=True,
    ),
    "lunge": Motion(
        (
            (
                0.0,
                right(flex=70, knee=72)
                | left(flex=-22, knee=55, point=28)
                | both(lift=30, plane=30, elbow=60)
                | {"bend": 6},
            ),
            (0.55, REST),
        ),
        2.4,
        2,
        sided=True,
    ),
    "lunge_sideways": Motion(
        (
            (
                0.0,
                right(flex=60, knee=85, open=22, toe=22)
                | left(open=34, flex=10)
                | both(lift=70, plane=80)
                | {"bend": 25},
            ),
            (0.55, REST),
        ),
        2.4,
        2,
        sided=True,
    ),
    "jumping_jack": Motion(
        (
            (0.0, both(flex=18, knee=30)),
            (0.2, both(lift=95, plane=0, open=14) | {"hop": 0.10}),
            (0.4, both(lift=165, plane=5, open=24, knee=12)),
            (0.6, both(lift=95, plane=0, open=14) | {"hop": 0.10}),
            (0.85, REST),
        ),
        1.5,
        4,
    ),
    "clap": Motion(
        ((0.0, both(lift=62, plane=104, elbow=42)), (0.5, both(lift=62, plane=55, elbow=35))),
        0.9,
        5,
    ),
    "clap_overhead": Motion(
        ((0.0, both(lift=168, plane=20, elbow=12)), (0.5, both(lift=120, plane=5, elbow=15))), 1.2, 3
    ),
    "reach_up": Motion(
        (
            (0.0, right(lift=165, plane=60, elbow=8, roll=20) | {"lean": 8, "nod": -15}),
            (0.5, right(lift=70, plane=70, elbow=80)),
        ),
        2.2,
        2,
        sided=True,
    ),
    "reach_across": Motion(
        ((0.0, right(lift=80, plane=125, elbow=18) | {"turn": 20}), (0.5, right(lift=70, plane=20, elbow=30))),
        2.0,
        2,
        sided=True,
    ),
    "reach_low": Motion(
        ((0.0, right(lift=35, plane=30, elbow=5) | {"lean": -24, "bend": 15} | both(flex=25, knee=35)), (0.55, REST)),
        sided=True,
    ),
    "hands_on_hips": Motion(
        ((0.0, {"turn": 18, "lean": 6}), (0.5, {"turn": -18, "lean": -6})),
        2.4,
        2,
        hold=both(lift=48, plane=-22, roll=-55, elbow=95),
    ),
    "hands_to_head": Motion(
        ((0.0, both(lift=95, plane=15, roll=75, elbow=130)), (0.5, both(lift=60, plane=40, elbow=110))), 2.4, 2
    ),
    "hand_to_mouth": Motion(
        ((0.0, right(lift=45, plane=70, roll=10, elbow=135)), (0.5, right(lift=15, plane=40, elbow=70))), sided=True
    ),
    "arms_crossed": Motion(
        ((0.0, both(lift=48, plane=85, roll=-55, elbow=105)), (0.6, both(lift=35, plane=60, elbow=80))), 2.6, 2
    ),
    "curl": Motion(((0.0, both(lift=8, plane=30, elbow=130)), (0.5, both(lift=8, plane=30, elbow=15))), 1.8, 3),
    "push": Motion(
        ((0.0, both(lift=85, plane=88, elbow=8, roll=-35)), (0.5, both(lift=45, plane=45, roll=-20, elbow=120))), 1.6, 3
    ),
    "crawl_stroke": Motion(
        (
            (0.0, right(lift=160, plane=60) | left(lift=25, plane=0)),
            (0.25, right(lift=95, plane=85) | left(lift=80, plane=-20, elbow=45)),
            (0.5, right(lift=25, plane=0) | left(lift=160, plane=60)),
            (0.75, right(lift=80, plane=-20, elbow=45) | left(lift=95, plane=85)),
        ),
        2.0,
        3,
        hold={"bend": 15},
    ),
    "sit": Motion(
        (
            (0.0, both(flex=85, knee=92, lift=25, plane=75, elbow=40) | {"bend": 10}),
            (0.4, both(flex=88, knee=95, lift=30, plane=70, elbow=60)),
            (0.8, REST),
        ),
        3.4,
        1,
    ),
    "throw": Motion(
        (
            (0.0, right(lift=100, plane=-10, roll=70, elbow=95) | left(lift=70, plane=70) | {"turn": -25}),
            (0.3, right(lift=110, plane=80, elbow=20) | {"turn": 25, "bend": 12}),
            (0.7, REST),
        ),
        1.8,
        2,
        sided=True,
    ),
}
"""Motions for a pose database."""

_SUBJECT: dict[str, Motion] = {
    "semaphore": Motion(
        (
            (0.0, right(lift=135, plane=10, elbow=6) | left(lift=45, plane=5, elbow=6)),
            (0.25, right(lift=90, plane=40, elbow=6) | left(lift=130, plane=30, elbow=6)),
            (0.5, right(lift=45, plane=5, elbow=6) | left(lift=90, plane=10, elbow=6)),
            (0.75, right(lift=60, plane=60, elbow=50) | left(lift=110, plane=50, elbow=40)),
        ),
        3.6,
        2,
    ),
    "archery": Motion(
        (
            (0.0, left(lift=88, plane=10, elbow=6) | right(lift=82, plane=70, elbow=60) | {"look": 45}),
            (0.45, left(lift=88, plane=5, elbow=6) | right(lift=86, plane=0, elbow=125) | {"look": 50, "turn": -10}),
            (0.8, REST),
        ),
        3.0,
        2,
    ),
    "side_step": Motion(
        (
            (0.0, right(open=24, flex=14, knee=20) | left(open=6) | both(lift=45, plane=10, elbow=35)),
            (0.25, both(lift=70, plane=50, elbow=70)),
            (0.5, left(open=24, flex=14, knee=20) | right(open=6) | both(lift=45, plane=10, elbow=35)),
            (0.75, both(lift=70, plane=50, elbow=70)),
        ),
        2.2,
        3,
    ),
    "half_squat_reach": Motion(
        (
            (
                0.0,
                both(flex=55, knee=72, open=8)
                | right(lift=110, plane=70, elbow=15)
                | left(lift=30, plane=20)
                | {"bend": 18},
            ),
            (0.5, both(flex=20, knee=28) | left(lift=110, plane=35, elbow=15) | right(lift=30, plane=20)),
        ),
        2.8,
        2,
    ),
    "knee_to_elbow": Motion(
        (
            (0.0, right(flex=82, knee=92) | left(lift=70, plane=100, elbow=95) | {"turn": -20, "bend": 18}),
            (0.25, both(lift=75, plane=30, elbow=85)),
            (0.5, left(flex=82, knee=92) | right(lift=70, plane=100, elbow=95) | {"turn": 20, "bend": 18}),
            (0.75, both(lift=75, plane=30, elbow=85)),
        ),
        2.4,
        2,
    ),
    "conduct": Motion(
        (
            (0.0, both(lift=70, plane=60, elbow=60)),
            (0.25, both(lift=45, plane=70, elbow=80)),
            (0.5, both(lift=60, plane=20, elbow=50)),
            (0.75, both(lift=115, plane=45, elbow=45)),
        ),
        2.2,
        3,
    ),
}

SUBJECT: tuple[str, ...] = tuple(_SUBJECT)
"""Names of the motions for a test subject."""
MOTIONS: dict[str, Motion] = DATABASE | _SUBJECT | SEATED | SEATED_SUBJECT
"""Every motion with key poses, by its name."""
