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
from toolkit.tracking.guess import Guess, LimbGuesser
from toolkit.tracking.observation import Observation, Observer
from toolkit.tracking.person import Person
from toolkit.tracking.search.labelings import EFFECTORS
from toolkit.tracking.search.protocol import Finisher, Rival, Search
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
    guesser : judges limbs of which nothing is observed; None believes whatever pose wins
    finisher : has the last word where the person has to be found anew; None leaves it to the searches

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
        guesser: LimbGuesser | None = None,
        finisher: Finisher | None = None,
    ) -> None:
        super().__init__(state, objective.placer, level_rotation, sources)
        self.observer, self.searches, self.objective = observer, tuple(searches), objective
        self._settings, self._sizes, self._guesser, self._finisher = settings, tuple(sizes), guesser, finisher
        self.observation: Observation | None = None

    def step(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> FrameResult:
        """Find the person in the next frame, at `timestamp` seconds; without a sighting nobody is there.

        As Baak 2013, 5.4 has it: the cloud and its landmarks (5.3), hypotheses from the previous pose (5.4.1) and from
        the database (5.4.3), and of them the one nearest to the frame (5.4.4).
        """
        state, self.observation = self.state, None
        cloud = None if sighting is None else Cloud.from_depth(sighting.depth, sighting.camera, self.level_rotation)
        clock.lap("prepare")
        if sighting is None or cloud is None or len(cloud) < self._settings.smallest_person:
            return self._unseen(EMPTY, timestamp, clock)

        observation = self.observer.observe(cloud, timestamp, state, sighting.unobserved, sighting.joints)
        self.observation = observation
        observation.scene, observation.facing  # noqa: B018 - looked at now, so that their time is booked here
        clock.lap("landmarks")

        rivals: list[Rival] = []
        rng, carry = self.rng(), dict(state.carry)
        held = state.held is not None and state.held_since is not None and timestamp - state.held_since <= HELD
        if held:
            self._propose(observation, replace(state, previous=state.held), rng, carry, rivals, clock)
        for body in (state.body,) if state.sized else self._sizes:
            self._propose(observation, replace(state, body=body), rng, carry, rivals, clock)
        first = state.previous is None and not held  # nobody turns round in the moment for which they were hidden
        if self._finisher is not None and first and rivals:
            rivals += self._finisher.finished(observation, rivals)
            clock.lap(self._finisher.name)
        self.state = state = replace(state, carry=carry, generator=self.after(rng), turn=_turn(state))
        if not rivals:
            return self._unseen(LOST, timestamp, clock)

        winner = min(rivals, key=lambda rival: rival.doubt if first else rival.comparison.distance)
        result = self._commit(winner, observation, timestamp)
        clock.lap("select")
        return replace(result, stage_ms=clock.milliseconds)

    def _propose(
        self,
        observation: Observation,
        state: PersonState,
        rng: np.random.Generator,
        carry: dict[str, Mapping[str, np.ndarray]],
        rivals: list[Rival],
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
                rivals.append(Rival(hypothesis, state.body, compared))
            if proposal.carry is not None:
                carry[search.name] = proposal.carry
            clock.lap(search.name)

    def _commit(self, winner: Rival, observation: Observation, timestamp: float) -> FrameResult:
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
            held=None,
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

    def _completed(self, winner: Rival) -> Guess:
        """The winner, whose unobserved limbs do not jump."""
        pose, previous = winner.hypothesis.pose, self.state.previous
        if self._guesser is None:
            return Guess(pose, np.zeros(len(skeleton.REPORTED)))
        before = None if previous is None or winner.hypothesis.continues else previous.pose
        return self._guesser.guess(pose, winner.comparison, self.objective, before)

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
            held = replace(before.previous, before=None)
            self.state = replace(self.state, held=held, held_since=before.timestamp)
        return replace(self.predicted_row(state), stage_ms=clock.milliseconds)


def _turn(state: PersonState) -> int:
    return state.turn + (state.previous is not None and not state.lost)


def _in_view(observation: Observation, guess: Guess) -> np.ndarray | None:
    """What has been in view lately; a joint that the pose itself shows is, whatever the votes say."""
    voted = observation.in_view
    return None if voted is None else np.where(guess.observed, 1.0, voted)
