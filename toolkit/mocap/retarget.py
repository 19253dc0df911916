"""Retargeting of a foreign skeleton to the project's body: torso by rotations, limbs by bone directions.

Torso and head use the source's rotations relative to its rest pose. A limb uses the directions of its bones, because
rigs differ in rest pose and in the joint of the twist. Elbow and knee of the body are hinges, so the plane of a bent
limb determines the twist of its shoulder or hip. For a straight limb the source's own twist is used.
"""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.rotations.matrices import (  # fmt: skip
    apply,
    hinge_angles,
    matrices,
    swing,
    transposed,
    unit,
    unwrapped,
    vectors_of,
    without_twist,
)
from toolkit.io.errors import MocapError
from toolkit.mocap.clip import Clip, PoseClip
from toolkit.mocap.plausibility import check_limits
from toolkit.mocap.rig import load_rig
from toolkit.mocap.source import KeyedClip

X, Y = 0, 1

Lever = tuple[float, np.ndarray, np.ndarray]
"""Far point of a limb: lever (m), direction in the limb's frame (T, 3) or (3,), direction in the source (T, 3)."""


def retarget(clip: Clip, body: Body) -> PoseClip:
    """Return the poses of `body` that reproduce the motion of `clip`.

    The world is the clip's own, rotated to y up. The root is the midpoint of the hips, scaled by the ratio of the leg
    lengths and shifted by a constant, so that the feet keep their mean height above the floor y = 0. Leading
    calibration frames are dropped (`source.calibration_frames`).

    Parameters
    ----------
    clip : motion
    body : body with the wanted proportions

    Returns
    -------
    PoseClip; `clamped` is the fraction of frames in which an entry was clipped to `skeleton.POSE_LIMITS`.

    Raises
    ------
    RigError
        No joint map fits, or the rest pose is not aligned with the axes of its file.

    Warns
    -----
    PlausibilityWarning
        Angles were clipped in most frames, see `check_limits`.
    """
    source = KeyedClip.of(clip, load_rig(clip))
    chain = _Chain(body, source.frames)
    chain.turn("root", _pelvis(source))
    for joint in ("lumbar", "thorax"):
        chain.turn(joint, source.rotations.get(joint, chain.world[chain.parent(joint)]))
    chain.turn("cervical", _head(source))
    for side in ("left", "right"):
        _clavicle(chain, source, side)
        _arm(chain, source, side)
        _leg(chain, source, side)
    chain.poses[:, skeleton.ROOT_POSITION] = _root_positions(source, body, chain.poses)
    return check_limits(PoseClip(clip.name, chain.poses, clip.frame_rate, clip.name, chain.clamped))


class _Chain:
    """Poses under construction, joint by joint from the root outwards, with world rotations (T, 3, 3)."""

    def __init__(self, body: Body, frames: int) -> None:
        self.points = dict(zip(skeleton.JOINT_NAMES, body.joints, strict=True))
        self.points |= {name: site for (name, _), site in zip(skeleton.SITES, body.sites, strict=True)}
        self.poses = np.zeros((frames, skeleton.POSE_SIZE))
        self.clamped = np.zeros(skeleton.POSE_SIZE)
        self.world: dict[str, np.ndarray] = {}

    @staticmethod
    def parent(joint: str) -> str:
        return skeleton.JOINT_NAMES[skeleton.PARENTS[skeleton.JOINT_NAMES.index(joint)]]

    def bone(self, start: str, stop: str) -> tuple[np.ndarray, float]:
        """Return the rest direction (3,) and length of a bone of the body."""
        step = self.points[stop] - self.points[start]
        return unit(step), float(np.linalg.norm(step))

    def turn(self, joint: str, world: np.ndarray) -> None:
        """Set a joint to world rotations (T, 3, 3), within its free axes and limits."""
        self.set(joint, vectors_of(world if joint == "root" else transposed(self.world[self.parent(joint)]) @ world))

    def aim(self, joint: str, world: np.ndarray, bone: np.ndarray, now: np.ndarray) -> None:
        """Set a joint as `turn`; if limits change the rotation, swing it to keep `bone` (3,) close to `now` (T, 3).

        Alternating projections give up twist rather than the direction of the bone.
        """
        self.turn(joint, world)
        clamped = self.clamped.copy()
        reaims = 3  # iterations of aligning a limb's first joint with its bone's direction and clipping it
        for _ in range(reaims):
            reached = self.world[joint]
            self.turn(joint, swing(apply(reached, bone), now) @ reached)
        self.clamped = clamped

    def hinge(self, joint: str, axis: int, angles: np.ndarray) -> None:
        """Bend a hinge by `angles` (T,), within its limits."""
        self.set(joint, angles[:, None] * np.eye(3)[axis])

    def set(self, joint: str, vectors: np.ndarray) -> None:
        """Set a joint to rotation vectors (T, 3) relative to its parent, within its free axes and limits."""
        entries = 3 + np.flatnonzero(skeleton.DOF_JOINT == skeleton.JOINT_NAMES.index(joint))
        axes = skeleton.DOF_AXIS[entries - 3]
        low, high = skeleton.POSE_LIMITS[entries].T
        vectors = unwrapped(vectors)
        kept = np.zeros_like(vectors)
        kept[:, axes] = np.clip(vectors[:, axes], low, high)
        self.poses[:, entries] = kept[:, axes]
        self.clamped[entries] = (np.abs(kept - vectors)[:, axes] > 1e-6).mean(axis=0)
        local = matrices(kept)
        self.world[joint] = local if joint == "root" else self.world[self.parent(joint)] @ local


