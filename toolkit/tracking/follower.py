"""Follows one person from sighting to sighting: observe, propose, judge, commit (Baak 2013, 5.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from toolkit import skeleton
from toolkit.body.body import Body
from toolkit.fitting.objective import Objective
from toolkit.people.sighting import Sighting
from toolkit.sensing.cloud import Cloud
from toolkit.track import EMPTY, LOST, TRACKED, FrameResult
from toolkit.tracking.clock import StageClock
from toolkit.tracking.observation import Observation, Observer
from toolkit.tracking.occluded_limbs import Guess, OccludedLimbs
from toolkit.tracking.person import Person
from toolkit.tracking.search.labelings import EFFECTORS
from toolkit.tracking.search.protocol import ScoredHypothesis, Search, Verifier
from toolkit.tracking.settings import FollowerSettings
from toolkit.tracking.smoothing import PoseSmoother
from toolkit.tracking.state import PersonState, Previous

HELD = 1.0
"""Seconds out of sight after which nobody is expected to come back in the pose in which they went."""


class Follower(Person):
    """One person before one camera.

    Parameters
    ----------
    observer, searches, objective : how sightings are looked at, where hypotheses come from, and what judges them
    level_rotation : R_level_camera, float64 (3, 3)
    settings : when a frame counts as empty or lost, and what is reported
    sizes : the bodies that are tried where the person's size is unknown
    sources : names of the hypotheses that can win, in the order in which the track numbers them
    state : before the first frame
    occluded_limbs : judges limbs of which nothing is observed; None believes whatever pose wins
    verifier : has the last word where the person has to be found anew; None leaves it to the searches

    Attributes
    ----------
    state : everything that the next step depends on besides the sighting; replaced, never changed, by `step`
    observation : of the last sighting, None where nobody was seen
    """

    def __init__(
        self,
        observer: Observer,
        searches: Sequence[Search],
        objective: Objective,
        level_rotation: np.ndarray,
        settings: FollowerSettings,
        sizes: Sequence[Body],
        sources: Sequence[str],
        state: PersonState,
        occluded_limbs: OccludedLimbs | None = None,
        verifier: Verifier | None = None,
    ) -> None:
        super().__init__(state, objective.placer, level_rotation, sources)
        self.observer, self.searches, self.objective = observer, tuple(searches), objective
        self._settings, self._sizes = settings, tuple(sizes)
        self._occluded_limbs, self._verifier = occluded_limbs, verifier
        self.observation: Observation | None = None

    def step(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> FrameResult:
        """Find the person in the next frame, at `timestamp` seconds; without a sighting nobody is there.

        As Baak 2013, 5.4 has it: the cloud and its landmarks (5.3), hypotheses from the previous pose (5.4.1) and from
        the database (5.4.3), and of them the one nearest to the frame (5.4.4).
        """
        state, self.observation = self.state, None
        cloud = None if sighting is None else Cloud.from_depth(sighting.depth, sighting.camera, self.level_rotation)
        clock.record("prepare")
        if sighting is None or cloud is None or len(cloud) < self._settings.smallest_person:
            return self._unseen(EMPTY, timestamp, clock)

        observation = self.observer.observe(cloud, timestamp, state, sighting.unobserved, sighting.joints)
        self.observation = observation
        observation.scene, observation.facing  # noqa: B018 - looked at now, so that their time is booked here
        clock.record("landmarks")

        rivals: list[ScoredHypothesis] = []
        rng, memory = self.rng(), dict(state.memory)
        since = np.inf if state.last_seen_at is None else timestamp - state.last_seen_at
        last_seen = state.last_seen is not None and since <= HELD
        if last_seen:
            self._propose(observation, replace(state, previous=state.last_seen), rng, memory, rivals, clock)
        for body in (state.body,) if state.sized else self._sizes:
            self._propose(observation, replace(state, body=body), rng, memory, rivals, clock)
        first = state.previous is None and not last_seen  # nobody turns round in the moment for which they were hidden
        if self._verifier is not None and first and rivals:
            rivals += self._verifier.finished(observation, rivals)
            clock.record(self._verifier.name)
        self.state = state = replace(state, memory=memory, generator=self.after(rng), turn=_turn(state))
        if not rivals:
            return self._unseen(LOST, timestamp, clock)

        winner = min(rivals, key=lambda rival: rival.map_cost if first else rival.comparison.distance)
        result = self._commit(winner, observation, timestamp)
        clock.record("select")
        return replace(result, stage_ms=clock.milliseconds)

    def _propose(
        self,
        observation: Observation,
        state: PersonState,
        rng: np.random.Generator,
        memory: dict[str, Mapping[str, np.ndarray]],
        rivals: list[ScoredHypothesis],
        clock: StageClock,
    ) -> None:
        """Ask every search and judge what it says."""
        for search in self.searches:
            best = min(rivals, key=lambda rival: rival.comparison.distance, default=None)
            proposal = search.propose(observation, state, rng, best)
            for hypothesis in proposal.hypotheses:
                compared = hypothesis.comparison
                if compared is None:
                    compared = self.objective.compare(state.body, hypothesis.pose, observation.scene)
                if hypothesis.supersedes and best is not None:
                    rivals.remove(best)
                rivals.append(ScoredHypothesis(hypothesis, state.body, compared))
            if proposal.memory is not None:
                memory[search.name] = proposal.memory
            clock.record(search.name)

    def _commit(self, winner: ScoredHypothesis, observation: Observation, timestamp: float) -> FrameResult:
        """Remember the winner and report it."""
        settings, state, body = self._settings, self.state, winner.body
        source = winner.hypothesis.source
        guess = self._completed(winner)
        pose = guess.pose
        tracked = winner.comparison.distance < settings.lost_distance
        extrema = observation.free_extrema[:EFFECTORS]
        before = state.previous.pose if state.previous is not None and winner.hypothesis.continues else None
        elapsed = observation.elapsed
        previous = Previous.of_pose(body, pose, extrema if len(extrema) == EFFECTORS else None, before, elapsed)
        lost = 0.0 if tracked else state.lost + elapsed
        given_up = lost >= settings.patience
        smoother = PoseSmoother(settings.smoothing, state.smoothed)
        reported = smoother.update(pose, timestamp)
        self.state = replace(
            state,
            body=body,
            sized=True,
            previous=None if given_up else previous,
            last_seen=None,
            pose=pose,
            centre=observation.centre,
            facing=observation.facing,
            in_view=_in_view(observation, guess),
            timestamp=timestamp,
            lost=0.0 if given_up else lost,
            smoothed=smoother.last,
        )
        joints = previous.joints if reported is pose else body.joint_positions(reported)
        found = self.objective.confidence(winner.comparison) if tracked else np.zeros(len(joints))
        confidence = guess.confidence(found)
        return self.row(reported, joints, confidence, guess.observed, TRACKED if tracked else LOST, source)

    def _completed(self, winner: ScoredHypothesis) -> Guess:
        """The winner, whose unobserved limbs do not jump."""
        pose, previous = winner.hypothesis.pose, self.state.previous
        if self._occluded_limbs is None:
            return Guess(pose, np.zeros(len(skeleton.REPORTED)))
        before = None if previous is None or winner.hypothesis.continues else previous.pose
        return self._occluded_limbs.guess(pose, winner.comparison, self.objective, before)

    def _unseen(self, state: int, timestamp: float, clock: StageClock) -> FrameResult:
        """The last known pose, or a standing one before there was any, for a frame that shows nobody.

        Whoever comes back may stand anywhere, in any pose, facing anywhere; but who was hidden for a moment is probably
        where they went.
        """
        before = self.state
        self.state = replace(
            before, previous=None, centre=None, facing=None, in_view=None, timestamp=timestamp, smoothed=None
        )
        if before.previous is not None:
            last_seen = replace(before.previous, before=None)
            self.state = replace(self.state, last_seen=last_seen, last_seen_at=before.timestamp)
        return replace(self.predicted_row(state), stage_ms=clock.milliseconds)


def _turn(state: PersonState) -> int:
    return state.turn + (state.previous is not None and not state.lost)


def _in_view(observation: Observation, guess: Guess) -> np.ndarray | None:
    """What has been in view lately; a joint that the pose itself shows is, whatever the votes say."""
    voted = observation.in_view
    return None if voted is None else np.where(guess.observed, 1.0, voted)
