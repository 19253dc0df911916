"""What rests stays where it is: a body that stands still does not tremble, feet that carry do not slide.

For finished tracks only: where something rests is known of the frames before and after. A moment in which the whole
body is near where it is now says the same pose once more, so the mean over such moments is the better one. Where a foot
carries, its leg is then bent until heel and ball stay where they rest; the root and everything but the legs stay.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.sole import FEET, Sole, soles
from toolkit.io.spans import spans
from toolkit.motion.contact import REACH, frames_in, smoothed, typical_step
from toolkit.tracks import TRACKED
from toolkit.tracks.runs import Person

CORE = [i for i, name in enumerate(skeleton.REPORTED) if not name.endswith(("shoulder", "elbow", "wrist", "hand"))]
"""Reported joints that say whether trunk and legs rest; an arm may move while they do."""
ARMS: dict[str, list[int]] = {
    side: [skeleton.REPORTED.index(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist", "hand")]
    for side in ("left", "right")
}
STEP = 1e-5
"""Radians of a forward difference."""


BODY, BODY_NEAR = 0.3, 0.02
"""Seconds and metres, standard deviations of the Gaussians over the frames that say a pose once more: by when they are,
and by how far the joint that is farthest is from where it is now."""
FOOT, FOOT_NEAR = 1.0, 0.025
"""The same of where a foot that carries rests; heel and ball each for itself, for one that rises, as the heel before a
foot leaves, goes its own way."""
BEFORE = 0.05
"""Seconds, of the Gaussian under which these distances are measured, for noise is no distance."""
BLEND = 0.10
"""Seconds in which a foot comes to its place and leaves it."""
STIFFNESS = 0.01
"""Metres of the sole for a radian of the leg's angles."""
ROUNDS = 3
"""Of Gauss-Newton."""


def at_rest(person: Person) -> Person:
    """The person with what rests held where it is; `contact` of the track says which feet carry."""
    track = person.track
    poses = track.pose.copy()
    for span in spans(track.state == TRACKED):
        poses[span] = _still_body(person.body, poses[span], track.timestamps[span])
    placed = soles(person.body, poses)
    for side, leg in enumerate(FEET):
        for span in spans(track.contact[:, side]):
            _hold(person.body, leg, poses, placed[:, side], span, track.timestamps)
    joints = (person.body.joint_positions(poses) @ person.R_level_camera).astype(track.joints.dtype)
    joints = np.where((poses == track.pose).all(axis=1)[:, None, None], track.joints, joints)
    return replace(person, track=replace(track, pose=poses, joints=joints))


