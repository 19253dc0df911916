"""Second tracking of a recording with predictions for occluded limbs, and comparison of all candidates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from toolkit.app.stabilise.demands import contradiction
from toolkit.app.stabilise.source_run import SourceRun
from toolkit.fitting.priors import GaussianPrior, LimbPrior, PoseTerm, ResidualTerm
from toolkit.io.progress import Count
from toolkit.people.survey import find_person
from toolkit.retrieval.priors.gap_trajectories import AGAIN, PRIOR_SPREAD, PRIOR_WEIGHT, GapWays
from toolkit.retrieval.priors.limb_entries import OUTER
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower
from toolkit.tracking.guide import NoGuide
from toolkit.tracking.tracker_protocol import judge_of
from toolkit.tracks import FrameResult


class GapGuide(NoGuide):
    """Guide with priors on limbs in their gaps and on the whole pose in bad frames (6.4.3).

    A prior on all limbs would degrade the observed ones; see `docs/architecture.md`.

    Parameters
    ----------
    ways : through each gap, with what is expected there
    whole : frame -> whole pose, in bad frames
    times : of the frames, seconds
    marked : frame -> terms on occluded limbs
    """

    def __init__(
        self,
        ways: Sequence[GapWays],
        whole: Mapping[int, GaussianPrior],
        times: np.ndarray,
        marked: Mapping[int, Sequence[ResidualTerm]],
    ) -> None:
        self._marked = {float(times[frame]): tuple(terms) for frame, terms in marked.items()}
        self._whole = {float(times[frame]): prior for frame, prior in whole.items()}
        self._priors: dict[float, list[LimbPrior]] = {}
        for way in ways:
            for place in np.flatnonzero(way.hidden):
                if way.gap.start + place in whole:
                    continue
                mean, variance = way.expected.mean[place], way.expected.variance[place]
                prior = LimbPrior(PRIOR_WEIGHT, way.entries, mean, variance + PRIOR_SPREAD**2)
                self._priors.setdefault(float(times[way.gap.start + place]), []).append(prior)

    def priors(self, timestamp: float) -> Sequence[PoseTerm]:
        """See `Guide.priors`."""
        likely = [self._whole[timestamp]] if timestamp in self._whole else self._priors.get(timestamp, [])
        return [*likely, *self._marked.get(timestamp, ())]

    def contradicts(self, timestamp: float, pose: np.ndarray) -> float:
        """Return the cost (P,) in metres of poses that violate the template entries of occluded limbs in the frame."""
        return contradiction(self._marked.get(timestamp, ()), pose)


class Retracked(NamedTuple):
    """Result of the second tracking.

    Attributes
    ----------
    rows : one result per frame
    distances : for each gap float64 (C, D), metres, of each candidate from each frame; infinite without a person
    angles : for each gap float64 (C, D, A), with those of tracking again
    confidence : for each gap float64 (C, D, 3), of the limb's outer joints for each candidate
    explained : float64 (T,), metres: distances of the original poses; infinite without a person
    whole : float64 (2, T), metres: distances of the original and of the new whole pose; NaN in good frames
    """

    rows: list[FrameResult]
    distances: list[np.ndarray]
    angles: list[np.ndarray]
    confidence: list[np.ndarray]
    explained: np.ndarray
    whole: np.ndarray


def retrack(
    source: SourceRun,
    poses: np.ndarray,
    ways: Sequence[GapWays],
    bad: np.ndarray,
    guide: GapGuide,
    progress: Count,
) -> Retracked:
    """Track the recording again, guided in the gaps, and compare all candidates with its frames.

    Parameters
    ----------
    source : the run
    poses : float64 (T, P), current poses; a candidate replaces one limb of them
    ways : through each gap
    bad : bool (T,), frames in which the whole pose may be exchanged
    guide : what is known beside the depth
    progress : told after each frame
    """
    tracker, recording = source.tracker, source.recording
    tracker.guide = guide
    finder = find_person(recording, tracker.settings.sensing, judge_of(tracker))
    follower = tracker.follower(finder.camera, source.info.R_level_camera, source.body)
    rows: list[FrameResult] = []
    explained, whole = np.full(len(poses), np.inf), np.full((2, len(poses)), np.nan)
    angles = [way.angles.copy() for way in ways]
    distances = [np.full(way.angles.shape[:2], np.inf) for way in ways]
    confidence = [np.zeros((*way.angles.shape[:2], len(OUTER[way.gap.limb]))) for way in ways]
    for frame in recording.stream():
        number = len(rows)
        if number == len(poses):
            break
        (sighting,) = finder.find(frame.depth_mm, frame.timestamp, {})
        rows.append(follower.step(sighting, frame.timestamp, StageClock(tracker.stage_names)))
        for gap, way in enumerate(ways):
            if way.gap.start <= number < way.gap.stop:
                place = number - way.gap.start
                angles[gap][way.names.index(AGAIN), place] = rows[-1].pose[way.entries]
                if follower.observation is not None:
                    distances[gap][:, place], confidence[gap][:, place] = _compared(
                        follower, partial(guide.contradicts, frame.timestamp), poses[number], way,
                        angles[gap][:, place],
                    )  # fmt: skip
        if follower.observation is not None:
            scene = follower.observation.scene
            explained[number] = follower.objective.compare(follower.body, poses[number], scene).distance
            if bad[number]:
                fresh = follower.objective.compare(follower.body, rows[-1].pose, scene)
                whole[:, number] = explained[number], fresh.distance
        progress(number + 1, len(poses))
    return Retracked(rows, distances, angles, confidence, explained, whole)


def _compared(
    follower: Follower, contradicts: Callable[[np.ndarray], float], pose: np.ndarray, way: GapWays, angles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return distances (C,) from the frame and confidence of outer joints for a pose (P,) with limb angles (C, A)."""
    assert follower.observation is not None  # already computed
    scene = follower.observation.scene
    distances, confidence = np.empty(len(angles)), np.empty((len(angles), len(OUTER[way.gap.limb])))
    for row, own in enumerate(angles):
        moved = pose.copy()
        moved[way.entries] = own
        compared = follower.objective.compare(follower.body, moved, scene)
        distances[row] = compared.distance + contradicts(moved)
        confidence[row] = follower.objective.confidence(compared)[OUTER[way.gap.limb]]
    return distances, confidence
