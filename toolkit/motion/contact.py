"""Foot contact, by height and speed of the sole with hysteresis, and the height of the ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.sole import soles
from toolkit.io.spans import spans
from toolkit.tracks import TRACKED, Track
from toolkit.tracks.runs import Person

ENTER_SPEED = 0.30
"""Metres a second along the ground below which the slower point of a sole begins a contact."""

ANKLES = [skeleton.REPORTED.index(f"{side}_ankle") for side in ("left", "right")]


def foot_contacts(body: Body, track: Track, camera_height: float | None = None) -> np.ndarray:
    """Return the contact of the left and the right foot: bool (T, 2), False in frames without a tracked person.

    Parameters
    ----------
    body : body of the poses
    track : one row per frame, level frame
    camera_height : metres of the camera above the floor, None without a detected floor
    """
    placed, tracked = soles(body, track.pose), track.state == TRACKED
    ground = ground_height(placed, track.timestamps, tracked)
    # Metres between the floor in the camera's view and the height of resting feet; at a larger distance the feet rest
    # on another surface.
    floor_tolerance = 0.15
    if camera_height is not None and (ground is None or abs(ground + camera_height) > floor_tolerance):
        ground = -camera_height
    if ground is None:
        return np.zeros((len(track), 2), dtype=bool)
    return contacts_of_soles(placed, track.timestamps, ground, tracked)


def contacts_of_soles(placed: np.ndarray, times: np.ndarray, ground: float, known: np.ndarray) -> np.ndarray:
    """Return foot contact from heel and ball of both feet (T, 2, 2, 3), y up, metres, and the ground's y.

    `known` is bool (T,).
    """
    from scipy.ndimage import binary_propagation

    found = np.zeros((len(times), 2), dtype=bool)
    enter_height = 0.05  # metres above the ground below which the lower point of a sole begins a contact
    leave_height = 0.09  # metres above which it ends the contact
    leave_speed = 0.55  # metres a second above which it ends the contact
    shortest_seconds = 0.10  # seconds, shortest contact and shortest gap between two contacts
    for span in spans(known):
        rows, own = placed[span], times[span]
        heights = rows[..., 1].min(axis=2) - ground
        speeds = _sole_speeds(rows, own)
        shortest = frames_in(shortest_seconds, own)
        for side in range(2):
            enter = (heights[:, side] < enter_height) & (speeds[:, side] < ENTER_SPEED)
            stay = (heights[:, side] < leave_height) & (speeds[:, side] < leave_speed)
            found[span, side] = without_short(binary_propagation(enter, mask=enter | stay), shortest)
    return found


def _sole_speeds(placed: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the speed along the ground of the slower one of heel and ball: float64 (T, 2), metres a second."""
    if len(times) < 2:
        return np.zeros(placed.shape[:2])
    smoothing = 0.045  # seconds, standard deviation of the Gaussian over the sole before speeds are computed
    flat = smoothed(placed, times, smoothing)[..., [0, 2]]
    velocities = np.gradient(flat, np.maximum.accumulate(times + 1e-9 * np.arange(len(times))), axis=0)
    return np.asarray(np.linalg.norm(velocities, axis=-1).min(axis=2))


def smoothed(values: np.ndarray, times: np.ndarray, seconds: float) -> np.ndarray:
    """Return values (T, ...) filtered by a Gaussian of `seconds`, without a shift in time."""
    if len(times) < 2 or not seconds > 0:
        return values
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(values, seconds / typical_step(times), axis=0, mode="reflect")


def typical_step(times: np.ndarray) -> float:
    """Return the median time step in seconds, 1/30 for fewer than two frames."""
    steps = np.diff(times)
    shortest_step = 1e-4  # seconds; frames with a smaller time step are ignored for the frame rate
    steps = steps[steps > shortest_step]
    return float(np.median(steps)) if len(steps) else 1.0 / 30.0


def frames_in(seconds: float, times: np.ndarray) -> int:
    """Return the number of frames in `seconds`, at least one."""
    return max(1, round(seconds / typical_step(times)))


def ground_height(placed: np.ndarray, times: np.ndarray, known: np.ndarray) -> float | None:
    """Return the height of resting feet, y in metres, from soles (T, 2, 2, 3); None without a person.

    The median of the heights of slow feet within 6 cm of their 5th percentile.
    """
    heights = []
    for span in spans(known):
        lower = placed[span][..., 1].min(axis=2)
        slow = _sole_speeds(placed[span], times[span]) < ENTER_SPEED
        heights.append(lower[slow])
    resting = np.concatenate(heights) if heights else np.zeros(0)
    if not len(resting):
        resting = placed[known][..., 1].ravel()
    if not len(resting):
        return None
    return float(np.median(resting[resting <= np.percentile(resting, 5) + 0.06]))


def ground_of(people: Sequence[Person]) -> tuple[float, str]:
    """Return y of the ground in the level frame, metres, and its source.

    The source is "seen by the camera", "where the feet rest", or "guessed" (no foot was ever visible).
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


def without_short(flags: np.ndarray, shortest: int) -> np.ndarray:
    """Return bool (T,) flags without short gaps and then without short runs; those at the ends remain."""
    kept = flags.copy()
    for value in (False, True):
        for span in spans(kept == value):
            inside = span.start > 0 and span.stop < len(kept)
            if inside and span.stop - span.start < shortest:
                kept[span] = not value
    return kept
