"""Key poses of people who sit: on a chair, a stool, a sofa, the floor and at a desk (degrees, see `procedural`)."""

from __future__ import annotations

from toolkit.mocap.motion import Motion, both, left, right

_LAP = both(lift=24, plane=70, roll=-15, elbow=62)
"""Hands on the thighs."""
_CHAIR = both(flex=86, knee=88, spread=8, toe=4) | _LAP | {"bend": 4}
_STOOL = both(flex=70, knee=78, spread=16, toe=6) | _LAP | {"bend": 8}
_SOFA = (
    both(flex=96, knee=82, spread=12, toe=8) | both(lift=28, plane=35, roll=-10, elbow=50) | {"pitch": -22, "nod": 14}
)
_DESK = both(flex=86, knee=86, spread=6, toe=4) | both(lift=38, plane=62, roll=-28, elbow=72) | {"bend": 12, "nod": 12}
_TABLE = both(flex=88, knee=92, spread=9) | both(lift=48, plane=78, roll=-45, elbow=78) | {"bend": 18}
_FLOOR_CROSSED = both(flex=98, knee=136, spread=30, toe=85, point=45) | _LAP | {"bend": 16, "pitch": -4}
_FLOOR_STRAIGHT = (
    both(flex=85, knee=6, spread=10, point=-8) | both(lift=16, plane=30, roll=0, elbow=20) | {"pitch": -8, "bend": 8}
)
_CROSSED = right(flex=104, knee=84, spread=-16, toe=-4) | left(flex=84, knee=92, spread=2)
_ANKLE_ON_KNEE = right(flex=110, knee=108, spread=38, toe=88, point=15) | left(flex=84, knee=90, spread=14)

