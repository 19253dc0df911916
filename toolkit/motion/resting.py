"""Removal of jitter from resting bodies and of sliding from feet in contact, in finished tracks.

Frames in which the whole body is close to its present pose measure the same pose again, so their mean is more accurate.
The leg of a foot in contact is then bent until heel and ball stay in place. Root, trunk and arms do not change.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.sole import FEET, Sole, soles
from toolkit.io.spans import spans
from toolkit.motion.contact import frames_in, smoothed, typical_step
from toolkit.tracks import TRACKED
from toolkit.tracks.runs import Person

CORE = [i for i, name in enumerate(skeleton.REPORTED) if not name.endswith(("shoulder", "elbow", "wrist", "hand"))]
"""Reported joints of trunk and legs, which rest independently of the arms."""
ARMS: dict[str, list[int]] = {
    side: [skeleton.REPORTED.index(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist", "hand")]
    for side in ("left", "right")
}


DISTANCE_SMOOTHING = 0.05
"""Seconds, standard deviation of the Gaussian over positions before distances are computed, against noise."""


def at_rest(person: Person) -> Person:
    """Return the person with resting body and feet held in place; `track.contact` marks the feet in contact."""
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
    """Return poses (N, P) moved to the mean of the close frames near in time; a moving body does not change.

    An arm may move while the rest of the body is still.
    """
    from scipy.spatial.transform import Rotation

    joints = smoothed(body.joint_positions(poses), times, DISTANCE_SMOOTHING)
    turns = Rotation.from_rotvec(poses[:, skeleton.ROOT_ROTATION])
    arms = {side: _entries(side, ("clavicle", "shoulder", "elbow")) for side in ARMS}
    moved, weights = np.zeros_like(poses), np.zeros((len(poses), 1))
    body_seconds = 0.3  # seconds, standard deviation of the Gaussian over the frames that are averaged with a pose
    body_distance = 0.02  # metres, standard deviation of the Gaussian over the largest joint distance between two poses
    for here, there, late in _pairs(times, body_seconds):
        far = np.linalg.norm(joints[there] - joints[here], axis=2)
        core = far[:, CORE].max(axis=1)
        way = poses[there] - poses[here]
        way[:, skeleton.ROOT_ROTATION] = (turns[there] * turns[here].inv()).as_rotvec()
        weight = np.tile(_closeness(core, body_distance)[:, None], poses.shape[1])
        for side, entries in arms.items():
            own = np.maximum(core, far[:, ARMS[side]].max(axis=1))
            weight[:, entries] = _closeness(own, body_distance)[:, None]
        moved[here] += late * weight * way
        weights[here] += late
    moved /= weights
    rested = poses + moved
    turned = Rotation.from_rotvec(moved[:, skeleton.ROOT_ROTATION]) * turns
    rested[:, skeleton.ROOT_ROTATION] = turned.as_rotvec()
    return rested


def _pairs(times: np.ndarray, seconds: float) -> Iterator[tuple[slice, slice, float]]:
    """Yield all pairs of frames at one time shift, with the Gaussian weight of that shift."""
    step, count = typical_step(times), len(times)
    radius = 4.0  # standard deviations at which a Gaussian is truncated (SciPy's default)
    reach = min(count - 1, round(radius * seconds / step))
    for shift in range(-reach, reach + 1):
        here = slice(max(0, -shift), count - max(0, shift))
        there = slice(max(0, shift), count - max(0, -shift))
        yield here, there, float(np.exp(-0.5 * (shift * step / seconds) ** 2))


def _closeness(far: np.ndarray, near: float) -> np.ndarray:
    return np.asarray(np.exp(-0.5 * (far / near) ** 2))


def _hold(body: Body, leg: str, poses: np.ndarray, placed: np.ndarray, span: slice, times: np.ndarray) -> None:
    """Bend one leg over one contact; `placed` (T, 2, 3) are its measured heel and ball, `poses` is changed."""
    sole, entries = Sole.of(body, leg), _entries(leg.split("_")[0], ("hip", "knee", "ankle"))
    ankles = np.array([body.place(pose).origins[sole.joint] for pose in poses[span]])
    rows = np.concatenate([placed[span], ankles[:, None]], axis=1)
    blend = 0.10  # seconds in which a foot moves to its place and leaves it
    ramp = _ramp(span, len(poses), frames_in(blend, times[span]))
    targets = rows + ramp[:, None, None] * (resting(rows, times[span]) - rows)
    for target, i in zip(targets, range(span.start, span.stop), strict=True):
        poses[i] = _bent(body, sole, entries, poses[i], target)


def resting(rows: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the resting positions of points (N, K, 3) of a foot in contact.

    Each is the mean over the frames that are near in time and in position (a bilateral filter in time, Tomasi and
    Manduchi 1998).
    """
    own = smoothed(rows, times, DISTANCE_SMOOTHING)
    total, weights = np.zeros_like(rows), np.zeros(rows.shape[:2])
    foot_seconds = 1.0  # seconds, as `body_seconds` for a foot in contact
    # Metres, as `body_distance` for a foot; heel and ball are filtered separately, because the heel rises first.
    foot_distance = 0.025
    for here, there, late in _pairs(times, foot_seconds):
        weight = late * _closeness(np.linalg.norm(own[there] - own[here], axis=2), foot_distance)
        total[here] += weight[..., None] * rows[there]
        weights[here] += weight
    return np.asarray(total / weights[..., None])


