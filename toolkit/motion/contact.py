"""Which foot carries: low over the ground and slow, with hysteresis on both; and how high the ground lies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.sole import soles
from toolkit.io.spans import spans
from toolkit.tracks import TRACKED, Track
from toolkit.tracks.runs import Person

NEAR_FLOOR = 0.15
"""Metres between the floor that the camera sees and the height at which feet rest: farther, they rest on something."""
REACH = 4.0
"""Standard deviations that a Gaussian reaches."""
SHORTEST_STEP = 1e-4
"""Seconds: frames that are nearer in time are of one moment, and say nothing about the rate of a camera."""


ANKLES = [skeleton.REPORTED.index(f"{side}_ankle") for side in ("left", "right")]
LOW, HIGH = 0.05, 0.09
"""Metres over the ground below which a sole's lower point must come, and above which it leaves."""
SLOW, FAST = 0.30, 0.55
"""The same in metres a second along the ground, of the sole's slower point."""
SMOOTHING = 0.045
"""Seconds, standard deviation of the Gaussian over the sole's places before speeds are taken."""
SHORTEST = 0.10
"""Seconds that a contact, or a gap between two, lasts at least."""


def foot_contacts(body: Body, track: Track, camera_height: float | None = None) -> np.ndarray:
    """Whether the left and the right foot carry: bool (T, 2), False where the person is not tracked.

    Parameters
    ----------
    body : that the poses belong to
    track : one row per frame, level frame
    camera_height : metres of the camera above the floor, None where none is seen
    """
    placed, tracked = soles(body, track.pose), track.state == TRACKED
    ground = ground_height(placed, track.timestamps, tracked)
    if camera_height is not None and (ground is None or abs(ground + camera_height) > NEAR_FLOOR):
        ground = -camera_height
    if ground is None:
        return np.zeros((len(track), 2), dtype=bool)
    return contacts_of_soles(placed, track.timestamps, ground, tracked)


def contacts_of_soles(placed: np.ndarray, times: np.ndarray, ground: float, known: np.ndarray) -> np.ndarray:
    """The same from heel and ball of both feet (T, 2, 2, 3), y up, metres, and the ground's y; `known` is bool (T,)."""
    found = np.zeros((len(times), 2), dtype=bool)
    for span in spans(known):
        rows, own = placed[span], times[span]
        heights = rows[..., 1].min(axis=2) - ground
        speeds = _sole_speeds(rows, own)
        shortest = frames_in(SHORTEST, own)
        for side in range(2):
            enter = (heights[:, side] < LOW) & (speeds[:, side] < SLOW)
            stay = (heights[:, side] < HIGH) & (speeds[:, side] < FAST)
            found[span, side] = without_short(hysteresis(enter, stay), shortest)
    return found


def _sole_speeds(placed: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Speed along the ground of the slower one of heel and ball: float64 (T, 2), metres a second."""
    if len(times) < 2:
        return np.zeros(placed.shape[:2])
    flat = smoothed(placed, times, SMOOTHING)[..., [0, 2]]
    velocities = np.gradient(flat, np.maximum.accumulate(times + 1e-9 * np.arange(len(times))), axis=0)
    return np.asarray(np.linalg.norm(velocities, axis=-1).min(axis=2))


def smoothed(values: np.ndarray, times: np.ndarray, seconds: float) -> np.ndarray:
    """Values (T, ...) under a Gaussian of so many seconds, without shift in time."""
    if len(times) < 2 or not seconds > 0:
        return values
    deviation = seconds / typical_step(times)  # frames
    reach = int(REACH * deviation + 0.5)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    padded = np.pad(values, [(reach, reach), *[(0, 0)] * (values.ndim - 1)], mode="symmetric")
    out = np.zeros(values.shape)
    for k, weight in enumerate(weights / weights.sum()):
        out += weight * padded[k : k + len(values)]
    return out


def typical_step(times: np.ndarray) -> float:
    """Median seconds from frame to frame, 1/30 where there are too few."""
    steps = np.diff(times)
    steps = steps[steps > SHORTEST_STEP]
    return float(np.median(steps)) if len(steps) else 1.0 / 30.0


def frames_in(seconds: float, times: np.ndarray) -> int:
    """Frames that last so many seconds, at least one."""
    return max(1, round(seconds / typical_step(times)))


def ground_height(placed: np.ndarray, times: np.ndarray, known: np.ndarray) -> float | None:
    """Height at which the feet rest, y in metres, from soles (T, 2, 2, 3); None of no person.

    The median of what is within 6 cm of the lowest twentieth of all heights of slow feet.
    """
    heights = []
    for span in spans(known):
        lower = placed[span][..., 1].min(axis=2)
        slow = _sole_speeds(placed[span], times[span]) < SLOW
        heights.append(lower[slow])
    resting = np.concatenate(heights) if heights else np.zeros(0)
    if not len(resting):
        resting = placed[known][..., 1].ravel()
    if not len(resting):
        return None
    return float(np.median(resting[resting <= np.percentile(resting, 5) + 0.06]))


def ground_of(people: Sequence[Person]) -> tuple[float, str]:
    """Y of the ground in the level frame, metres, and how it is known: "seen by the camera", "where the feet rest", or
    "guessed" (no foot was ever seen).
    """
    seen = next((person.camera_height for person in people if person.camera_height is not None), None)
    if seen is not None:
        return -seen, "seen by the camera"
    for watched in (True, False):
        found = []
        for person in people:
            track = person.track
            known = track.state == TRACKED if watched else person.there
            if watched:
                known = known & track.observed[:, ANKLES].any(axis=1)
            height = ground_height(soles(person.body, track.pose), track.timestamps, known)
            found += [] if height is None else [height]
        if found:
            return min(found), "where the feet rest" if watched else "guessed"
    return 0.0, "guessed"


def hysteresis(enter: np.ndarray, stay: np.ndarray) -> np.ndarray:
    """Bool (T,): from where `enter` holds as long, in both directions, as `stay` does."""
    held = np.zeros(len(enter), dtype=bool)
    for span in spans(stay | enter):
        held[span] = enter[span].any()
    return held


def without_short(flags: np.ndarray, shortest: int) -> np.ndarray:
    """Bool (T,): the same with gaps and then stretches of fewer frames taken away; those at the ends stay."""
    kept = flags.copy()
    for value in (False, True):
        for span in spans(kept == value):
            inside = span.start > 0 and span.stop < len(kept)
            if inside and span.stop - span.start < shortest:
                kept[span] = not value
    return kept