SEATED: dict[str, Motion] = {
    "seated_chair": Motion(
        (
            (0.0, {"lean": 6, "look": 25}),
            (0.25, both(spread=20, flex=82)),
            (0.5, {"lean": -6, "look": -25, "bend": 14}),
            (0.75, both(flex=74, knee=60)),
        ),
        3.2,
        2,
        hold=_CHAIR,
        settled=True,
    ),
    "seated_chair_legs": Motion(
        (
            (0.0, both(flex=78, knee=40, spread=6)),
            (0.25, both(flex=84, knee=112, spread=14)),
            (0.5, right(flex=76, knee=45) | left(flex=86, knee=105)),
            (0.75, both(spread=26, toe=14)),
        ),
        3.6,
        2,
        hold=_CHAIR,
        settled=True,
        sided=True,
    ),
    "seated_arms_raised": Motion(
        (
            (0.0, right(lift=150, plane=55, roll=0, elbow=12)),
            (0.2, right(lift=85, plane=15, roll=70, elbow=85)),
            (0.4, both(lift=95, plane=10, roll=20, elbow=20)),
            (0.6, both(lift=160, plane=40, roll=0, elbow=15)),
            (0.8, both(lift=88, plane=88, roll=0, elbow=8)),
        ),
        4.0,
        2,
        hold=_CHAIR,
        settled=True,
        sided=True,
    ),
    "seated_talking": Motion(
        (
            (0.0, both(lift=42, plane=55, roll=0, elbow=95)),
            (0.2, right(lift=60, plane=45, roll=15, elbow=70) | {"look": 20}),
            (0.4, both(lift=45, plane=80, roll=-30, elbow=105)),
            (0.6, left(lift=65, plane=30, roll=30, elbow=80) | {"look": -25}),
            (0.8, right(lift=42, plane=72, roll=10, elbow=136) | {"nod": 10}),
        ),
        4.2,
        2,
        hold=_CHAIR,
        settled=True,
        sided=True,
    ),
    "seated_arms_crossed": Motion(
        (
            (0.0, both(lift=48, plane=85, roll=-55, elbow=105)),
            (0.5, both(lift=44, plane=80, roll=-50, elbow=98) | {"lean": 6}),
        ),
        3.0,
        2,
        hold=_CHAIR | {"pitch": -8},
        settled=True,
    ),
    "seated_hands_behind_head": Motion(
        ((0.0, both(lift=112, plane=10, roll=75, elbow=132)), (0.6, both(lift=96, plane=25, roll=70, elbow=125))),
        3.0,
        1,
        hold=_CHAIR | {"pitch": -14},
        settled=True,
    ),
    "seated_reaching": Motion(
        (
            (0.0, right(lift=78, plane=85, roll=0, elbow=8) | {"bend": 34, "turn": 12}),
            (0.25, right(lift=92, plane=20, roll=0, elbow=8) | {"turn": -18, "lean": -10}),
            (0.5, right(lift=38, plane=30, roll=0, elbow=8) | {"lean": -24, "bend": 20}),
            (0.75, right(lift=40, plane=80, roll=0, elbow=15) | {"bend": 55, "nod": 10}),
        ),
        4.2,
        2,
        hold=_CHAIR,
        settled=True,
        sided=True,
    ),
    "seated_stool": Motion(
        (
            (0.0, both(flex=60, knee=64, spread=24)),
            (0.3, {"bend": 38, "nod": 12} | both(lift=48, plane=75, elbow=60)),
            (0.6, {"turn": 35, "look": 35}),
            (0.8, both(flex=78, knee=104)),
        ),
        3.6,
        2,
        hold=_STOOL,
        settled=True,
        sided=True,
    ),
    "seated_elbows_on_knees": Motion(
        ((0.0, {"bend": 52}), (0.5, {"bend": 38} | both(plane=88))),
        3.0,
        2,
        hold=both(flex=88, knee=92, spread=20) | both(lift=62, plane=80, roll=-20, elbow=85) | {"bend": 46, "pitch": 8},
        settled=True,
    ),
    "seated_desk_typing": Motion(
        (
            (0.0, both(roll=-32, elbow=76)),
            (0.25, both(plane=50, elbow=84) | {"look": 15}),
            (0.5, right(plane=40, roll=-10, elbow=62) | {"lean": -4}),
            (0.75, both(lift=30, elbow=95) | {"bend": 4}),
        ),
        3.2,
        2,
        hold=_DESK,
        settled=True,
        sided=True,
    ),
    "seated_desk_work": Motion(
        (
            (0.0, right(lift=52, plane=75, roll=-25, elbow=40) | {"bend": 24}),
            (0.25, right(lift=48, plane=25, roll=0, elbow=45) | {"turn": -12}),
            (0.5, left(lift=42, plane=72, roll=10, elbow=134) | {"bend": 26, "nod": 16}),
            (0.75, both(lift=60, plane=70, roll=-15, elbow=25) | {"bend": 20}),
        ),
        4.0,
        2,
        hold=_DESK,
        settled=True,
        sided=True,
    ),
    "seated_arms_on_table": Motion(
        (
            (0.0, both(lift=52, plane=88, roll=-55, elbow=92)),
            (0.3, both(lift=60, plane=60, roll=-25, elbow=45) | {"bend": 30}),
            (0.6, right(lift=58, plane=82, roll=0, elbow=128) | {"nod": 14, "bend": 26}),
        ),
        3.6,
        2,
        hold=_TABLE,
        settled=True,
        sided=True,
    ),
    "seated_legs_crossed": Motion(
        (
            (0.0, right(knee=70)),
            (0.4, {"lean": 6, "look": 25} | right(knee=92)),
            (0.7, both(lift=40, plane=82, elbow=95)),
        ),
        3.4,
        2,
        hold=_LAP | _CROSSED,
        settled=True,
        sided=True,
    ),
    "seated_ankle_on_knee": Motion(
        (
            (0.0, {"lean": 5} | right(spread=48)),
            (0.4, both(lift=44, plane=75, roll=-10, elbow=70)),
            (0.7, right(lift=80, plane=20, roll=40, elbow=80)),
        ),
        3.4,
        2,
        hold=_LAP | _ANKLE_ON_KNEE | {"pitch": -6},
        settled=True,
        sided=True,
    ),
    "seated_sofa": Motion(
        (
            (0.0, both(lift=70, plane=-10, roll=20, elbow=40)),
            (0.25, both(flex=84, knee=40)),
            (0.5, {"lean": 14, "look": 20} | right(lift=55, plane=20, roll=30, elbow=110)),
            (0.75, both(lift=40, plane=85, roll=-40, elbow=85)),
        ),
        4.0,
        2,
        hold=_SOFA,
        settled=True,
        sided=True,
    ),
    "seated_floor_crossed": Motion(
        (
            (0.0, {"lean": 8, "look": 20}),
            (0.3, right(lift=85, plane=60, roll=0, elbow=15)),
            (0.6, {"bend": 38} | both(lift=60, plane=80, elbow=25)),
        ),
        3.6,
        2,
        hold=_FLOOR_CROSSED,
        settled=True,
        sided=True,
        on_floor=True,
    ),
    "seated_floor_straight": Motion(
        (
            (0.0, both(lift=25, plane=-35, elbow=8) | {"pitch": -18}),
            (0.3, right(flex=100, knee=95)),
            (0.6, both(lift=66, plane=85, elbow=8) | {"bend": 40}),
            (0.8, both(flex=112, knee=112) | both(lift=50, plane=80, elbow=60)),
        ),
        4.0,
        2,
        hold=_FLOOR_STRAIGHT,
        settled=True,
        sided=True,
        on_floor=True,
    ),
}
"""Motions of seated people for a pose database."""