def _pelvis(source: KeyedClip) -> np.ndarray:
    """Return the world rotations of the pelvis, tilted by the source's lumbar bend beyond the limits.

    A deep bend keeps its depth: CMU and HDM05 bend at the hips by more than a lumbar spine can.
    """
    if "lumbar" not in source.rotations:
        return source.rotations["root"]
    lumbar = source.rotations["lumbar"]
    low, high = skeleton.POSE_LIMITS[3 + np.flatnonzero(skeleton.DOF_JOINT == skeleton.JOINT_NAMES.index("lumbar"))].T
    bend = np.clip(vectors_of(transposed(source.rotations["root"]) @ lumbar), low, high)
    return lumbar @ transposed(matrices(bend))


def _head(source: KeyedClip) -> np.ndarray:
    """Return the world rotations of the head, aligned with the direction from neck base to skull."""
    turned = source.rotations["head"]
    rest, now = source.bone("cervical", "skull")
    return swing(apply(turned, rest), now) @ turned


def _clavicle(chain: _Chain, source: KeyedClip, side: str) -> None:
    """Set the swing of the shoulder girdle; its twist is left to the shoulder."""
    key = f"{side}_clavicle"
    local = np.broadcast_to(np.eye(3), (source.frames, 3, 3))
    if key in source.rotations:
        local = without_twist(transposed(source.rotations["thorax"]) @ source.rotations[key], X)
    chain.set(key, vectors_of(local))


def _arm(chain: _Chain, source: KeyedClip, side: str) -> None:
    shoulder, elbow, wrist, hand = (f"{side}_{part}" for part in ("shoulder", "elbow", "wrist", "hand"))
    upper, _ = chain.bone(shoulder, elbow)
    fore, lever = chain.bone(elbow, wrist)
    _, upper_now = source.bone(shoulder, elbow)
    _, fore_now = source.bone(elbow, wrist)
    flexion = hinge_angles(upper, fore, Y, (upper_now * fore_now).sum(axis=1), -1.0 if side == "left" else 1.0)
    bent = apply(_about(Y, flexion), fore)
    chain.aim(shoulder, _aimed(chain, source, shoulder, elbow, [(lever, bent, fore_now)]), upper, upper_now)
    chain.hinge(elbow, Y, flexion)
    if not source.has(hand):
        chain.set(wrist, np.zeros((source.frames, 3)))
        return
    aim = apply(transposed(chain.world[elbow]), source.bone(wrist, hand)[1])
    chain.set(wrist, vectors_of(without_twist(swing(chain.bone(wrist, hand)[0], aim), X)))


def _leg(chain: _Chain, source: KeyedClip, side: str) -> None:
    hip, knee, ankle, foot = (f"{side}_{part}" for part in ("hip", "knee", "ankle", "foot"))
    thigh, _ = chain.bone(hip, knee)
    shin, shin_lever = chain.bone(knee, ankle)
    sole, sole_lever = chain.bone(ankle, foot)
    _, thigh_now = source.bone(hip, knee)
    _, shin_now = source.bone(knee, ankle)
    flexion = hinge_angles(thigh, shin, X, (thigh_now * shin_now).sum(axis=1), 1.0)
    bent = _about(X, flexion)
    levers = [(shin_lever, apply(bent, shin), shin_now)]
    if source.has(foot):
        _, sole_now = source.bone(ankle, foot)
        pitch = hinge_angles(shin, sole, X, (shin_now * sole_now).sum(axis=1), 0.0)
        levers.append((sole_lever, apply(bent @ _about(X, pitch), sole), sole_now))
    chain.aim(hip, _aimed(chain, source, hip, knee, levers), thigh, thigh_now)
    chain.hinge(knee, X, flexion)
    turned = source.rotations[ankle]
    if source.has(foot):
        turned = swing(apply(turned, sole), sole_now) @ turned
    chain.set(ankle, vectors_of(without_twist(transposed(chain.world[knee]) @ turned, Y)))


