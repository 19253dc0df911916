"""Who is recorded: a motion, a body, clothes and a place on the floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.io.errors import UsageError
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.simulation.clothes import dressed
from toolkit.simulation.furniture import HEIGHTS, OBSTACLES, SEATS, Box, boxes_mesh, check_kinds
from toolkit.simulation.holding import check_holding, held_mesh
from toolkit.simulation.interiors.mesh import Mesh, joined
from toolkit.simulation.seating import seat_height, seated

TALL, SMALL = 1.25, 0.75
"""Statures in metres between which a child's limbs grow from short to those of the shape space's children."""
SHORT_LEGS, SHORT_ARMS = 0.8, 0.9
"""Lengths of a toddler's leg and arm bones relative to those of an older child of the same stature, before scaling:
the sitting height falls from 0.60 to 0.53 of the stature (Fredriks 2005, Arch. Dis. Child. 90, 807)."""
CLEARANCE = 0.12
"""Metres from the legs and trunk of a person to the obstacle before them."""
CHESTS = 0.075
"""Radius of the core of a trunk over the stature: two cores never overlap, however closely people embrace."""


@dataclass(frozen=True)
class SimulatedPerson:
    """A person to be recorded.

    Attributes
    ----------
    clip : a mocap file, or poses of the subject
    body : name or shape coefficients (also as text with commas) of a full-resolution subject, or any body
    at : x and z of the mean place on the floor plan, metres: to the right in the image, and towards the camera
    yaw : degrees by which they are turned to their left in their first frame; 0 faces the camera
    stature : metres to which the body is scaled; below 1.25 m limbs get shorter in proportion. None leaves it
    seated : whether they do what the clip shows sitting, on a chair unless `furniture` holds another seat
    furniture : kinds of furniture beside or before them, out of `furniture.SEATS` and `furniture.OBSTACLES`
    clothes : out of `clothes.GARMENTS`
    enters : seconds after the beginning of the recording at which they appear; they are gone when their clip ends
    holds : a thing in their hands, out of `holding.HOLDINGS`, that moves with them and is not theirs
    held : seconds of the recording between which they hold it
    """

    clip: str | Path | PoseClip
    body: str | Sequence[float] | Body = "neutral"
    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    stature: float | None = None
    seated: bool = False
    furniture: tuple[str, ...] = ()
    clothes: tuple[str, ...] = ()
    enters: float = 0.0
    holds: str | None = None
    held: tuple[float, float] = (0.0, np.inf)

    def __post_init__(self) -> None:
        check_ranges(self, RANGES)
        if not np.abs(np.asarray(self.at, dtype=np.float64)).max() <= FARTHEST_PLACE:
            raise UsageError(f"no person can stand at {self.at}; give metres up to {FARTHEST_PLACE:g} to each side")


RANGES: dict[str, tuple[float, float, str]] = {
    "yaw": (-1e4, 1e4, "degrees"),
    "stature": (0.3, 3.0, "metres"),
    "enters": (0.0, 86_400.0, "seconds, a day at most"),
}
"""What the numbers of a person may be, both ends included, and in which unit."""
FARTHEST_PLACE = 60.0
"""Metres on the floor plan: farther away depth is not stored."""


def check_ranges(given: object, ranges: Mapping[str, tuple[float, float, str]]) -> None:
    """Raise UsageError for a number of `given` that is out of its range; None is left out."""
    for name, (low, high, unit) in ranges.items():
        value = getattr(given, name)
        if value is not None and not low <= value <= high:
            raise UsageError(f"{name.replace('_', ' ')} {value:g} is impossible; give {low:g} to {high:g} {unit}")


class PosedSubject(NamedTuple):
    """A person in place.

    Attributes
    ----------
    body : in clothes
    poses : float64 (T, P) on the floor plan: x right in the image, y up from the floor, z towards the camera
    first : frame of the recording that shows the first pose
    hanging : how many of the body's last vertices are a skirt's
    holds, held : what is in their hands, and between which frames of the recording
    """

    body: Body
    poses: np.ndarray
    first: int
    hanging: int = 0
    holds: str | None = None
    held: tuple[float, float] = (0.0, np.inf)

    def held_thing(self, frame: int) -> Mesh | None:
        """What is in their hands in a frame of the recording, on the floor plan."""
        if self.holds is None or not self.held[0] <= frame < self.held[1]:
            return None
        return held_mesh(self.holds, self.body.joint_positions(self.poses[frame - self.first]))

    @property
    def end(self) -> int:
        """The frame after the last pose."""
        return self.first + len(self.poses)


def subject_of(body: str | Sequence[float] | Body) -> Body:
    """The subject that `--body NAME|SHAPE` means: a name, coefficients (also as text with commas), or a body as it is.

    Raises
    ------
    BodyError, UsageError
        The name is unknown or the coefficients do not fit.
    """
    if isinstance(body, Body):
        return body
    if isinstance(body, str) and "," in body:
        try:
            body = [float(word) for word in body.split(",")]
        except ValueError:
            raise UsageError(f"the shape {body!r} is no list of numbers; write for example 1.0,-0.5") from None
    return subject_body(body)


def grown_to(body: Body, stature: float) -> Body:
    """The body scaled to a stature in metres, with the proportions of a small child below 1.25 m.

    Raises
    ------
    UsageError
        No person is of this stature.
    """
    if not 0.5 <= stature <= 2.3:
        raise UsageError(f"no person is {stature} m tall; give a stature from 0.5 to 2.3 m")
    young = float(np.clip((TALL - stature) / (TALL - SMALL), 0.0, 1.0))
    if young > 0:
        legs, arms = 1.0 - young * (1.0 - SHORT_LEGS), 1.0 - young * (1.0 - SHORT_ARMS)
        body = body.stretched({"hip": legs, "knee": legs, "shoulder": arms, "elbow": arms})
    return body.scaled(stature / body.height)


def prepare_person(person: SimulatedPerson, frame_rate: float, rng: np.random.Generator) -> PosedSubject:
    """Body and poses of a person on the floor plan; `rng` draws how a person sits."""
    check_holding(person.holds)
    naked = subject_of(person.body)
    if person.stature is not None:
        naked = grown_to(naked, person.stature)
    if isinstance(person.clip, PoseClip):
        poses = person.clip.every(frame_rate).poses
    else:
        poses = retarget(read_clip(person.clip).resampled(frame_rate), naked).poses
    if person.seated:
        poses = seated(poses, naked, rng)
    else:
        poses = poses - np.eye(skeleton.POSE_SIZE)[1] * floor_of(naked, poses)
    placed = _placed(poses, person.at, float(np.deg2rad(person.yaw)))
    body = dressed(naked, person.clothes)
    hanging = len(body.vertices) - len(naked.vertices)
    held = (person.held[0] * frame_rate, person.held[1] * frame_rate)
    return PosedSubject(body, placed, round(person.enters * frame_rate), hanging, person.holds, held)


def _placed(poses: np.ndarray, at: tuple[float, float], yaw: float) -> np.ndarray:
    """Poses turned about the vertical so that the first one faces `yaw`, with their mean place at `at`."""
    return turned(poses, yaw - facing_of(poses[0]), mean_place(poses), np.array([at[0], 0.0, at[1]]))


def mean_place(poses: np.ndarray) -> np.ndarray:
    """Where on the floor (3,) the root is on average in poses (T, P)."""
    return poses[:, skeleton.ROOT_POSITION].mean(axis=0) * [1.0, 0.0, 1.0]


def turned(poses: np.ndarray, angle: float | np.ndarray, about: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Poses (T, P) turned about the vertical through a place, which is then moved.

    Parameters
    ----------
    angle : radians about +y, one or (T, 1)
    about : (3,), metres
    to : (3,) or (T, 3), where that place is moved, metres
    """
    from scipy.spatial.transform import Rotation

    turn, result = Rotation.from_euler("y", angle), poses.copy()
    result[:, skeleton.ROOT_POSITION] = turn.apply(poses[:, skeleton.ROOT_POSITION] - about) + to
    result[:, skeleton.ROOT_ROTATION] = (turn * Rotation.from_rotvec(poses[:, skeleton.ROOT_ROTATION])).as_rotvec()
    return result


