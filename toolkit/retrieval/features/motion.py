"""Motions of 24 named joints, the input of relational features, from clips, poses or joints.

World frame: y up, right-handed. The features ignore position, heading and size, so any such frame and any unit of
length are valid.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import yaml

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.io.errors import MocapError, RigError
from toolkit.io.files import shipped
from toolkit.kernels import kinematics
from toolkit.mocap.retarget import retarget
from toolkit.mocap.rig import load_rig
from toolkit.sensing.recording import frame_rate_of
from toolkit.tracks import TRACKED

if TYPE_CHECKING:
    from toolkit.mocap.clip import Clip
    from toolkit.tracks import Track

SIDES: tuple[str, str] = ("left", "right")

NAMED_JOINTS: tuple[str, ...] = (
    "root", "belly", "chest", "neck", "head", "headtop",
    *(f"{side}_{joint}" for side in SIDES for joint in (
        "clavicle", "shoulder", "elbow", "wrist", "fingers", "hip", "knee", "ankle", "toes",
    )),
)  # fmt: skip
"""The 24 joints of the relational features; "neck" is the base of the neck, "fingers" and "toes" are tips."""

_PARTNER = {"left": "right", "right": "left"}
MIRRORED: np.ndarray = np.array(
    [NAMED_JOINTS.index("_".join(_PARTNER.get(part, part) for part in name.split("_"))) for name in NAMED_JOINTS]
)
"""Index of each named joint's partner on the other side."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Named joints over time.

    Attributes
    ----------
    name : name in reports
    joints : float64 (T, 24, 3), positions of `NAMED_JOINTS`, any unit of length, world frame (y up, right-handed)
    frame_rate : frames per second, > 0
    root_axis : float64 (T, 3) or None, the root's x axis in the world; None for a source without root orientation

    Raises
    ------
    MocapError
        There are no frames, the frame rate is not positive, or a joint is not finite.
    """

    name: str
    joints: np.ndarray
    frame_rate: float
    root_axis: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.joints.ndim != 3 or self.joints.shape[1:] != (len(NAMED_JOINTS), 3) or not len(self.joints):
            raise MocapError(
                f"motion {self.name!r} has joints of shape {self.joints.shape}; give one row of "
                f"({len(NAMED_JOINTS)}, 3) per frame and at least one frame"
            )
        if not (np.isfinite(self.frame_rate) and self.frame_rate > 0):
            raise MocapError(f"motion {self.name!r} has frame rate {self.frame_rate}; give frames per second above 0")
        if not np.isfinite(self.joints).all():
            frame = int(np.flatnonzero(~np.isfinite(self.joints).all(axis=(1, 2)))[0])
            raise MocapError(f"motion {self.name!r} has a joint without a finite position in frame {frame}; cut it out")

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def duration(self) -> float:
        """Seconds from the first to just after the last frame."""
        return len(self) / self.frame_rate

    def sliced(self, start: int, stop: int) -> Motion:
        """Return frames start to stop - 1 as a motion."""
        axis = None if self.root_axis is None else self.root_axis[start:stop]
        return replace(self, joints=self.joints[start:stop], root_axis=axis)

    def at_speed(self, factor: float) -> Motion:
        """Return the motion `factor` times as fast at the same frame rate, positions linear between frames.

        Raises
        ------
        MocapError
            The factor is not above 0.
        """
        if not (np.isfinite(factor) and factor > 0):
            raise MocapError(f"motion {self.name!r} cannot be played {factor} times as fast; give a factor above 0")
        if len(self) == 1:
            return self
        places = np.arange(0.0, len(self) - 1, factor)
        low = np.minimum(places.astype(np.int64), len(self) - 2)
        share = (places - low)[:, None]
        axis = self.root_axis
        return replace(
            self,
            name=f"{self.name} (speed {factor:g})",
            joints=self.joints[low] + share[..., None] * (self.joints[low + 1] - self.joints[low]),
            root_axis=None if axis is None else axis[low] + share * (axis[low + 1] - axis[low]),
        )

    def at_rate(self, frame_rate: float) -> Motion:
        """Return the motion with another frame rate and the same speed, positions linear between frames."""
        if frame_rate == self.frame_rate:
            return self
        slower = self.at_speed(self.frame_rate / frame_rate)
        return replace(slower, name=self.name, frame_rate=frame_rate)

    def mirrored(self) -> Motion:
        """Return the mirrored motion: x changes sign, left and right exchange names.

        The root's x axis remains its left-to-right axis, so its reflection is reversed.
        """
        flip = np.array([-1.0, 1.0, 1.0])
        axis = None if self.root_axis is None else -self.root_axis * flip
        return replace(self, name=f"{self.name} (mirrored)", joints=self.joints[:, MIRRORED] * flip, root_axis=axis)


@lru_cache(maxsize=1)
def joint_maps() -> dict[str, dict[str, dict[str, float]]]:
    """Return the shipped maps, `rig -> named joint -> {source point: weight}` (`configs/retrieval/joints.yaml`)."""
    raw = yaml.safe_load(shipped("retrieval", "joints.yaml").read_text(encoding="utf-8"))
    return {
        rig: {joint: {value: 1.0} if isinstance(value, str) else dict(value) for joint, value in table.items()}
        for rig, table in raw.items()
    }


def from_clip(clip: Clip) -> Motion:
    """Return the named joints of a motion capture clip (world frame, metres).

    The first joint map that fits the clip is used. A skeleton without such a map is retargeted to the neutral body.

    Raises
    ------
    RigError
        Neither is possible; the message lists the missing joints of the nearest map.
    """
    positions, rotations = clip.world()
    try:
        joints = _gather(_clip_points(clip, positions, rotations), clip.name)
    except RigError as missing:
        return _retargeted(clip, missing)
    return Motion(clip.name, joints, float(clip.frame_rate), np.asarray(rotations[:, 0, :, 0]))


def _retargeted(clip: Clip, missing: RigError) -> Motion:
    """Return a clip on the neutral body; frames that retargeting drops have the first pose."""
    try:
        load_rig(clip)
    except RigError:
        raise missing from None
    body = load_body("neutral")
    poses = retarget(clip, body).poses
    poses = np.concatenate([np.repeat(poses[:1], len(clip) - len(poses), axis=0), poses])
    return from_poses(poses, body, float(clip.frame_rate), clip.name)


def from_joints(joints: np.ndarray, frame_rate: float, name: str) -> Motion:
    """Return the named joints of the 20 reported joints (T, 20, 3) in a frame with y up; tips are extrapolated."""
    joints = np.asarray(joints, dtype=np.float64)
    if joints.ndim != 3 or joints.shape[1:] != (len(skeleton.REPORTED), 3):
        raise RigError(f"joints of {name!r} have shape {joints.shape}; give (frames, {len(skeleton.REPORTED)}, 3)")
    points = dict(zip(skeleton.REPORTED, joints.transpose(1, 0, 2), strict=True))
    trunk = points["neck"] - points["pelvis"]
    across = points["left_hip"] - points["right_hip"]
    forward = np.cross(across, trunk)
    length = np.linalg.norm(forward, axis=-1, keepdims=True)
    forward *= np.linalg.norm(trunk, axis=-1, keepdims=True) / np.where(length > 0, length, 1.0)
    return Motion(name, _gather(points | {"pelvis.back": points["pelvis"] - forward}, name), frame_rate)


def from_poses(poses: np.ndarray, body: Body, frame_rate: float, name: str) -> Motion:
    """Return the named joints of a body's poses (T, P) in any frame with y up.

    Points of the trunk, finger tips, toes and the top of the head come from the kinematic chain and the end-effector
    vertices, because the 20 reported joints do not contain them.
    """
    poses = np.ascontiguousarray(np.atleast_2d(skeleton.check_pose(poses)))
    carried = _carried(body)
    centres = np.empty((len(poses), len(skeleton.JOINTS), 3))
    moved = np.empty((len(poses), len(carried.points), 3))
    unmixed, nothing = np.empty((0, 0)), np.empty((len(poses), 0, 3))
    kinematics.key_points(
        poses, skeleton.PARENTS, body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS, *carried[1:], unmixed, centres,
        moved, nothing,
    )  # fmt: skip
    names = (*skeleton.JOINT_NAMES, *carried.names)
    points = dict(zip(names, np.concatenate([centres, moved], axis=1).transpose(1, 0, 2), strict=True))
    from scipy.spatial.transform import Rotation

    axis = Rotation.from_rotvec(poses[:, skeleton.ROOT_ROTATION]).as_matrix()[:, :, 0]
    return Motion(name, _gather(points, name), frame_rate, axis)


class _Carried(NamedTuple):
    """Points of a body besides the joint centres: names, rest positions (V, 3), skin joints and weights (V, S)."""

    names: tuple[str, ...]
    points: np.ndarray
    skin_joints: np.ndarray
    skin_weights: np.ndarray


@lru_cache(maxsize=4)
def _carried(body: Body) -> _Carried:
    """Return the tips of the end effectors, and points of trunk and head."""
    extras = _carried_points(body)
    joints = np.zeros((len(extras), body.skin_joints.shape[1]), dtype=np.int64)
    joints[:, 0] = [joint for joint, _ in extras.values()]
    weights = np.zeros(joints.shape)
    weights[:, 0] = 1.0
    tips = body.end_effectors
    return _Carried(
        (*(f"{tip}.end" for tip in skeleton.END_EFFECTORS), *extras),
        np.concatenate([body.vertices[tips], [place for _, place in extras.values()]]),
        np.concatenate([body.skin_joints[tips], joints]),
        np.concatenate([body.skin_weights[tips], weights]),
    )


def _carried_points(body: Body) -> dict[str, tuple[int, np.ndarray]]:
    """Return points besides the joint centres: name -> joint that moves it and rest position (3,), metres."""
    joints = dict(zip(skeleton.JOINT_NAMES, body.joints, strict=True))
    shoulders = 0.5 * (joints["left_shoulder"] + joints["right_shoulder"])
    trunk = float(np.linalg.norm(shoulders - joints["root"]))
    site = skeleton.SITES.index(("head", "cervical"))
    points = {"head": (int(skeleton.SITE_PARENTS[site]), body.sites[site])}
    for joint in ("root", "thorax"):
        points[f"{joint}.back"] = (skeleton.JOINT_NAMES.index(joint), joints[joint] - [0.0, 0.0, trunk])
    return points


def from_track(track: Track, body: Body, name: str) -> Motion:
    """Return the named joints of a track's poses (level frame), at the median rate of its timestamps.

    Frames without a tracked person and missing frames are interpolated linearly, because the held pose and the
    following jump are not motion of the person.
    """
    motion = from_poses(track.pose, body, frame_rate_of(track.timestamps), name)
    low, high, share = even_frames(track)
    assert motion.root_axis is not None  # set for poses
    return replace(
        motion,
        joints=motion.joints[low] + share[:, None, None] * (motion.joints[high] - motion.joints[low]),
        root_axis=motion.root_axis[low] + share[:, None] * (motion.root_axis[high] - motion.root_axis[low]),
    )


def even_frames(track: Track) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Resample a track to a uniform clock.

    Returns
    -------
    low, high : int64 (T,), tracked frames before and after each tick; a track without gaps gives its own frames
    share : float64 (T,), position of the tick between them, 0 to 1
    """
    places = (track.timestamps - track.timestamps[0]) * frame_rate_of(track.timestamps)
    known = np.flatnonzero(track.state == TRACKED)
    even = np.abs(places - np.arange(len(places))).max() < 0.5
    if not len(known) or (even and len(known) == len(places)):
        return np.arange(len(places)), np.arange(len(places)), np.zeros(len(places))
    ticks = np.arange(round(float(places[-1])) + 1.0)
    after = np.searchsorted(places[known], ticks)
    low, high = known[np.maximum(after - 1, 0)], known[np.minimum(after, len(known) - 1)]
    share = np.clip((ticks - places[low]) / np.maximum(places[high] - places[low], 1e-9), 0.0, 1.0)
    return low, high, share