SEATED_SUBJECT: dict[str, Motion] = {
    "sit_and_wave": Motion(
        ((0.0, right(lift=85, plane=25, roll=65, elbow=70)), (0.4, right(lift=95, plane=25, roll=65, elbow=40))),
        1.6,
        3,
        hold=both(flex=80, knee=96, spread=12) | both(lift=20, plane=60, elbow=75) | {"bend": 7},
        settled=True,
        sided=True,
    ),
    "sit_and_read": Motion(
        (
            (0.0, both(lift=40, plane=75, roll=-5, elbow=112)),
            (0.5, right(lift=55, plane=60, roll=0, elbow=60) | {"nod": 4}),
        ),
        3.2,
        2,
        hold=right(flex=100, knee=88, spread=-12)
        | left(flex=86, knee=84)
        | both(lift=36, plane=72, roll=-12, elbow=104)
        | {"nod": 20, "pitch": -10},
        settled=True,
        sided=True,
    ),
    "sit_and_drink": Motion(
        (
            (0.0, right(lift=66, plane=72, roll=-10, elbow=35) | {"bend": 24}),
            (0.35, right(lift=55, plane=70, roll=15, elbow=132)),
            (0.7, right(lift=66, plane=72, roll=-10, elbow=40) | {"bend": 20}),
        ),
        3.4,
        2,
        hold=both(flex=90, knee=80, spread=5) | both(lift=44, plane=70, roll=-35, elbow=70) | {"bend": 14},
        settled=True,
        sided=True,
    ),
    "sit_and_point": Motion(
        (
            (0.0, right(lift=88, plane=75, roll=0, elbow=10)),
            (0.3, right(lift=110, plane=20, roll=0, elbow=10) | {"look": -30}),
            (0.6, left(lift=70, plane=50, roll=0, elbow=25) | {"turn": 15}),
        ),
        3.6,
        2,
        hold=both(flex=76, knee=66, spread=18) | both(lift=22, plane=45, roll=-20, elbow=70) | {"pitch": -6},
        settled=True,
        sided=True,
    ),
    "sit_and_stretch": Motion(
        (
            (0.0, both(lift=165, plane=15, roll=0, elbow=20) | {"bend": -8}),
            (0.4, both(lift=80, plane=-15, roll=10, elbow=25)),
            (0.7, both(flex=78, knee=30)),
        ),
        3.6,
        2,
        hold=both(flex=92, knee=98, spread=10) | both(lift=34, plane=50, roll=-10, elbow=80) | {"bend": 8},
        settled=True,
    ),
}
"""Motions of seated test subjects: none of them is in `SEATED`."""