def floor_of(body: Body, poses: np.ndarray) -> float:
    """Height of the floor below poses (T, P), metres: the lowest point of the body in at most 100 of them."""
    rows = np.linspace(0, len(poses) - 1, min(len(poses), 100)).astype(int)
    return min(float(body.vertex_positions(poses[row])[:, 1].min()) for row in rows)


def facing_of(pose: np.ndarray) -> float:
    """Yaw of a pose's facing about +y from +z, radians."""
    from scipy.spatial.transform import Rotation

    facing = Rotation.from_rotvec(pose[skeleton.ROOT_ROTATION]).as_matrix()[:, 2]
    return float(np.arctan2(facing[0], facing[2]))


def furniture_of(person: SimulatedPerson, performer: PosedSubject) -> Mesh:
    """What belongs to a person: seats under the hips, a desk before a sitter, other obstacles towards the camera."""
    kinds = check_kinds(person.furniture)
    if person.seated and not any(kind in SEATS for kind in kinds):
        kinds = ("chair", *kinds)
    body, poses = performer.body, performer.poses
    facing, at = facing_of(poses[0]), person.at
    meshes = []
    for kind in kinds:
        if kind in SEATS:
            meshes.append(boxes_mesh(SEATS[kind](seat_height(body)), facing, at))
            continue
        yaw = facing if person.seated else 0.0
        forward = np.array([np.sin(yaw), np.cos(yaw)])
        reach = _reach(body, poses, at, forward, over_knees=person.seated and kind != "crate") + CLEARANCE
        boxes = OBSTACLES[kind](HEIGHTS[kind] * body.height)
        meshes.append(boxes_mesh(boxes, yaw, (at[0] + reach * forward[0], at[1] + reach * forward[1])))
    return joined(meshes)


