"""Synthetic people who walk, squat and rise from seats: strides, durations and contacts are exact."""

from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.sole import FEET, Sole

KNEE_SPARE = 0.995
"""Largest extension of a leg as a fraction of its length."""
PITCH = 0.6
"""Heel pitch when a foot leaves the floor, radians."""


@dataclass(frozen=True)
class Walk:
    """Walk straight ahead, along +z.

    Attributes
    ----------
    speed : metres a second
    cadence : steps a minute
    width : metres between the lines of the feet
    stance : share of a stride in which a foot carries
    """

    speed: float = 1.1
    cadence: float = 108.0
    width: float = 0.12
    stance: float = 0.62

    @property
    def stride_time(self) -> float:
        """Seconds from one touch-down of a foot to its next."""
        return 120.0 / self.cadence

    @property
    def stride_length(self) -> float:
        """Metres."""
        return self.speed * self.stride_time


def walking(body: Body, walk: Walk, seconds: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (T, P), floor at y = 0, and foot contacts (T, 2), left first."""
    times = np.arange(round(seconds * rate)) / rate
    sole = {leg: Sole.of(body, leg) for leg in FEET}
    ground = -float(sole["left_leg"].points[0, 1])
    leg_length = body.joints[skeleton.JOINT_NAMES.index("left_hip"), 1] - _joint(body, "left_ankle")[1]
    poses, contact = np.zeros((len(times), skeleton.POSE_SIZE)), np.zeros((len(times), 2), dtype=bool)
    for t, time in enumerate(times):
        pose = poses[t]
        bob = 0.012 * np.cos(2.0 * np.pi * time / (0.5 * walk.stride_time))
        pose[:3] = [0.0, ground + 0.955 * leg_length - bob, walk.speed * time]
        swing = np.sin(2.0 * np.pi * time / walk.stride_time)
        for side, (leg, s) in enumerate((("left_leg", 1.0), ("right_leg", -1.0))):
            phase = time / walk.stride_time + 0.5 * side
            pitch, heel, contact[t, side] = _foot(phase, walk)
            ball = sole[leg].points[1]
            level = np.array([0.0, ball[1], ball[2]])
            # The foot rotates about its ball while the heel is raised; `heel` is the ankle's place of a flat foot.
            ankle = np.array([s * 0.5 * walk.width, ground + heel[1], heel[0] + walk.speed * time])
            ankle += level - _pitched(pitch) @ level
            _place_leg(body, pose, leg, ankle, pitch)
            _set(pose, f"{leg.split('_')[0]}_shoulder", [0.0, 0.0, -s * 1.35])
            _set(pose, f"{leg.split('_')[0]}_elbow", [0.0, -s * (0.35 + 0.1 * s * swing), 0.0])
    return poses, contact


def _foot(phase: float, walk: Walk) -> tuple[float, np.ndarray, bool]:
    """Return pitch, ankle place ahead of the pelvis and above its rest height, and foot contact."""
    share, half = phase % 1.0, 0.5 * walk.stance * walk.stride_length
    if share < walk.stance:
        done = share / walk.stance
        rise = np.clip((done - 0.6) / 0.4, 0.0, 1.0) ** 2
        return PITCH * rise, np.array([half - done * 2.0 * half, 0.0]), True
    done = (share - walk.stance) / (1.0 - walk.stance)
    smooth = done * done * (3.0 - 2.0 * done)
    # the foot is at rest at both ends of the swing, so the path has no jerk
    from_ground = smooth * walk.stride_length - done * (1.0 - walk.stance) * walk.stride_length
    return PITCH * (1.0 - smooth), np.array([-half + from_ground, 0.07 * np.sin(np.pi * done) ** 2]), False


@dataclass(frozen=True)
class Rising:
    """Repeated descent to a seat or into a squat, and rise.

    Attributes
    ----------
    count : how often
    duration : seconds of the way up, and of the way down
    rest : seconds below
    stand : seconds above
    depth : metres that the hips go down
    back : metres that they go back
    """

    count: int = 3
    duration: float = 1.2
    rest: float = 1.0
    stand: float = 0.8
    depth: float = 0.38
    back: float = 0.34


def rising(body: Body, plan: Rising, rate: float) -> np.ndarray:
    """Return poses (T, P), floor at y = 0: feet stay in place, hips move down and up along a cosine."""
    cycle = plan.stand + 2.0 * plan.duration + plan.rest
    times = np.arange(round((plan.count * cycle + plan.stand) * rate)) / rate
    ground = -float(Sole.of(body, "left_leg").points[0, 1])
    hips = ground + 0.99 * (_joint(body, "left_hip")[1] - _joint(body, "left_ankle")[1])
    poses = np.zeros((len(times), skeleton.POSE_SIZE))
    for pose, time in zip(poses, times, strict=True):
        down = _down(time % cycle, plan)
        pose[:3] = [0.0, hips - plan.depth * down, -plan.back * down]
        lean = 0.75 * np.sin(np.pi * down) + 0.15 * down
        _set(pose, "root", [0.5 * lean, 0.0, 0.0])
        _set(pose, "lumbar", [0.5 * lean, 0.0, 0.0])
        for leg, s in (("left_leg", 1.0), ("right_leg", -1.0)):
            side = leg.split("_")[0]
            _place_leg(body, pose, leg, np.array([s * 0.11, ground, 0.0]), 0.0)
            _set(pose, f"{side}_shoulder", [0.0, -s * (0.6 + 0.4 * down), -s * 0.9])
            _set(pose, f"{side}_elbow", [0.0, -s * 0.5, 0.0])
    return poses


def _down(time: float, plan: Rising) -> float:
    """Return the fraction of the descent within a cycle."""
    edges = np.cumsum([plan.stand, plan.duration, plan.rest, plan.duration])
    if time < edges[0]:
        return 0.0
    if time < edges[1]:
        return float(0.5 - 0.5 * np.cos(np.pi * (time - edges[0]) / plan.duration))
    if time < edges[2]:
        return 1.0
    return float(0.5 + 0.5 * np.cos(np.pi * (time - edges[2]) / plan.duration))


def _place_leg(body: Body, pose: np.ndarray, leg: str, ankle: np.ndarray, pitch: float) -> None:
    """Bend a leg so that its ankle is at a place (3,) and its foot has a pitch over the level floor."""
    side = leg.split("_")[0]
    root = _rotation(_get(pose, "root"))
    hip = pose[:3] + root @ _joint(body, f"{side}_hip")
    thigh = float(np.linalg.norm(_joint(body, f"{side}_knee") - _joint(body, f"{side}_hip")))
    shank = float(np.linalg.norm(_joint(body, f"{side}_ankle") - _joint(body, f"{side}_knee")))
    way = root.T @ (ankle - hip)
    reach = min(float(np.linalg.norm(way)), KNEE_SPARE * (thigh + shank))
    bend = np.pi - np.arccos(np.clip((thigh**2 + shank**2 - reach**2) / (2 * thigh * shank), -1, 1))
    ahead = np.arccos(np.clip((thigh**2 + reach**2 - shank**2) / (2 * thigh * reach), -1, 1))
    sideways = np.arctan2(way[0], -way[1])
    forwards = np.arctan2(way[2], np.hypot(way[0], way[1]))
    about_x = _rotation(np.array([-(forwards + ahead), 0.0, 0.0]))
    turn = _rotation(np.array([0.0, 0.0, sideways])) @ about_x
    _set(pose, f"{side}_hip", _vector(turn))
    _set(pose, f"{side}_knee", np.array([bend, 0.0, 0.0]))
    shin = root @ turn @ _rotation(np.array([bend, 0.0, 0.0]))
    _set(pose, f"{side}_ankle", _vector(shin.T @ _pitched(pitch)))


def _pitched(pitch: float) -> np.ndarray:
    return _rotation(np.array([pitch, 0.0, 0.0]))


def _joint(body: Body, name: str) -> np.ndarray:
    return np.asarray(body.joints[skeleton.JOINT_NAMES.index(name)])


def _entries(joint: str) -> np.ndarray:
    return 3 + np.flatnonzero(skeleton.DOF_JOINT == skeleton.JOINT_NAMES.index(joint))


def _set(pose: np.ndarray, joint: str, vector: np.ndarray | list[float]) -> None:
    entries = _entries(joint)
    pose[entries] = np.asarray(vector)[skeleton.DOF_AXIS[entries - 3]]


def _get(pose: np.ndarray, joint: str) -> np.ndarray:
    out, entries = np.zeros(3), _entries(joint)
    out[skeleton.DOF_AXIS[entries - 3]] = pose[entries]
    return out


def _rotation(vector: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def _vector(rotation: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(rotation).as_rotvec())
