"""Procedural motions, for pose databases and test subjects without motion capture data.

A motion is a cycle of key poses in named controls (`choreography`), repeated with another tempo, amplitude and small
wobble each time. Feet stay on the floor: the supporting foot does not slide and the lowest sole point is at y = 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.errors import UsageError
from toolkit.mocap.choreography import BASE, KINDS, MOTIONS, RANGES, PoseCycle
from toolkit.mocap.clip import PoseClip

CONTROLS: tuple[str, ...] = tuple(BASE)
"""Names of the controls: degrees, except `hop` (metres)."""
DATABASE_MOTIONS = (*KINDS["database"], "random")
"""Motions for a pose database."""
SUBJECT_MOTIONS = KINDS["subject"]
"""Motions for a test subject; none is in `DATABASE_MOTIONS`."""
SEATED_MOTIONS = KINDS["seated"]
"""Motions of seated people for a pose database."""
SEATED_SUBJECT_MOTIONS = KINDS["seated_subject"]
"""Motions for a seated test subject; none is in `SEATED_MOTIONS`."""
NAMES = (*DATABASE_MOTIONS, *SUBJECT_MOTIONS, *SEATED_MOTIONS, *SEATED_SUBJECT_MOTIONS)
"""Names of all motions."""


def procedural_clips(
    names: Sequence[str] = DATABASE_MOTIONS,
    rate: float = 30.0,
    *,
    body: Body | None = None,
    variations: int = 4,
    seed: int = 0,
) -> list[PoseClip]:
    """Return several variations of each named motion, one clip each; equal arguments give equal clips.

    Parameters
    ----------
    names : names of `NAMES`
    rate : frames a second
    body : body on the floor; None uses the neutral body
    variations : clips for each name, at least 1
    seed : seed of the variations

    Raises
    ------
    UsageError
        A name is unknown, or a number is not positive.
    """
    if variations < 1:
        raise UsageError(f"cannot make {variations} variations of a motion; give at least 1")
    if body is None:
        from toolkit.body.shape import load_body

        body = load_body("neutral")
    clips = []
    for name in names:
        if name not in NAMES:
            raise UsageError(f"there is no motion {name!r}; there are {', '.join(NAMES)}")
        for i in range(variations):
            rng = np.random.default_rng([seed, NAMES.index(name), i])
            clips.append(perform(name, body, rate, rng, label=f"{name}_{i + 1}"))
    return clips


def perform(
    name: str, body: Body, rate: float = 30.0, rng: np.random.Generator | None = None, *, label: str | None = None
) -> PoseClip:
    """Return one performance of a motion on the floor y = 0, starting at the origin and facing +z.

    Parameters
    ----------
    name : name of `NAMES`
    body : body on the floor
    rate : frames a second (> 0)
    rng : generator of tempo, amplitude, side and wobble; None uses none (`random` uses seed 0)
    label : name of the clip; None uses the motion's

    Raises
    ------
    UsageError
        The rate is not positive.
    """
    if not rate > 0:
        raise UsageError(f"a motion cannot be played at {rate} frames a second; use a positive rate")
    if name == "random":
        controls = _random_controls(rate, rng or np.random.default_rng(0))
    else:
        controls = _played(MOTIONS[name], rate, rng)
    poses = poses_from_controls(controls)
    if name in MOTIONS and MOTIONS[name].on_floor:
        poses[:, 1] = [-body.vertex_positions(pose)[:, 1].min() for pose in poses]
    else:
        _stand(poses, body, controls[:, CONTROLS.index("hop")])
    return PoseClip(label or name, poses, float(rate), f"procedural:{name}")


def poses_from_controls(controls: np.ndarray) -> np.ndarray:
    """Return the poses (T, P) of control values (T, len(CONTROLS)), within joint limits, root position zero.

    Angles are anatomical. Arms: `lift` from hanging (0) to overhead (180) in the vertical plane `plane` (0 sideways, 90
    forward), `roll` rotates the elbow's bend upwards, `elbow` bends it. Legs: `flex` forward, `open` sideways, `toe`
    outwards, `knee`, `point` of the foot from level, and `spread` of a flexed thigh outwards, about the vertical.
    Torso: `bend` forward, `lean` to the left, `turn` to the left. Head: `nod`, `tilt`, `look` likewise. Whole body:
    `yaw` and `pitch`.
    """
    from scipy.spatial.transform import Rotation

    def values(name: str) -> np.ndarray:
        return np.radians(controls[:, CONTROLS.index(name)])

    poses = np.zeros((len(controls), skeleton.POSE_SIZE))

    def put(joint: str, vectors: np.ndarray) -> None:
        for axis, letter in enumerate("xyz"):
            if (entry := f"{joint}_r{letter}") in skeleton.POSE_NAMES:
                poses[:, skeleton.POSE_NAMES.index(entry)] = vectors[:, axis]

    def euler(order: str, *angles: np.ndarray) -> np.ndarray:
        return Rotation.from_euler(order, np.stack(angles, axis=1)).as_rotvec()

    put("root", euler("YXZ", values("yaw"), values("pitch"), np.zeros(len(controls))))
    spine = np.stack([values("bend"), values("turn"), -values("lean")], axis=1)
    put("lumbar", 0.55 * spine)
    put("thorax", 0.45 * spine)
    put("cervical", np.stack([values("nod"), values("look"), -values("tilt")], axis=1))
    for side, s in (("left", 1.0), ("right", -1.0)):
        lift, plane, roll = (values(f"{side}_{name}") for name in ("lift", "plane", "roll"))
        shrug = np.clip(lift - np.radians(60.0), 0.0, None) * 0.3
        put(f"{side}_clavicle", np.stack([0 * lift, -s * 0.15 * np.sin(lift) * np.sin(plane), s * shrug], axis=1))
        twist = -plane * np.cos(lift / 4.0) ** 2 - roll
        put(f"{side}_shoulder", euler("YZX", -s * plane, s * (lift - shrug - 0.5 * np.pi), twist))
        put(f"{side}_elbow", -s * values(f"{side}_elbow")[:, None] * np.array([0.0, 1.0, 0.0]))
        flex, opened, toe, knee = (values(f"{side}_{name}") for name in ("flex", "open", "toe", "knee"))
        spread = Rotation.from_euler("Y", s * values(f"{side}_spread")[:, None])
        put(f"{side}_hip", (spread * Rotation.from_rotvec(euler("ZXY", s * opened, -flex, s * toe))).as_rotvec())
        put(f"{side}_knee", knee[:, None] * np.array([1.0, 0.0, 0.0]))
        level = flex - knee - values("pitch")
        put(f"{side}_ankle", np.stack([level + values(f"{side}_point"), 0 * flex, -s * opened], axis=1))
    poses[:, 6:] = np.clip(poses[:, 6:], *skeleton.POSE_LIMITS[6:].T)
    return poses


def _played(motion: PoseCycle, rate: float, rng: np.random.Generator | None) -> np.ndarray:
    """Return the control values (T, C) of a motion: from the base pose through its cycles and back."""
    from scipy.interpolate import PchipInterpolator

    base = np.array([(BASE | motion.hold if motion.settled else BASE)[name] for name in CONTROLS])
    keys = np.array([[{**BASE, **motion.hold, **key}[name] for name in CONTROLS] for key in motion.keys.values()])
    shares = np.array(list(motion.keys))
    times, values, clock = [0.0], [base], 0.6
    for _ in range(motion.cycles):
        length, width = motion.seconds, 1.0
        if rng is not None:
            length *= rng.uniform(0.8, 1.3)
            width = rng.uniform(0.75, 1.1)
        times += list(clock + shares * length)
        values += list(base + width * (keys - base))
        clock += length
    times.append(clock + 0.6)
    values.append(base)
    moments = np.arange(int(np.floor(times[-1] * rate)) + 1) / rate
    controls = PchipInterpolator(times, np.array(values))(moments)
    if rng is None:
        return controls
    if motion.sided and rng.random() < 0.5:
        controls = _other_side(controls)
    controls = controls + _wobble(moments, rng)
    return controls + _habit(rng) if motion.settled else controls


def _random_controls(rate: float, rng: np.random.Generator) -> np.ndarray:
    """Return a smooth motion (T, C) through random poses within natural ranges, biased to the base pose."""
    from scipy.interpolate import PchipInterpolator

    random_poses = 20  # number of poses of a random motion
    count, base = random_poses, np.array([BASE[name] for name in CONTROLS])
    low, high = np.array([RANGES.get(name, (BASE[name], BASE[name])) for name in CONTROLS]).T
    poses = rng.uniform(low, high, (count, len(CONTROLS)))
    legs = np.array(["flex" in name or "knee" in name or "open" in name for name in CONTROLS])
    calm = np.where(legs, rng.random((count, 1)) < 0.5, rng.random((count, len(CONTROLS))) < 0.25)
    poses = np.where(calm, base, poses)
    for side in ("left", "right"):  # a knee bends with its hip, which keeps the shin below the body
        flex, knee = CONTROLS.index(f"{side}_flex"), CONTROLS.index(f"{side}_knee")
        poses[:, knee] = np.clip(poses[:, flex] * rng.uniform(0.9, 1.9, count) + 5.0, 2.0, 130.0)
    random_step = 1.2  # seconds from one random pose to the next
    moments = np.arange(int((count - 1) * random_step * rate) + 1) / rate
    return PchipInterpolator(np.arange(count) * random_step, poses)(moments)


def _other_side(controls: np.ndarray) -> np.ndarray:
    swapped = controls.copy()
    for column, name in enumerate(CONTROLS):
        if name.startswith("left_"):
            partner = CONTROLS.index(name.replace("left_", "right_"))
            swapped[:, [column, partner]] = controls[:, [partner, column]]
        elif name in ("lean", "turn", "tilt", "look", "yaw"):
            swapped[:, column] = -controls[:, column]
    return swapped


def _habit(rng: np.random.Generator) -> np.ndarray:
    """Return a constant deviation (C,) of every control of one person, half of it equal on both sides."""
    shared = {name.split("_")[-1]: rng.normal() for name in CONTROLS}
    habit = np.array([rng.normal() + shared[name.split("_")[-1]] for name in CONTROLS])
    habit[CONTROLS.index("hop")] = 0.0
    deviation = 6.0  # degrees, standard deviation of each control from the held pose, drawn once per performance
    return deviation * np.sqrt(0.5) * habit


def _wobble(moments: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return slow noise (T, C): three sines below 1 Hz per control; none on `hop` and on the legs' sideways angles."""
    noise = np.zeros((len(moments), len(CONTROLS)))
    wobble = 2.5  # degrees, standard deviation of the slow wobble of every angle
    for column, name in enumerate(CONTROLS):
        if name in ("hop", "pitch") or name.endswith(("_open", "_point", "_spread")):
            continue
        rates, phases = rng.uniform(0.1, 0.9, 3), rng.uniform(0.0, 2.0 * np.pi, 3)
        noise[:, column] = (
            wobble * np.sqrt(2.0 / 3.0) * np.sin(2.0 * np.pi * rates * moments[:, None] + phases).sum(axis=1)
        )
    return noise


