"""Priors from motion templates on the occluded limbs of a track, and foot contact (thesis 6.4.1, 6.4.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from toolkit.app.stabilise.source_run import SourceRun
from toolkit.body.body import Body
from toolkit.body.sole import FEET, Sole
from toolkit.fitting.priors import ResidualTerm
from toolkit.io.spans import spans
from toolkit.retrieval.features.frames import FrameFeatures
from toolkit.retrieval.features.relational import FEATURE_RATE, FEATURES
from toolkit.retrieval.priors.expectation import GapContext
from toolkit.retrieval.priors.limb_entries import ENTRIES, LIMBS, LIMBS_OF_FEATURE
from toolkit.retrieval.priors.marks import DEMANDED, FORWARDS, rests

BEFORE = 0.125
"""Time for a hand movement, seconds: half of the averaging window of the velocity features."""
WEIGHT, SIGMA = 1.0, 0.1
"""Weight of one prior relative to one correspondence, and the scale of its Geman-McClure weight, metres."""
LEVER = 0.15
"""Metres per radian beyond the bound of an angle: half the length of a forearm."""
DISAGREEMENT = 0.001
"""Cost in metres of a pose that violates one prior completely."""


class Demands:
    """Terms that pull a limb of one body to its template entries.

    Parameters
    ----------
    body : whose poses are fitted
    poses, times : float64 (T, P) and (T,), seconds, the current track; lengths are measured in its first frame, as for
        the features
    """

    def __init__(self, body: Body, poses: np.ndarray, times: np.ndarray) -> None:
        self._poses, self._times = poses, times
        self._features = FrameFeatures(body, FEATURE_RATE)
        self._features.measure(self._features.joints(poses[0])[0])

    def term(self, limb: str, priors: np.ndarray, frame: int) -> ResidualTerm | None:
        """Return the residuals of a limb for the template entries (40,) of one frame, or None if no entry concerns it.

        An entry 1 requires the loose threshold of the feature, an entry 0 requires that the strict one is not exceeded.
        For a hand that moves to the front the bound is its position `BEFORE` seconds earlier plus the distance at the
        loose velocity; a hand that does not move is unconstrained.
        """
        before = int(np.searchsorted(self._times, self._times[frame] - BEFORE - 1e-6))
        seconds = float(self._times[frame] - self._times[before])
        wanted = [number for number in DEMANDED if priors[number - 1] >= 0]
        wanted += [number for number in FORWARDS if priors[number - 1] == 1 and seconds > 0.0]
        rows = np.array([n - 1 for n in wanted if limb in LIMBS_OF_FEATURE[n - 1]], dtype=np.int64)
        if not len(rows):
            return None
        on = priors[rows] == 1
        bounds = np.where(on, self._features.loose[rows], self._features.strict[rows])
        rising = np.array([FEATURES[row].test.startswith(">") for row in rows])
        sides = np.where(on == rising, -1.0, 1.0)  # -1: lower bound, 1: upper bound
        degrees = np.array([FEATURES[row].unit == "deg" for row in rows])
        scales = sides * np.where(degrees, np.radians(1.0) * LEVER, 1.0)
        moving = np.isin(rows + 1, FORWARDS)
        scales[moving] *= seconds
        # A motion of two frames has one velocity, which is their difference over the distance of two feature columns.
        rates = np.where(moving, 1.0 / (FEATURE_RATE * seconds) if seconds else 0.0, 1.0)
        earlier = self._features.joints(self._poses[before])

        def residuals(pose: np.ndarray) -> np.ndarray:
            joints, axes = (np.stack(pair) for pair in zip(earlier, self._features.joints(pose), strict=True))
            values = self._features.quantities(joints, axes, 1, rows)
            return np.maximum(scales * (rates * values - bounds), 0.0)

        return ResidualTerm(WEIGHT, SIGMA, ENTRIES[limb], residuals)


def marked_terms(source: SourceRun, told: GapContext, priors: np.ndarray) -> dict[int, list[ResidualTerm]]:
    """Return frame -> terms on the limbs that are occluded in it.

    Parameters
    ----------
    source : the run
    told : its track, and where its limbs are hidden
    priors : int8 (40, T), tracking priors
    """
    found: dict[int, list[ResidualTerm]] = {}
    demands = Demands(source.body, told.poses, told.times)
    for limb in LIMBS:
        for frame in np.flatnonzero(told.hidden[limb]).tolist():
            term = demands.term(limb, priors[:, frame], frame)
            if term is not None:
                found.setdefault(frame, []).append(term)
    for leg in FEET:
        for frame, resting in _resting(source, told, rests(priors, leg), leg).items():
            found.setdefault(frame, []).append(resting)
    return found


def _resting(source: SourceRun, told: GapContext, resting: np.ndarray, leg: str) -> Mapping[int, ResidualTerm]:
    """Return frame -> contact of an occluded foot on the floor, at its position before the occlusion if known."""
    found, sole = {}, Sole.of(source.body, leg)
    for span in spans(resting):
        hidden = told.hidden[leg][span]
        if not hidden.any():
            continue
        seen = np.flatnonzero(~hidden) + span.start
        places = np.array([sole.at(source.body, told.poses[frame]) for frame in seen])
        rest = np.median(places, axis=0) if len(seen) else None
        term = floor_term(source.body, leg, ENTRIES[leg], source.floor.height, rest)
        found.update(dict.fromkeys((np.flatnonzero(hidden) + span.start).tolist(), term))
    return found


def contradiction(terms: Sequence[ResidualTerm], pose: np.ndarray) -> float:
    """Return the cost (P,) in metres of poses that violate the priors of a frame."""
    return DISAGREEMENT * sum(term.violation(pose) for term in terms)


def floor_term(body: Body, leg: str, entries: np.ndarray, height: float, rest: np.ndarray | None) -> ResidualTerm:
    """Contact of the sole with the floor: heel and ball are pulled to the floor and to their contact position.

    Parameters
    ----------
    body : whose foot it is
    leg, entries : `left_leg` or `right_leg`, and the pose entries of the angles that may change
    height : metres, y of the floor under the foot, level frame
    rest : float64 (2, 3), contact positions of heel and ball (x and z are used); None if unknown
    """
    sole = Sole.of(body, leg)

    def residuals(pose: np.ndarray) -> np.ndarray:
        points = sole.at(body, pose)
        above = points[:, 1] - height
        return above if rest is None else np.concatenate([above, (points - rest)[:, [0, 2]].ravel()])

    return ResidualTerm(WEIGHT, SIGMA, entries, residuals)
