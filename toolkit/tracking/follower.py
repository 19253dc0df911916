"""Follows one person from sighting to sighting (Baak 2013, 5.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.objective import Objective
from toolkit.fitting.regressed_joints import links_out_of_view
from toolkit.people.sighting import Sighting
from toolkit.sensing.cloud import Cloud
from toolkit.tracking.clock import StageClock
from toolkit.tracking.heading import MAX_HEADING_PENALTY, heading_disagreement, voted_facing
from toolkit.tracking.observation import Observation, Observer
from toolkit.tracking.occluded_limbs import Guess, OccludedLimbs
from toolkit.tracking.person import HEAD, FollowedPerson
from toolkit.tracking.search.labelings import EFFECTORS
from toolkit.tracking.search.search_protocol import Hypothesis, ScoredHypothesis, Search, Verifier, cost_of
from toolkit.tracking.smoothing import PoseSmoother
from toolkit.tracking.state import PersonState, Previous
from toolkit.tracking.stature import head_top, off_floor, stature_prior_cost
from toolkit.tracking.tracking_settings import FollowerSettings
from toolkit.tracks import EMPTY, LOST, TRACKED, FrameResult

HELD = 1.0
"""Seconds out of sight after which the last pose says nothing of the next one."""


class Follower(FollowedPerson):
    """One person before one camera.

    Parameters
    ----------
    observer, searches, objective : how sightings are looked at, where hypotheses come from, and what judges them
    level_rotation : R_level_camera, float64 (3, 3)
    settings : when a frame counts as empty or lost, and what is reported
    sizes : the bodies that are tried where the person's size is unknown
    sources : names of the hypotheses that can win, in the order in which the track numbers them
    state : before the first frame
    occluded_limbs : guesses occluded limbs; None keeps the winner as it is
    verifier : adds hypotheses where the person has to be found anew; None adds none

    Attributes
    ----------
    state : everything that the next step depends on besides the sighting; replaced, never changed, by `step`
    observation : of the last sighting, None without one
    sizes : as above; fewer may be tried
    floor : y of the floor, metres, level frame, None where it is not known: it tells how tall a person is
    heading : float64 (2,), where the person heads in the next frame, see `heading`; zero where it is not known
    scored : all hypotheses of the last frame
    winner : the hypothesis that was selected in the last frame, None where there was none
    """

    held = HELD

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
        self._settings, self.sizes = settings, tuple(sizes)
        self._occluded_limbs, self._verifier = occluded_limbs, verifier
        self.observation: Observation | None = None
        self.floor: float | None = None
        self.heading = np.zeros(2)
        self.scored: Sequence[ScoredHypothesis] = ()
        self.winner: ScoredHypothesis | None = None

    def step(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> FrameResult:
        """Find the person in the next frame, at `timestamp` seconds; without a sighting the frame is empty."""
        self.observation, self.scored, self.winner = None, (), None
        # Baak 2013, 5.3.1: the person's depth as a cloud.
        cloud = None if sighting is None else Cloud.from_depth(sighting.depth, sighting.camera, self.level_rotation)
        clock.record("prepare")
        if sighting is None or cloud is None or len(cloud) < self._settings.smallest_person:
            row, self.state = self.predicted_row(EMPTY), unseen(self.state, timestamp)
            return replace(row, stage_ms=clock.milliseconds)

        # 5.3.4 and 5.4.2: centre, facing and geodesic extrema of the cloud.
        observation = self.observer.observe(cloud, timestamp, self.state, sighting.unobserved, sighting.joints)
        observation.look()
        self.observation = observation
        clock.record("landmarks")

        # 5.4.1 and 5.4.3: hypotheses of the local optimisation and of the database lookup, and what each costs.
        self.scored, asked = self._hypotheses(observation, clock)

        # 5.4.4: late fusion; the hypothesis of least cost is the pose.
        winner = min(self.scored, key=self.cost if asked.sized else self.cost_of_size, default=None)
        if winner is None:
            row, self.state = self.predicted_row(LOST), unseen(asked, timestamp)
        else:
            self.winner = winner
            row, self.state = self._selected(winner, asked, observation)
        clock.record("select")
        return replace(row, stage_ms=clock.milliseconds)

    def shown(self, sighting: Sighting, timestamp: float) -> tuple[float, np.ndarray, float, bool]:
        """Return the visibility of the person in a frame.

        Returns
        -------
        shown : expected number of joints in view, each weighted by its reliability; without a regressor, the share of
            the image that the person covers
        facing : float64 (2,), see `voted_facing`
        top : y of the top of the head, see `head_top`
        whole : neither the image border nor an occluder cuts off a limb
        """
        cloud = Cloud.from_depth(sighting.depth, sighting.camera, self.level_rotation)
        observation = self.observer.observe(cloud, timestamp, self.state, sighting.unobserved, sighting.joints)
        votes = observation.votes
        if votes is None:
            return len(cloud) / cloud.depth.size, voted_facing(None), math.nan, not observation.cut.any()
        joints = float((votes.reliability * votes.in_view).sum())
        whole = not observation.cut.any() or not links_out_of_view(votes.in_view).any()
        return joints, voted_facing(votes), head_top(cloud, votes.points[HEAD]), whole

    @property
    def distance(self) -> float:
        """How far the pose of the last frame is from it, metres; infinite where none was found."""
        return math.inf if self.winner is None else self.winner.comparison.distance

    def cost(self, scored: ScoredHypothesis) -> float:
        """What is to be least, metres: a person heads where the frames around have them head."""
        return self.weighed(scored.cost, scored.hypothesis.pose)

    def cost_of_size(self, scored: ScoredHypothesis) -> float:
        """What is to be least where the size is unknown, metres: unlikely statures cost more."""
        return self.cost(scored) + stature_prior_cost(scored.body.height) + self.off_floor(scored)

    def weighed(self, cost: float, pose: np.ndarray) -> float:
        """Return the cost of a pose (P,), metres, raised by `MAX_HEADING_PENALTY` where the heading disagrees."""
        return cost * (1.0 + MAX_HEADING_PENALTY * heading_disagreement(self.heading, pose))

    def off_floor(self, scored: ScoredHypothesis) -> float:
        """What the floor says against a hypothesis, metres."""
        if self.floor is None or scored.comparison.placed is None:
            return 0.0
        lowest = float((scored.comparison.placed.vertices * self.level_rotation[1]).sum(axis=1).min())
        return off_floor(lowest, self.floor)

    def _hypotheses(self, observation: Observation, clock: StageClock) -> tuple[list[ScoredHypothesis], PersonState]:
        """What the searches say of the frame; and the state, with what they remember of it."""
        state, rng = self.state, self.rng()
        memory = dict(state.memory)
        went = _last_seen(state, observation.timestamp, self.held)
        known = [] if went is None else [replace(state, previous=went)]
        bodies = (state.body,) if state.sized else self.sizes
        # A person who was hidden for a moment has not turned round meanwhile.
        anew = not observation.follows and not known
        scored: list[ScoredHypothesis] = []
        for told in (*known, *(replace(state, body=body) for body in bodies)):
            for search in self.searches:
                proposal = search.propose(observation, told, rng, min(scored, key=cost_of, default=None))
                improved = [hypothesis.improves for hypothesis in proposal.hypotheses]
                scored = [each for each in scored if each not in improved]
                scored += [self._scored(each, told.body, observation, anew) for each in proposal.hypotheses]
                if proposal.memory is not None:
                    memory[search.name] = proposal.memory
                clock.record(search.name)
        if self._verifier is not None and anew and scored:
            scored += self._verifier.verified(observation, scored)
            clock.record(self._verifier.name)
        return scored, replace(state, memory=memory, generator=self.after(rng), turn=_turn(state))

    def _scored(self, hypothesis: Hypothesis, body: Body, observation: Observation, anew: bool) -> ScoredHypothesis:
        """A hypothesis against the frame (5.4.4, Eq. 5.9), unless the search compared it already."""
        compared = hypothesis.comparison
        if compared is None:
            compared = self.objective.compare(body, hypothesis.pose, observation.scene)
        return ScoredHypothesis.of(hypothesis, body, compared, anew=anew)

    def _selected(
        self, winner: ScoredHypothesis, state: PersonState, observation: Observation
    ) -> tuple[FrameResult, PersonState]:
        """The winner as a row of the track, and the state of the next frame."""
        settings, body, elapsed = self._settings, winner.body, observation.elapsed
        continues = state.previous is not None and winner.hypothesis.continues
        guess = self._completed(winner, None if continues else state.previous)
        extrema = observation.free_extrema[:EFFECTORS]
        previous = Previous.of_pose(
            body,
            guess.pose,
            extrema if len(extrema) == EFFECTORS else None,
            state.previous.pose if state.previous is not None and continues else None,
            elapsed,
        )
        tracked = winner.comparison.distance < settings.lost_distance
        lost = 0.0 if tracked else state.lost + elapsed
        given_up = lost >= settings.patience
        smoother = PoseSmoother(settings.smoothing, state.smoothed)
        reported = smoother.update(guess.pose, observation.timestamp)
        following = replace(
            state,
            body=body,
            sized=True,
            previous=None if given_up else previous,
            last_seen=None,
            pose=guess.pose,
            centre=observation.centre,
            facing=observation.facing,
            in_view=_in_view(observation, guess),
            timestamp=observation.timestamp,
            lost=0.0 if given_up else lost,
            smoothed=smoother.last,
        )
        joints = previous.joints if reported is guess.pose else body.joint_positions(reported)
        found = self.objective.confidence(winner.comparison) if tracked else np.zeros(len(joints))
        seen = TRACKED if tracked else LOST
        row = self.row(reported, joints, guess.confidence(found), guess.observed, seen, winner.hypothesis.source)
        return row, following

    def _completed(self, winner: ScoredHypothesis, before: Previous | None) -> Guess:
        """The winner, whose unobserved limbs stay as in the frame before, where the pose does not go on from it."""
        pose = winner.hypothesis.pose
        if self._occluded_limbs is None:
            return Guess(pose, np.zeros(len(skeleton.REPORTED)))
        return self._occluded_limbs.guess(
            pose, winner.comparison, self.objective, None if before is None else before.pose
        )


def unseen(before: PersonState, timestamp: float) -> PersonState:
    """The state after a frame without a sighting or without a hypothesis.

    A person who comes back may stand anywhere, in any pose, facing anywhere; after a short absence they are probably
    near the last place.
    """
    went = {} if before.previous is None else _remember_last_seen(before, before.previous)
    return replace(
        before, previous=None, centre=None, facing=None, in_view=None, timestamp=timestamp, smoothed=None, **went
    )


def _remember_last_seen(state: PersonState, previous: Previous) -> dict[str, Any]:
    return {"last_seen": replace(previous, before=None), "last_seen_at": state.timestamp}


def _last_seen(state: PersonState, timestamp: float, held: float) -> Previous | None:
    """The frame in which the person went out of sight, unless that is more than `held` seconds ago."""
    if state.last_seen_at is None or abs(timestamp - state.last_seen_at) > held:
        return None
    return state.last_seen


def _turn(state: PersonState) -> int:
    return state.turn + (state.previous is not None and not state.lost)


def _in_view(observation: Observation, guess: Guess) -> np.ndarray | None:
    """What has been in view lately; a joint that the pose itself shows is, whatever the votes say."""
    voted = observation.in_view
    return None if voted is None else np.where(guess.observed, 1.0, voted)