def _clip_points(clip: Clip, positions: np.ndarray, rotations: np.ndarray) -> dict[str, np.ndarray]:
    """Return every joint's origin under its name and every bone's far end under "NAME.end", float64 (T, 3)."""
    points: dict[str, np.ndarray] = {}
    for index, full_name in enumerate(clip.joint_names):
        name = full_name.rsplit(":", 1)[-1]
        points[name] = positions[:, index]
        children = np.flatnonzero(np.asarray(clip.parents) == index)
        if full_name in clip.end_sites:
            points[f"{name}.end"] = positions[:, index] + rotations[:, index] @ np.asarray(clip.end_sites[full_name])
        elif len(children):
            points[f"{name}.end"] = positions[:, children[0]]
    return points


def _gather(points: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """Return the named joints (T, 24, 3) by the first map whose source points all exist."""
    missing: dict[str, list[str]] = {}
    for rig, table in joint_maps().items():
        missing[rig] = sorted({source for parts in table.values() for source in parts} - set(points))
        if not missing[rig]:
            rows = [sum(weight * points[source] for source, weight in table[joint].items()) for joint in NAMED_JOINTS]
            return np.stack(rows, axis=1).astype(np.float64)
    nearest = min(missing, key=lambda rig: len(missing[rig]))
    raise RigError(
        f"the skeleton of {name!r} lacks {', '.join(missing[nearest])} (map {nearest!r}); "
        "rename its joints or add a map to configs/retrieval/joints.yaml"
    )
