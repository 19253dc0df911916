"""Second tracking of a recording with priors on occluded limbs, and the comparison of all candidates with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from toolkit.app.stabilise.source_run import SourceRun
from toolkit.body import skeleton
from toolkit.fitting.guide import Guide
from toolkit.fitting.joint_confidence import network_features
from toolkit.fitting.priors import LimbPrior, PoseTerm, ResidualTerm
from toolkit.io.progress import Count
from toolkit.people.survey import find_person
from toolkit.retrieval.priors.gap_trajectories import PRIOR_SPREAD, RETRACKED, GapCandidates
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower
from toolkit.tracks import FrameResult


class GapGuide(Guide):
    """Guide of the second tracking: priors on occluded limbs, and floor terms (6.4.3).

    A prior on all limbs increases the error of visible ones; see `docs/occluded_limbs.md`.

    Parameters
    ----------
    candidates : candidates of each gap, with the expected angles
    times : float64 (T,), seconds, of the frames
    contacts : frame -> floor terms of occluded feet
    """

    def __init__(
        self,
        candidates: Sequence[GapCandidates],
        times: np.ndarray,
        contacts: Mapping[int, Sequence[ResidualTerm]],
    ) -> None:
        self._contacts = {float(times[frame]): tuple(terms) for frame, terms in contacts.items()}
        self._priors: dict[float, list[LimbPrior]] = {}
        weight = 0.003  # m^2 per rad^2 and variance; a tenth of the weight of the depth samples on a visible arm
        for gap in candidates:
            for place in np.flatnonzero(gap.hidden):
                mean, variance = gap.expected.mean[place], gap.expected.variance[place]
                prior = LimbPrior(weight, gap.entries, mean, variance + PRIOR_SPREAD**2)
                self._priors.setdefault(float(times[gap.gap.start + place]), []).append(prior)

    def priors(self, timestamp: float) -> Sequence[PoseTerm]:
        """See `Guide.priors`."""
        return [*self._priors.get(timestamp, ()), *self._contacts.get(timestamp, ())]

    def contact_penalty(self, timestamp: float, pose: np.ndarray) -> float:
        """Return the penalty in metres for the floor terms that a pose (P,) violates."""
        cost = 0.001  # metres added to the distance of a pose for each fully violated floor residual
        return cost * sum(term.violation(pose) for term in self._contacts.get(timestamp, ()))


class Retracked(NamedTuple):
    """Result of the second tracking of T frames.

    Attributes
    ----------
    distances : for each gap float64 (C, D), metres, from each candidate to the frame; infinite without a person
    angles : for each gap float64 (C, D, A), radians, those of the second tracking included
    confidence : for each gap float64 (C, D, 3), of the limb's outer joints for each candidate
    explained : float64 (T,), metres, distances of the poses before; infinite without a person
    """

    distances: list[np.ndarray]
    angles: list[np.ndarray]
    confidence: list[np.ndarray]
    explained: np.ndarray


def retrack(source: SourceRun, candidates: Sequence[GapCandidates], guide: GapGuide, progress: Count) -> Retracked:
    """Track the recording again with a guide, and compare all candidates with its frames.

    Parameters
    ----------
    source : finished run
    candidates : candidates of each gap
    guide : priors and floor terms
    progress : callback for the number of frames done
    """
    tracker, recording, poses = source.tracker, source.recording, source.track.pose
    tracker.guide = guide
    finder = find_person(recording, tracker.settings.sensing)
    follower = tracker.follower(finder.camera, source.info.R_level_camera, source.body)
    rows: list[FrameResult] = []
    explained = np.full(len(poses), np.inf)
    angles = [gap.angles.copy() for gap in candidates]
    distances = [np.full(gap.angles.shape[:2], np.inf) for gap in candidates]
    confidence = [np.zeros((*gap.angles.shape[:2], len(skeleton.OUTER[gap.gap.limb]))) for gap in candidates]
    for frame in recording.stream():
        number = len(rows)
        if number == len(poses):
            break
        (sighting,) = finder.find(frame.depth_mm, frame.timestamp, {})
        rows.append(follower.step(sighting, frame.timestamp, StageClock(tracker.stage_names)))
        for k, own in enumerate(candidates):
            if own.gap.start <= number < own.gap.stop:
                place = number - own.gap.start
                angles[k][own.names.index(RETRACKED), place] = rows[-1].pose[own.entries]
                if follower.observation is not None:
                    distances[k][:, place], confidence[k][:, place] = _compared(
                        follower, partial(guide.contact_penalty, frame.timestamp), poses[number], own,
                        angles[k][:, place],
                    )  # fmt: skip
        if follower.observation is not None:
            scene = follower.observation.scene
            explained[number] = follower.objective.compare(follower.body, poses[number], scene).distance
        progress(number + 1, len(poses))
    return Retracked(distances, angles, confidence, explained)


def _compared(
    follower: Follower,
    penalty: Callable[[np.ndarray], float],
    pose: np.ndarray,
    candidates: GapCandidates,
    angles: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return distances (C,) of a pose (P,) with each candidate's angles (C, A), and its outer joints' confidence."""
    assert follower.observation is not None  # the caller checks it
    scene = follower.observation.scene
    distances, confidence = np.empty(len(angles)), np.empty((len(angles), len(skeleton.OUTER[candidates.gap.limb])))
    for row, own in enumerate(angles):
        moved = pose.copy()
        moved[candidates.entries] = own
        compared = follower.objective.compare(follower.body, moved, scene)
        distances[row] = compared.distance + penalty(moved)
        joints = follower.body.joint_positions(moved)
        estimate = follower.observation.estimate
        network = None if estimate is None else network_features(joints, estimate)
        trust = follower.objective.confidence(compared, joints, network=network)
        confidence[row] = trust[skeleton.OUTER[candidates.gap.limb]]
    return distances, confidence