def _stand(poses: np.ndarray, body: Body, hop: np.ndarray) -> None:
    """Set the root positions: lowest sole point at y = hop, the lower foot fixed on the floor."""
    feet = [skeleton.JOINT_NAMES.index(f"{side}_ankle") for side in ("left", "right")]
    soles = [_sole(body, foot) - body.joints[foot] for foot in feet]
    points = np.empty((len(poses), 2, 3))  # lowest point of each sole
    for t, pose in enumerate(poses):
        placed = body.place(pose)
        for i, foot in enumerate(feet):
            moved = soles[i] @ placed.rotations[foot].T + placed.origins[foot]
            points[t, i] = moved.mean(axis=0)
            points[t, i, 1] = moved[:, 1].min()
    poses[:, 1] = hop - points[..., 1].min(axis=1)
    lower = points[:-1, :, 1].argmin(axis=1)
    steps = np.diff(points, axis=0)[np.arange(len(lower)), lower] * (hop[1:] <= 0.0)[:, None]
    poses[1:, [0, 2]] = -np.cumsum(steps, axis=0)[:, [0, 2]]


def _sole(body: Body, foot: int) -> np.ndarray:
    """Return the rest positions (N, 3) of the lowest vertices of a foot, or its site if the mesh has none."""
    own = body.vertices[body.part == foot]
    if len(own) < 3:
        return body.sites[skeleton.SITE_PARENTS == foot]
    sole = 0.015  # metres above the lowest vertex of the rest pose within which a foot's vertices are its sole
    return own[own[:, 1] < own[:, 1].min() + sole]
