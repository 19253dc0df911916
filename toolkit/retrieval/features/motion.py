"""Motions as the relational features see them: 24 named joints over time, from a clip, from poses or from joints.

World frame: y up, right-handed; the features ignore position, heading and size, so any such frame and any unit of
length do.
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
    name : what reports call it
    joints : float64 (T, 24, 3), positions of `NAMED_JOINTS`, any unit of length, world frame (y up, right-handed)
    frame_rate : frames per second, > 0
    root_axis : float64 (T, 3) or None, the root's own x axis in the world; None where the source has no root
        orientation

    Raises
    ------
    MocapError
        No frames, an impossible frame rate, or joints that are not finite.
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
        """Frames start to stop - 1 as a motion of their own."""
        axis = None if self.root_axis is None else self.root_axis[start:stop]
        return replace(self, joints=self.joints[start:stop], root_axis=axis)

    def at_speed(self, factor: float) -> Motion:
        """The motion `factor` times as fast at the same frame rate, positions linear between frames.

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
        """The motion with other frames per second, positions linear between frames; equally fast."""
        if frame_rate == self.frame_rate:
            return self
        slower = self.at_speed(self.frame_rate / frame_rate)
        return replace(slower, name=self.name, frame_rate=frame_rate)

    def mirrored(self) -> Motion:
        """The motion seen in a mirror: x changes sign, left and right change names.

        The root's x axis stays its left-to-right axis, so its reflection is turned round.
        """
        flip = np.array([-1.0, 1.0, 1.0])
        axis = None if self.root_axis is None else -self.root_axis * flip
        return replace(self, name=f"{self.name} (mirrored)", joints=self.joints[:, MIRRORED] * flip, root_axis=axis)


@lru_cache(maxsize=1)
def joint_maps() -> dict[str, dict[str, dict[str, float]]]:
    """The shipped maps, `rig -> named joint -> {source point: weight}` (`configs/retrieval/joints.yaml`)."""
    raw = yaml.safe_load(shipped("retrieval", "joints.yaml").read_text(encoding="utf-8"))
    return {
        rig: {joint: {value: 1.0} if isinstance(value, str) else dict(value) for joint, value in table.items()}
        for rig, table in raw.items()
    }


def from_clip(clip: Clip) -> Motion:
    """The named joints of a motion capture clip (world frame, metres).

    They are taken by the first joint map whose joints the clip has. A skeleton that none of these fits, but that can be
    retargeted, is retargeted to the neutral body.

    Raises
    ------
    RigError
        Neither is possible; the message lists what the nearest map misses.
    """
    positions, rotations = clip.world()
    try:
        joints = _gather(_clip_points(clip, positions, rotations), clip.name)
    except RigError as missing:
        return _retargeted(clip, missing)
    return Motion(clip.name, joints, float(clip.frame_rate), np.asarray(rotations[:, 0, :, 0]))


def _retargeted(clip: Clip, missing: RigError) -> Motion:
    """A clip on the neutral body, as long as the clip: frames that retargeting drops hold the first pose."""
    try:
        rig = load_rig(clip)
    except RigError:
        raise missing from None
    body = load_body("neutral")
    poses = retarget(clip, body, rig).poses
    poses = np.concatenate([np.repeat(poses[:1], len(clip) - len(poses), axis=0), poses])
    return from_poses(poses, body, float(clip.frame_rate), clip.name)