def _reach(body: Body, poses: np.ndarray, at: tuple[float, float], forward: np.ndarray, *, over_knees: bool) -> float:
    """How far trunk and legs (the trunk only, where a table stands over the knees) come forward, metres."""
    named = [
        i
        for i, name in enumerate(skeleton.REPORTED)
        if name in ("pelvis", "spine", "neck") or (not over_knees and name.split("_")[-1] in ("knee", "ankle", "foot"))
    ]
    joints = body.joint_positions(poses)[:, named]
    return float(((joints[..., [0, 2]] - at) @ forward).max()) + CHESTS * body.height


def check_apart(performers: Sequence[PosedSubject]) -> None:
    """Refuse people who stand in each other.

    Raises
    ------
    UsageError
        In some frame the trunks of two people are nearer than two bodies can be.
    """
    for i, first in enumerate(performers):
        for j, second in enumerate(performers[:i]):
            start, end = max(first.first, second.first), min(first.end, second.end)
            if start >= end:
                continue
            gaps = np.linalg.norm(
                _trunk(first, start, end)[:, :, None] - _trunk(second, start, end)[:, None], axis=-1
            ).min(axis=(1, 2))
            needed = CHESTS * (first.body.height + second.body.height)
            if gaps.min() < needed:
                frame = start + int(gaps.argmin())
                raise UsageError(
                    f"person {i + 1} is inside person {j + 1} in frame {frame}: their trunks are {gaps.min():.2f} m "
                    f"apart and need {needed:.2f}; place them elsewhere"
                )


def check_clear(performers: Sequence[PosedSubject], boxes: Sequence[Box]) -> None:
    """Refuse people who stand in the furniture of the room.

    Raises
    ------
    UsageError
        In some frame a person's trunk is inside a box.
    """
    for i, performer in enumerate(performers):
        trunk = _trunk(performer, performer.first, performer.end)
        for k, box in enumerate(boxes):
            within = (trunk > np.array(box.low)) & (trunk < np.array(box.high))
            frames = np.flatnonzero(within.all(axis=-1).any(axis=-1))
            if len(frames):
                raise UsageError(
                    f"person {i + 1} is inside box {k + 1} of the room in frame {performer.first + int(frames[0])}; "
                    "place either elsewhere"
                )


def _trunk(performer: PosedSubject, start: int, end: int) -> np.ndarray:
    """Points along the trunk in frames `start` to `end`: float64 (end - start, 5, 3)."""
    joints = performer.body.joint_positions(performer.poses[start - performer.first : end - performer.first])
    pelvis, neck = (joints[:, skeleton.REPORTED.index(name)][:, None] for name in ("pelvis", "neck"))
    return pelvis + np.linspace(0.0, 1.0, 5)[:, None] * (neck - pelvis)