def _ramp(span: slice, count: int, blend: int) -> np.ndarray:
    """Return weights that rise over the first frames of a contact and fall over its last ones.

    At the ends of the track of `count` frames the weights stay 1.
    """
    steps = np.arange(span.stop - span.start) + 0.5
    rise = steps if span.start > 0 else np.full(len(steps), np.inf)
    fall = steps[::-1] if span.stop < count else np.full(len(steps), np.inf)
    return np.asarray(np.clip(np.minimum(rise, fall) / blend, 0.0, 1.0))


def _entries(side: str, parts: tuple[str, ...]) -> np.ndarray:
    """Return the entries of a pose that belong to some joints of a side."""
    joints = [skeleton.JOINT_NAMES.index(f"{side}_{part}") for part in parts]
    return np.asarray(3 + np.flatnonzero(np.isin(skeleton.DOF_JOINT, joints)))


def _bent(body: Body, sole: Sole, entries: np.ndarray, pose: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the pose (P,) with the least bent leg that moves heel, ball and ankle to `target` (3, 3)."""
    knee = int(skeleton.PARENTS[sole.joint])

    def points(at: np.ndarray) -> np.ndarray:
        placed = body.place(at)
        both = placed.origins[sole.joint] + sole.points @ placed.rotations[sole.joint].T
        return np.concatenate([both, placed.origins[[sole.joint, knee]]])

    low, high = skeleton.POSE_LIMITS[entries].T
    start, current = pose[entries], pose.copy()
    aim = np.concatenate([target, points(pose)[3:]])
    forward_step = 1e-5  # radians of a forward difference
    stiffness = 0.01  # metres of the sole for a radian of the leg's angles
    iterations = 3  # Gauss-Newton iterations
    for _ in range(iterations):
        here = points(current)
        jacobian = np.empty((here.size, len(entries)))
        for k, entry in enumerate(entries):
            nudged = current.copy()
            nudged[entry] += forward_step
            jacobian[:, k] = (points(nudged) - here).ravel() / forward_step
        system = np.concatenate([jacobian, stiffness * np.eye(len(entries))])
        wanted = np.concatenate([(aim - here).ravel(), stiffness * (start - current[entries])])
        step = np.linalg.lstsq(system, wanted, rcond=None)[0]
        current[entries] = np.clip(current[entries] + step, np.minimum(low, start), np.maximum(high, start))
    return current
