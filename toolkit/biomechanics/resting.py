"""Feet that rest do not slide: where a foot carries, its leg is bent until heel and ball stay where they rest.

For finished tracks only: where a foot rests is known of the whole contact. The root and everything but the legs stay
as they were found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit import skeleton
from toolkit.biomechanics.contact import contacts_of_soles, frames_in, ground_height, smoothed, spans, without_short
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
    raised : metres above where it rests from which on heel or ball is no longer down
    brief : seconds that it is raised at least; a shorter time is noise
    drift : seconds, standard deviation of the Gaussian over a resting foot's places: it follows what lasts longer
    farthest : metres that a sole is moved at most; farther, the contact is doubted and the foot left alone
    stiffness : metres of the sole for a radian of the leg's angles
    knee : weight with which the knee stays where it was found
    rounds : of Gauss-Newton
    """

    blend: float = 0.10
    raised: float = 0.03
    brief: float = 0.13
    drift: float = 0.6
    farthest: float = 0.06
    stiffness: float = 0.01
    knee: float = 0.2
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
    ramp = _ramp(len(rows), frames_in(settings.blend, times[span]))
    moved = ramp[:, None, None] * _corrections(rows, times[span], settings)
    if np.linalg.norm(moved, axis=2).max() > settings.farthest:
        return
    for k, i in enumerate(range(span.start, span.stop)):
        if ramp[k] > 0:
            poses[i] = _bent(body, sole, entries, poses[i], rows[k] + moved[k], settings)


def _corrections(rows: np.ndarray, times: np.ndarray, settings: RestSettings) -> np.ndarray:
    """By how much heel, ball and ankle (N, 3, 3) are to be moved: heel or ball that is down to where it rests, one that
    is raised, as the heel before a foot leaves, along with the other; the ankle rests where both are down.
    """
    heights = rows[:, :2, 1]
    down = heights < np.percentile(heights, 25, axis=0) + settings.raised
    brief = frames_in(settings.brief, times)
    down = np.stack([without_short(down[:, point], brief) for point in range(2)], axis=1)
    down = np.column_stack([down, down.all(axis=1)])
    moved = np.zeros_like(rows)
    for point in range(3):
        held = down[:, point]
        if held.any():
            moved[held, point] = _resting(rows[held, point], times[held], settings.drift) - rows[held, point]
    for point in range(2):
        along = ~down[:, point] & down[:, 1 - point]
        moved[along, point] = moved[along, 1 - point]
        moved[along, 2] = moved[along, 1 - point]
    return moved


def _resting(rows: np.ndarray, times: np.ndarray, drift: float) -> np.ndarray:
    """Where a point (N, 3) rests: its places under a wide Gaussian, a short contact's their median."""
    if len(rows) <= frames_in(drift, times):
        return np.broadcast_to(np.median(rows, axis=0), rows.shape)
    return smoothed(rows, times, drift)


def _ramp(count: int, blend: int) -> np.ndarray:
    """Weights (count,) that rise over the first frames and fall over the last."""
    steps = np.arange(count) + 0.5
    return np.clip(np.minimum(steps, steps[::-1]) / blend, 0.0, 1.0)


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
