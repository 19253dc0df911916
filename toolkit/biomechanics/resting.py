"""Feet that rest do not slide: where a foot carries, its leg is bent until heel and ball stay where they rest.

For finished tracks only: where a foot rests is known of the whole contact. The root and everything but the legs stay
as they were found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit import skeleton
from toolkit.biomechanics.contact import (
    REACH,
    contacts_of_soles,
    frames_in,
    ground_height,
    smoothed,
    spans,
    typical_step,
)
from toolkit.body.body import Body
from toolkit.body.sole import FEET, Sole, soles
from toolkit.runs import Person
from toolkit.track import TRACKED


@dataclass(frozen=True)
class RestSettings:
    """How feet are held.

    Attributes
    ----------
    blend : seconds in which a foot comes to its place and leaves it
    together : seconds, standard deviation of the Gaussian over the frames that say where a foot rests
    near : metres, the same over how far heel or ball are from there: one that rises, as the heel before a foot leaves,
        goes its own way
    before : seconds, of the Gaussian under which this distance is measured, for noise is no distance
    stiffness : metres of the sole for a radian of the leg's angles
    knee : weight with which the knee stays where it was found, heel, ball and ankle have 1
    rounds : of Gauss-Newton
    """

    blend: float = 0.10
    together: float = 1.0
    near: float = 0.03
    before: float = 0.05
    stiffness: float = 0.01
    knee: float = 1.0
    rounds: int = 3


def with_resting_feet(person: Person, settings: RestSettings | None = None) -> Person:
    """The person with the soles of carrying feet held where they rest; `contact` of the track says which carry."""
    chosen, track = settings or RestSettings(), person.track
    placed = soles(person.body, track.pose)
    contact = track.contact
    if not contact.any():
        tracked = track.state == TRACKED
        ground = ground_height(placed, track.timestamps, tracked)
        if ground is None:
            return person
        contact = contacts_of_soles(placed, track.timestamps, ground, tracked)
    poses = track.pose.copy()
    for side, leg in enumerate(FEET):
        for span in spans(contact[:, side]):
            _hold(person.body, leg, poses, placed[:, side], span, track.timestamps, chosen)
    joints = (person.body.joint_positions(poses) @ person.R_level_camera).astype(track.joints.dtype)
    joints = np.where((poses == track.pose).all(axis=1)[:, None, None], track.joints, joints)
    return replace(person, track=replace(track, pose=poses, joints=joints, contact=contact))


def _hold(
    body: Body, leg: str, poses: np.ndarray, placed: np.ndarray, span: slice, times: np.ndarray, settings: RestSettings
) -> None:
    """Bend one leg over one contact; `placed` (T, 2, 3) are its heel and ball as tracked, `poses` is changed."""
    sole, entries = Sole.of(body, leg), _leg_entries(leg)
    ankles = np.array([body.place(pose).origins[sole.joint] for pose in poses[span]])
    rows = np.concatenate([placed[span], ankles[:, None]], axis=1)
    ramp = _ramp(span, len(poses), frames_in(settings.blend, times[span]))
    targets = rows + ramp[:, None, None] * (resting(rows, times[span], settings) - rows)
    for target, i in zip(targets, range(span.start, span.stop), strict=True):
        poses[i] = _bent(body, sole, entries, poses[i], target, settings)


def resting(rows: np.ndarray, times: np.ndarray, settings: RestSettings) -> np.ndarray:
    """Where points (N, K, 3) of a foot that carries rest: the mean of each over the frames that are near in time and in
    which it is near (a bilateral filter; Tomasi and Manduchi 1998, in time).
    """
    step, own = typical_step(times), smoothed(rows, times, settings.before)
    reach = min(len(rows) - 1, round(REACH * settings.together / step))
    total, weights = np.zeros_like(rows), np.zeros(rows.shape[:2])
    for shift in range(-reach, reach + 1):
        here, there = _overlap(len(rows), shift), _overlap(len(rows), -shift)
        far = np.linalg.norm(own[there] - own[here], axis=2) / settings.near
        weight = np.exp(-0.5 * (shift * step / settings.together) ** 2 - 0.5 * far**2)
        total[here] += weight[..., None] * rows[there]
        weights[here] += weight
    return np.asarray(total / weights[..., None])


def _overlap(count: int, shift: int) -> slice:
    """The frames of so many that have one so many frames later."""
    return slice(max(0, -shift), count - max(0, shift))


def _ramp(span: slice, count: int, blend: int) -> np.ndarray:
    """Weights of the frames of a contact that rise over its first frames and fall over its last, where the track of
    `count` frames goes on before and behind it.
    """
    steps = np.arange(span.stop - span.start) + 0.5
    rise = steps if span.start > 0 else np.inf
    fall = steps[::-1] if span.stop < count else np.inf
    return np.asarray(np.clip(np.minimum(rise, fall) / blend, 0.0, 1.0) * np.ones(len(steps)))


def _leg_entries(leg: str) -> np.ndarray:
    side = leg.split("_")[0]
    joints = [skeleton.JOINT_NAMES.index(f"{side}_{part}") for part in ("hip", "knee", "ankle")]
    return np.asarray(3 + np.flatnonzero(np.isin(skeleton.DOF_JOINT, joints)))


def _bent(
    body: Body, sole: Sole, entries: np.ndarray, pose: np.ndarray, target: np.ndarray, settings: RestSettings
) -> np.ndarray:
    """The pose (P,) with the leg's angles moved as little as brings heel, ball and ankle to `target` (3, 3)."""
    knee, weights = int(skeleton.PARENTS[sole.joint]), np.array([1.0, 1.0, 1.0, settings.knee])[:, None]

    def points(at: np.ndarray) -> np.ndarray:
        placed = body.place(at)
        both = placed.origins[sole.joint] + sole.points @ placed.rotations[sole.joint].T
        return np.concatenate([both, placed.origins[[sole.joint, knee]]]) * weights

    low, high = skeleton.POSE_LIMITS[entries].T
    start, current = pose[entries], pose.copy()
    aim = np.concatenate([target, points(pose)[3:] / settings.knee]) * weights
    for _ in range(settings.rounds):
        here = points(current)
        jacobian = np.empty((here.size, len(entries)))
        for k, entry in enumerate(entries):
            nudged = current.copy()
            nudged[entry] += STEP
            jacobian[:, k] = (points(nudged) - here).ravel() / STEP
        system = np.concatenate([jacobian, settings.stiffness * np.eye(len(entries))])
        wanted = np.concatenate([(aim - here).ravel(), settings.stiffness * (start - current[entries])])
        step = np.linalg.lstsq(system, wanted, rcond=None)[0]
        current[entries] = np.clip(current[entries] + step, np.minimum(low, start), np.maximum(high, start))
    return current


STEP = 1e-5
"""Radians of a forward difference."""