def from_joints(joints: np.ndarray, frame_rate: float, name: str) -> Motion:
    """The named joints from the 20 reported joints (T, 20, 3) in a frame with y up; tips are continued along bones."""
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
    """The named joints from a body's poses (T, P) in any frame with y up.

    The 20 reported joints do not suffice: points of the trunk, the finger tips, the toes and the top of the head come
    from the chain and from the end-effector vertices.
    """
    poses = np.ascontiguousarray(np.atleast_2d(skeleton.check_pose(poses)))
    carried = _carried(body)
    centres = np.empty((len(poses), len(skeleton.JOINTS), 3))
    moved = np.empty((len(poses), len(carried.points), 3))
    kinematics.key_points(
        poses, skeleton.PARENTS, body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS, *carried[1:], centres, moved
    )
    names = (*skeleton.JOINT_NAMES, *carried.names)
    points = dict(zip(names, np.concatenate([centres, moved], axis=1).transpose(1, 0, 2), strict=True))
    from scipy.spatial.transform import Rotation

    axis = Rotation.from_rotvec(poses[:, skeleton.ROOT_ROTATION]).as_matrix()[:, :, 0]
    return Motion(name, _gather(points, name), frame_rate, axis)


class _Carried(NamedTuple):
    """Points of a body beside the joint centres: their names, rest positions (V, 3), skin joints and weights (V, S)."""

    names: tuple[str, ...]
    points: np.ndarray
    skin_joints: np.ndarray
    skin_weights: np.ndarray


def _carried(body: Body) -> _Carried:
    """The tips of the end effectors, and points of trunk and head."""
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


def points_of_body(body: Body) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What `relations.named_joints` needs of a body: points, their skin joints and weights, and those of the means."""
    carried = _carried(body)
    sources = (*skeleton.JOINT_NAMES, *carried.names)
    gather = np.zeros((len(NAMED_JOINTS), len(sources)))
    for row, joint in enumerate(NAMED_JOINTS):
        for source, weight in joint_maps()["body"][joint].items():
            gather[row, sources.index(source)] = weight
    return *carried[1:], gather


def _carried_points(body: Body) -> dict[str, tuple[int, np.ndarray]]:
    """Points beside the joint centres: name -> the joint that carries it and its rest position (3,), metres."""
    joints = dict(zip(skeleton.JOINT_NAMES, body.joints, strict=True))
    shoulders = 0.5 * (joints["left_shoulder"] + joints["right_shoulder"])
    trunk = float(np.linalg.norm(shoulders - joints["root"]))
    site = skeleton.SITES.index(("head", "cervical"))
    points = {"head": (int(skeleton.SITE_PARENTS[site]), body.sites[site])}
    for joint in ("root", "thorax"):
        points[f"{joint}.back"] = (skeleton.JOINT_NAMES.index(joint), joints[joint] - [0.0, 0.0, trunk])
    return points


def from_track(track: Track, body: Body, name: str) -> Motion:
    """The named joints of a track through its poses (level frame), at the median rate of its time stamps.

    Where the person was lost or not there, or frames are missing, joints go straight on to where they are known again:
    the pose that a track holds meanwhile, and the jump that ends it, are no person's motion.
    """
    motion = from_poses(track.pose, body, frame_rate_of(track.timestamps), name)
    low, high, share = even_frames(track)
    assert motion.root_axis is not None  # poses have one
    return replace(
        motion,
        joints=motion.joints[low] + share[:, None, None] * (motion.joints[high] - motion.joints[low]),
        root_axis=motion.root_axis[low] + share[:, None] * (motion.root_axis[high] - motion.root_axis[low]),
    )


def even_frames(track: Track) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A track on an even clock: for each tick the followed frames before and behind it, int64 (T,) each, and how far it
    lies on the way from one to the other, float64 (T,) in [0, 1]. A track without a gap gives its own frames.
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


def frame_rate_of(timestamps: np.ndarray) -> float:
    """Frames per second of `timestamps` (T,), seconds, by their median step; 30 where that says nothing."""
    steps = np.diff(timestamps)
    return 1.0 / float(np.median(steps)) if len(steps) and np.median(steps) > 0 else 30.0


def _clip_points(clip: Clip, positions: np.ndarray, rotations: np.ndarray) -> dict[str, np.ndarray]:
    """Every joint's origin under its name and every bone's far end under "NAME.end", float64 (T, 3) each."""
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
    """Fill the named joints (T, 24, 3) by the first map whose source points are all there."""
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
