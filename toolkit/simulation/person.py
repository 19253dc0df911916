"""People of a simulation: motion, body and position on the floor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
from toolkit.simulation.furniture import HEIGHTS, OBSTACLES, SEATS, Box, boxes_mesh, check_kinds
from toolkit.simulation.mesh import Mesh, joined
from toolkit.simulation.seating import seat_height, seated

Holding = Callable[[np.ndarray], Mesh]
CHEST = 0.075
"""Radius of the core of a trunk over the stature; two cores never overlap, even in a hug."""


@dataclass(frozen=True)
class SimulatedPerson:
    """Person of a simulation.

    Attributes
    ----------
    clip : mocap file, or poses of the subject
    body : name or shape coefficients (also as text with commas) of a full-resolution subject, or any body
    at : x and z of the mean position on the floor plan, metres: to the right in the image, and towards the camera
    yaw : degrees to the person's left in the first frame; 0 faces the camera
    seated : perform the clip seated, on a chair unless `furniture` has another seat
    furniture : furniture beside or before the person, names of `furniture.SEATS` and `furniture.OBSTACLES`
    dress : adds clothes to the body, as vertices after its own; None leaves it as it is
    enters : seconds of the recording at which the person appears; the person leaves at the end of the clip
    holds : mesh of a held object for joints (20, 3), metres, y up
    held : seconds of the recording between which it is held
    """

    clip: str | Path | PoseClip
    body: str | Sequence[float] | Body = "neutral"
    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    seated: bool = False
    furniture: tuple[str, ...] = ()
    dress: Callable[[Body], Body] | None = None
    enters: float = 0.0
    holds: Holding | None = None
    held: tuple[float, float] = (0.0, np.inf)

    def __post_init__(self) -> None:
        check_ranges(self, RANGES)
        farthest_place = 60.0  # metres on the floor plan; depth beyond is not stored
        if not np.abs(np.asarray(self.at, dtype=np.float64)).max() <= farthest_place:
            raise UsageError(f"no person can stand at {self.at}; give metres up to {farthest_place:g} to each side")


RANGES: dict[str, tuple[float, float, str]] = {
    "yaw": (-1e4, 1e4, "degrees"),
    "enters": (0.0, 86_400.0, "seconds, a day at most"),
}
"""Inclusive ranges of the numbers of `SimulatedPerson`, with their unit."""


def check_ranges(given: object, ranges: Mapping[str, tuple[float, float, str]]) -> None:
    """Raise UsageError for a number of `given` outside its range; None is skipped."""
    for name, (low, high, unit) in ranges.items():
        value = getattr(given, name)
        if value is not None and not low <= value <= high:
            raise UsageError(f"{name.replace('_', ' ')} {value:g} is impossible; give {low:g} to {high:g} {unit}")


class PosedSubject(NamedTuple):
    """Person placed on the floor plan.

    Attributes
    ----------
    body : clothed body
    poses : float64 (T, P) on the floor plan: x right in the image, y up from the floor, z towards the camera
    first : frame of the recording that shows the first pose
    hanging : number of the body's last vertices that belong to a skirt
    holds, held : held object, and the frames of the recording between which it is held
    """

    body: Body
    poses: np.ndarray
    first: int
    hanging: int = 0
    holds: Holding | None = None
    held: tuple[float, float] = (0.0, np.inf)

    def held_thing(self, frame: int) -> Mesh | None:
        """Return the held object in a frame of the recording, on the floor plan."""
        if self.holds is None or not self.held[0] <= frame < self.held[1]:
            return None
        return self.holds(self.body.joint_positions(self.poses[frame - self.first]))

    @property
    def end(self) -> int:
        """The frame after the last pose."""
        return self.first + len(self.poses)


def subject_of(body: str | Sequence[float] | Body) -> Body:
    """Return the subject of `--body NAME|SHAPE`: a name, coefficients (also as text with commas), or a body.

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


def prepare_person(person: SimulatedPerson, frame_rate: float, rng: np.random.Generator) -> PosedSubject:
    """Return body and poses of a person on the floor plan; `rng` draws the sitting posture."""
    naked = subject_of(person.body)
    if isinstance(person.clip, PoseClip):
        poses = person.clip.every(frame_rate).poses
    else:
        poses = retarget(read_clip(person.clip).resampled(frame_rate), naked).poses
    if person.seated:
        poses = seated(poses, naked, rng)
    else:
        poses = poses - np.eye(skeleton.POSE_SIZE)[1] * floor_of(naked, poses)
    turn = float(np.deg2rad(person.yaw)) - facing_of(poses[0])
    placed = turned(poses, turn, mean_place(poses), np.array([person.at[0], 0.0, person.at[1]]))
    body = naked if person.dress is None else person.dress(naked)
    hanging = len(body.vertices) - len(naked.vertices)
    held = (person.held[0] * frame_rate, person.held[1] * frame_rate)
    return PosedSubject(body, placed, round(person.enters * frame_rate), hanging, person.holds, held)


