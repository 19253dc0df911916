"""Assignment of tracks to people frame by frame, with CLEAR MOT counts (Bernardin and Stiefelhagen 2008)."""

from typing import NamedTuple

import numpy as np

from toolkit.people.known_people import assigned

GATE = 0.5
"""Largest mean joint distance of a match, metres."""


class Identities(NamedTuple):
    """People and tracks of a recording.

    Attributes
    ----------
    track_of : int64 (T, N), number of the track that follows each person, -1 = none
    switches : how often a person is followed by another track than the last time they were followed
    misses : frames times people who ought to be followed and are not
    false : frames times tracks that follow no person
    """

    track_of: np.ndarray
    switches: int
    misses: int
    false: int


def identities_of(distances: np.ndarray, due: np.ndarray, active: np.ndarray) -> Identities:
    """CLEAR MOT: a match lasts while it is within the gate; the rest is matched at the least total distance.

    Parameters
    ----------
    distances : float64 (T, N, M), metres, between N people and M tracks in each frame; NaN where either is absent
    due : bool (T, N), whether a person ought to be followed; a person who ought not may be, and is not missed otherwise
    active : bool (T, M), whether a track says that a person is there
    """
    frames, people, _ = distances.shape
    costs = np.where((distances <= GATE) & active[:, None], distances, np.inf)
    track_of = np.full((frames, people), -1, dtype=np.int64)
    last = np.full(people, -1, dtype=np.int64)
    current = last.copy()
    switches = 0
    for t in range(frames):
        now = np.full(people, -1, dtype=np.int64)
        held = np.flatnonzero(current >= 0)
        held = held[np.isfinite(costs[t, held, current[held]])]
        now[held] = current[held]
        free = costs[t].copy()
        free[held] = np.inf
        free[:, now[held]] = np.inf
        for person, track in assigned(free, np.full(people, GATE)):
            now[person] = track
        found = now >= 0
        switches += int((found & (last >= 0) & (now != last)).sum())
        last = np.where(found, now, last)
        track_of[t] = current = now
    followed = track_of >= 0
    return Identities(track_of, switches, int((due & ~followed).sum()), int(active.sum() - followed.sum()))