def _still_body(body: Body, poses: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Poses (N, P) moved to their mean over the frames near in time, by the share of these in which the body is near,
    too: one that moves stays as it was found. An arm may move by itself.
    """
    from scipy.spatial.transform import Rotation

    joints = smoothed(body.joint_positions(poses), times, BEFORE)
    turns = Rotation.from_rotvec(poses[:, skeleton.ROOT_ROTATION])
    arms = {side: _entries(side, ("clavicle", "shoulder", "elbow")) for side in ARMS}
    moved, weights = np.zeros_like(poses), np.zeros((len(poses), 1))
    for here, there, late in _pairs(times, BODY):
        far = np.linalg.norm(joints[there] - joints[here], axis=2)
        core = far[:, CORE].max(axis=1)
        way = poses[there] - poses[here]
        way[:, skeleton.ROOT_ROTATION] = (turns[there] * turns[here].inv()).as_rotvec()
        weight = np.tile(_closeness(core, BODY_NEAR)[:, None], poses.shape[1])
        for side, entries in arms.items():
            own = np.maximum(core, far[:, ARMS[side]].max(axis=1))
            weight[:, entries] = _closeness(own, BODY_NEAR)[:, None]
        moved[here] += late * weight * way
        weights[here] += late
    moved /= weights
    rested = poses + moved
    turned = Rotation.from_rotvec(moved[:, skeleton.ROOT_ROTATION]) * turns
    rested[:, skeleton.ROOT_ROTATION] = turned.as_rotvec()
    return rested


def _pairs(times: np.ndarray, seconds: float) -> Iterator[tuple[slice, slice, float]]:
    """Frames and those so many frames later or earlier, with the weight of that time under a Gaussian."""
    step, count = typical_step(times), len(times)
    reach = min(count - 1, round(REACH * seconds / step))
    for shift in range(-reach, reach + 1):
        here = slice(max(0, -shift), count - max(0, shift))
        there = slice(max(0, shift), count - max(0, -shift))
        yield here, there, float(np.exp(-0.5 * (shift * step / seconds) ** 2))


def _closeness(far: np.ndarray, near: float) -> np.ndarray:
    return np.asarray(np.exp(-0.5 * (far / near) ** 2))


def _hold(body: Body, leg: str, poses: np.ndarray, placed: np.ndarray, span: slice, times: np.ndarray) -> None:
    """Bend one leg over one contact; `placed` (T, 2, 3) are its heel and ball as found, `poses` is changed."""
    sole, entries = Sole.of(body, leg), _entries(leg.split("_")[0], ("hip", "knee", "ankle"))
    ankles = np.array([body.place(pose).origins[sole.joint] for pose in poses[span]])
    rows = np.concatenate([placed[span], ankles[:, None]], axis=1)
    ramp = _ramp(span, len(poses), frames_in(BLEND, times[span]))
    targets = rows + ramp[:, None, None] * (resting(rows, times[span]) - rows)
    for target, i in zip(targets, range(span.start, span.stop), strict=True):
        poses[i] = _bent(body, sole, entries, poses[i], target)


def resting(rows: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Where points (N, K, 3) of a foot that carries rest: the mean of each over the frames that are near in time and in
    which it is near (a bilateral filter, Tomasi and Manduchi 1998, in time).
    """
    own = smoothed(rows, times, BEFORE)
    total, weights = np.zeros_like(rows), np.zeros(rows.shape[:2])
    for here, there, late in _pairs(times, FOOT):
        weight = late * _closeness(np.linalg.norm(own[there] - own[here], axis=2), FOOT_NEAR)
        total[here] += weight[..., None] * rows[there]
        weights[here] += weight
    return np.asarray(total / weights[..., None])


def _ramp(span: slice, count: int, blend: int) -> np.ndarray:
    """Weights of the frames of a contact that rise over its first frames and fall over its last, where the track of
    `count` frames goes on before and behind it.
    """
    steps = np.arange(span.stop - span.start) + 0.5
    rise = steps if span.start > 0 else np.full(len(steps), np.inf)
    fall = steps[::-1] if span.stop < count else np.full(len(steps), np.inf)
    return np.asarray(np.clip(np.minimum(rise, fall) / blend, 0.0, 1.0))


def _entries(side: str, parts: tuple[str, ...]) -> np.ndarray:
    """Entries of a pose that belong to some joints of a side."""
    joints = [skeleton.JOINT_NAMES.index(f"{side}_{part}") for part in parts]
    return np.asarray(3 + np.flatnonzero(np.isin(skeleton.DOF_JOINT, joints)))


def _bent(body: Body, sole: Sole, entries: np.ndarray, pose: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The pose (P,) with the leg's angles moved as little as brings heel, ball and ankle to `target` (3, 3)."""
    knee = int(skeleton.PARENTS[sole.joint])

    def points(at: np.ndarray) -> np.ndarray:
        placed = body.place(at)
        both = placed.origins[sole.joint] + sole.points @ placed.rotations[sole.joint].T
        return np.concatenate([both, placed.origins[[sole.joint, knee]]])

    low, high = skeleton.POSE_LIMITS[entries].T
    start, current = pose[entries], pose.copy()
    aim = np.concatenate([target, points(pose)[3:]])
    for _ in range(ROUNDS):
        here = points(current)
        jacobian = np.empty((here.size, len(entries)))
        for k, entry in enumerate(entries):
            nudged = current.copy()
            nudged[entry] += STEP
            jacobian[:, k] = (points(nudged) - here).ravel() / STEP
        system = np.concatenate([jacobian, STIFFNESS * np.eye(len(entries))])
        wanted = np.concatenate([(aim - here).ravel(), STIFFNESS * (start - current[entries])])
        step = np.linalg.lstsq(system, wanted, rcond=None)[0]
        current[entries] = np.clip(current[entries] + step, np.minimum(low, start), np.maximum(high, start))
    return current