def mean_place(poses: np.ndarray) -> np.ndarray:
    """Return the mean position (3,) of the root on the floor in poses (T, P)."""
    return poses[:, skeleton.ROOT_POSITION].mean(axis=0) * [1.0, 0.0, 1.0]


def turned(poses: np.ndarray, angle: float | np.ndarray, about: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Return poses (T, P) rotated about a vertical axis, which is then moved.

    Parameters
    ----------
    angle : radians about +y, one or (T, 1)
    about : (3,), point of the axis, metres
    to : (3,) or (T, 3), new position of that point, metres
    """
    from scipy.spatial.transform import Rotation

    turn, result = Rotation.from_euler("y", angle), poses.copy()
    result[:, skeleton.ROOT_POSITION] = turn.apply(poses[:, skeleton.ROOT_POSITION] - about) + to
    result[:, skeleton.ROOT_ROTATION] = (turn * Rotation.from_rotvec(poses[:, skeleton.ROOT_ROTATION])).as_rotvec()
    return result


def floor_of(body: Body, poses: np.ndarray) -> float:
    """Return the height of the floor below poses (T, P), metres: the body's lowest point in at most 100 of them."""
    rows = np.linspace(0, len(poses) - 1, min(len(poses), 100)).astype(int)
    return min(float(body.vertex_positions(poses[row])[:, 1].min()) for row in rows)


def facing_of(pose: np.ndarray) -> float:
    """Return the yaw of a pose's facing about +y from +z, radians."""
    from scipy.spatial.transform import Rotation

    facing = Rotation.from_rotvec(pose[skeleton.ROOT_ROTATION]).as_matrix()[:, 2]
    return float(np.arctan2(facing[0], facing[2]))


def furniture_of(person: SimulatedPerson, performer: PosedSubject) -> Mesh:
    """Return the furniture of a person: seats under the hips, a desk before a sitter, obstacles towards the camera."""
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
        distance = 0.12  # metres from the person's legs and trunk to the obstacle
        reach = distance + _reach(body, poses, at, forward, over_knees=person.seated and kind != "crate")
        boxes = OBSTACLES[kind](HEIGHTS[kind] * body.height)
        meshes.append(boxes_mesh(boxes, yaw, (at[0] + reach * forward[0], at[1] + reach * forward[1])))
    return joined(meshes)


def _reach(body: Body, poses: np.ndarray, at: tuple[float, float], forward: np.ndarray, *, over_knees: bool) -> float:
    """Return the forward extent of trunk and legs (only the trunk at a table over the knees), metres."""
    named = [
        i
        for i, name in enumerate(skeleton.REPORTED)
        if name in ("pelvis", "spine", "neck") or (not over_knees and name.split("_")[-1] in ("knee", "ankle", "foot"))
    ]
    joints = body.joint_positions(poses)[:, named]
    return float(((joints[..., [0, 2]] - at) @ forward).max()) + CHEST * body.height


def check_apart(performers: Sequence[PosedSubject]) -> None:
    """Check that no two people overlap.

    Raises
    ------
    UsageError
        In a frame the trunks of two people overlap.
    """
    for i, first in enumerate(performers):
        for j, second in enumerate(performers[:i]):
            start, end = max(first.first, second.first), min(first.end, second.end)
            if start >= end:
                continue
            gaps = np.linalg.norm(
                _trunk(first, start, end)[:, :, None] - _trunk(second, start, end)[:, None], axis=-1
            ).min(axis=(1, 2))
            needed = CHEST * (first.body.height + second.body.height)
            if gaps.min() < needed:
                frame = start + int(gaps.argmin())
                raise UsageError(
                    f"person {i + 1} is inside person {j + 1} in frame {frame}: their trunks are {gaps.min():.2f} m "
                    f"apart and need {needed:.2f}; place them elsewhere"
                )


def check_clear(performers: Sequence[PosedSubject], boxes: Sequence[Box]) -> None:
    """Check that no person overlaps the furniture of the room.

    Raises
    ------
    UsageError
        In a frame a person's trunk is inside a box.
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
    """Return points along the trunk in frames `start` to `end`: float64 (end - start, 5, 3)."""
    joints = performer.body.joint_positions(performer.poses[start - performer.first : end - performer.first])
    pelvis, neck = (joints[:, skeleton.REPORTED.index(name)][:, None] for name in ("pelvis", "neck"))
    return pelvis + np.linspace(0.0, 1.0, 5)[:, None] * (neck - pelvis)