def _about(axis: int, angles: np.ndarray) -> np.ndarray:
    return matrices(angles[:, None] * np.eye(3)[axis])


def _aimed(chain: _Chain, source: KeyedClip, start: str, stop: str, levers: list[Lever]) -> np.ndarray:
    """Return the world rotations (T, 3, 3) of a limb's first joint: bone direction of the source, twist by the limb.

    The twist minimises the squared distances of the limb's far points from the source's (a planar Procrustes problem).
    Priors of weight `twist_prior` prevent a straight limb from spinning: the source's own twist,
    corrected by its constant offset from the bend planes of the clip, and a relaxed limb, half as swung straight from
    the T-pose and half as swung from hanging down.
    """
    bone, _ = chain.bone(start, stop)
    rest, now = source.bone(start, stop)
    turned = source.rotations[start] @ swing(bone, rest)
    turned = swing(apply(turned, bone), now) @ turned
    evidence = np.zeros(len(now), dtype=np.complex128)
    # Squared sine of the bend at which a far point has half its weight; a smaller bend may be an overstretched elbow.
    bend = np.sin(np.radians(12.0)) ** 2
    for lever, own, wanted in levers:
        seen = _turns_about(now, apply(turned, own), wanted)
        size = np.abs(seen)
        evidence += seen * lever**2 * size / (size + bend)
    # Square metres, weight of the source's own twist, and again of a relaxed limb's twist, against the squared levers
    # (m) of a bent limb's far points.
    twist_prior = 0.0015
    offset = evidence.sum() + len(now) * twist_prior
    prior = np.full(len(now), offset / abs(offset))
    parent = chain.world[chain.parent(start)]
    probe = np.array([0.0, 0.0, 1.0])
    local = apply(transposed(parent), now)
    down = np.array([0.0, -1.0, 0.0])
    for hanging in (swing(bone, bone), swing(bone, down)):
        relaxed = parent @ swing(apply(hanging, bone), local) @ hanging
        untwisted = _turns_about(now, apply(turned, probe), apply(relaxed, probe))
        prior += 0.5 * untwisted / np.abs(untwisted)
    twist = np.angle(evidence + twist_prior * prior)
    return matrices(twist[:, None] * now) @ turned


def _turns_about(axis: np.ndarray, start: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Return complex (T,): rotation about unit `axis` from `start` to `stop`, times their distances from the axis."""
    along = (axis * start).sum(axis=1) * (axis * stop).sum(axis=1)
    return (start * stop).sum(axis=1) - along + 1j * (axis * np.cross(start, stop)).sum(axis=1)


def _root_positions(source: KeyedClip, body: Body, poses: np.ndarray) -> np.ndarray:
    """Return the hip midpoints (T, 3) at the body's scale, with the source's mean height of the feet."""
    rest = dict(zip(skeleton.JOINT_NAMES, body.joints, strict=True))
    length = _leg_length(source.rest)
    shortest_leg = 0.01  # metres, shortest plausible leg
    if not length > shortest_leg:
        raise MocapError(f"the legs of the skeleton are {length:g} m long; give a motion of a whole body")
    scale = _leg_length(rest) / length
    positions = source.pelvis * scale
    feet = [f"{side}_{'foot' if source.has(f'{side}_foot') else 'ankle'}" for side in ("left", "right")]
    own = body.joint_positions(poses)[:, [skeleton.REPORTED.index(name) for name in feet], 1]
    wanted = np.stack([source.positions[name][:, 1] for name in feet], axis=1) * scale
    positions[:, 1] = positions[:, 1] + (wanted - own - positions[:, 1:2]).mean()
    return positions


def _leg_length(rest: dict[str, np.ndarray]) -> float:
    """Return the mean length of both legs, hip to ankle along the bones, metres."""
    bones = [
        (f"{side}_{a}", f"{side}_{b}") for side in ("left", "right") for a, b in (("hip", "knee"), ("knee", "ankle"))
    ]
    return sum(float(np.linalg.norm(rest[b] - rest[a])) for a, b in bones) / 2.0
