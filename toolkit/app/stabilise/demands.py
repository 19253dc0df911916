"""MT priors on the hidden limbs of a track: demands on their poses, and feet on the floor (thesis 6.4.1, 6.4.2)."""

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
"""Seconds over which a hand has to move: half of what the velocity of these features is averaged over."""
WEIGHT, SIGMA = 1.0, 0.1
"""Of one demand against one correspondence, and metres, the scale of its Geman-McClure weight."""
LEVER = 0.15
"""Metres that a radian beyond the bound of an angle counts as: half a forearm."""
DISAGREEMENT = 0.001
"""Metres by which a pose that contradicts one demand altogether is farther from its frame."""


class Demands:
    """Terms that hold a limb of one body to its marks.

    Parameters
    ----------
    body : whose poses are fitted
    poses, times : float64 (T, P) and (T,), seconds, the track so far; lengths are measured in its first frame, as
        features do it
    """

    def __init__(self, body: Body, poses: np.ndarray, times: np.ndarray) -> None:
        self._poses, self._times = poses, times
        self._features = FrameFeatures(body, FEATURE_RATE)
        self._features.measure(self._features.joints(poses[0])[0])

    def term(self, limb: str, priors: np.ndarray, frame: int) -> ResidualTerm | None:
        """How far a limb is beyond what tracking priors (40,) of one frame demand; None where they say nothing of it.

        A feature that is 1 demands its loose threshold, one that is 0 that its strict one is not passed. A hand that
        moves to the front is at least so far before its place in the track `BEFORE` that frame as its loose velocity
        takes it meanwhile; one that does not is free.
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
        sides = np.where(on == rising, -1.0, 1.0)  # -1: at least the bound, 1: at most
        degrees = np.array([FEATURES[row].unit == "deg" for row in rows])
        scales = sides * np.where(degrees, np.radians(1.0) * LEVER, 1.0)
        moving = np.isin(rows + 1, FORWARDS)
        scales[moving] *= seconds
        # In a motion of two frames every velocity is their difference, as far apart as two columns of features are.
        rates = np.where(moving, 1.0 / (FEATURE_RATE * seconds) if seconds else 0.0, 1.0)
        earlier = self._features.joints(self._poses[before])

        def residuals(pose: np.ndarray) -> np.ndarray:
            joints, axes = (np.stack(pair) for pair in zip(earlier, self._features.joints(pose), strict=True))
            values = self._features.quantities(joints, axes, 1, rows)
            return np.maximum(scales * (rates * values - bounds), 0.0)

        return ResidualTerm(WEIGHT, SIGMA, ENTRIES[limb], residuals)


def marked_terms(source: SourceRun, told: GapContext, priors: np.ndarray) -> dict[int, list[ResidualTerm]]:
    """Frame -> terms on the limbs that are hidden in it.

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
    """Frame -> the foot on the floor, where it rests and is hidden; in its place if it was seen there meanwhile."""
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
    """Metres that a pose's (P,) distance from its frame grows by for the demands that it violates."""
    return DISAGREEMENT * sum(term.violation(pose) for term in terms)


def floor_term(body: Body, leg: str, entries: np.ndarray, height: float, rest: np.ndarray | None) -> ResidualTerm:
    """The sole of a foot on the floor: both points pulled down or up to it, and to where they came to rest.

    Parameters
    ----------
    body : whose foot it is
    leg, entries : `left_leg` or `right_leg`, and where the angles stand in a pose that may give way
    height : metres, y of the floor under the foot, level frame
    rest : float64 (2, 3), where heel and ball rest, of which x and z count; None where that is not known
    """
    sole = Sole.of(body, leg)

    def residuals(pose: np.ndarray) -> np.ndarray:
        points = sole.at(body, pose)
        above = points[:, 1] - height
        return above if rest is None else np.concatenate([above, (points - rest)[:, [0, 2]].ravel()])

    return ResidualTerm(WEIGHT, SIGMA, entries, residuals)
