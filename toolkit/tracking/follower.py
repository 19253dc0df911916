"""Follower of one person from sighting to sighting (Baak 2013, 5.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.objective import Objective
from toolkit.io.parts import Parts, whole
from toolkit.people.connection import HELD, connected
from toolkit.people.sighting import Sighting
from toolkit.sensing.cloud import Cloud
from toolkit.tracking.clock import StageClock
from toolkit.tracking.heading import estimated_facing, sighted_facing, weighed
from toolkit.tracking.observation import Observation, Observer
from toolkit.tracking.occluded_limbs import Guess, OccludedLimbs
from toolkit.tracking.person import HEAD, FollowedPerson
from toolkit.tracking.search.labelings import EFFECTORS
from toolkit.tracking.search.search_protocol import (
    Hypothesis,
    ScoredHypothesis,
    Search,
    SearchInParts,
    Verifier,
    cost_of,
)
from toolkit.tracking.smoothing import PoseSmoother
from toolkit.tracking.state import PersonState, Previous
from toolkit.tracking.stature import head_top, off_floor, stature_prior_cost
from toolkit.tracking.tracker_settings import SearchingSettings
from toolkit.tracks import EMPTY, LOST, TRACKED, FrameResult


@dataclass(frozen=True, eq=False)
class StepContext:
    """Inputs of a step besides the state and the sighting.

    Attributes
    ----------
    sizes : bodies tried where the person's size is unknown
    heading : float64 (2,), expected heading in this frame, see `toolkit.tracking.heading`; zero if unknown
    """

    sizes: Sequence[Body]
    heading: np.ndarray = field(default_factory=lambda: np.zeros(2))


@dataclass(frozen=True, eq=False)
class FollowedFrame:
    """Result of one step.

    Attributes
    ----------
    row : row of the track
    state : before the next frame
    observation : observation of the sighting, None without one
    scored : all hypotheses of the frame
    winner : the selected one, None if there was none
    cost : metres, selection cost of the winner; infinite without one
    """

    row: FrameResult
    state: PersonState
    observation: Observation | None = None
    scored: Sequence[ScoredHypothesis] = ()
    winner: ScoredHypothesis | None = None
    cost: float = math.inf

    @property
    def distance(self) -> float:
        """Distance of the pose from the frame, metres; infinite without a pose."""
        return math.inf if self.winner is None else self.winner.comparison.distance


class Follower(FollowedPerson):
    """One person before one camera.

    Parameters
    ----------
    observer, searches, objective : observe sightings, propose hypotheses, and score them
    level_rotation : R_level_camera, float64 (3, 3)
    settings : criteria of empty and lost frames, and smoothing of the report
    sizes : the bodies that are tried where the person's size is unknown
    sources : names of the hypotheses that can win, in the order in which the track numbers them
    state : before the first frame
    occluded_limbs : estimates occluded limbs; None keeps the winner as it is
    verifier : adds hypotheses where the person is detected again; None adds none
    floor : y of the floor, metres, level frame, None if unknown

    Attributes
    ----------
    state : before the next `step`; replaced, never changed
    observation : observation of the last `step`, None without a sighting
    """

    held = HELD

    def __init__(
        self,
        observer: Observer,
        searches: Sequence[Search],
        objective: Objective,
        level_rotation: np.ndarray,
        settings: SearchingSettings,
        sizes: Sequence[Body],
        sources: Sequence[str],
        state: PersonState,
        occluded_limbs: OccludedLimbs | None = None,
        verifier: Verifier | None = None,
        floor: float | None = None,
    ) -> None:
        super().__init__(state, objective.placer, level_rotation, sources)
        self.observer, self.searches, self.objective = observer, tuple(searches), objective
        self._settings, self.sizes, self.floor = settings, tuple(sizes), floor
        self._occluded_limbs, self._verifier = occluded_limbs, verifier
        self.observation: Observation | None = None

    def step(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> FrameResult:
        """See `PersonFollower.step`; without a sighting the frame is empty."""
        return whole(self.step_parts(sighting, timestamp, clock))

    def step_parts(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> Parts[FrameResult]:
        """See `StepsInParts.step_parts`."""
        self.observation = None
        followed = yield from self.follow_parts(self.state, sighting, timestamp, StepContext(self.sizes), clock)
        self.state, self.observation = followed.state, followed.observation
        return followed.row

    def follow(
        self,
        state: PersonState,
        sighting: Sighting | None,
        timestamp: float,
        context: StepContext,
        clock: StageClock,
    ) -> FollowedFrame:
        """Find the person in a frame.

        Parameters
        ----------
        state : before this frame; without a previous pose the person is detected again
        timestamp : seconds, after or before those of the state
        """
        return whole(self.follow_parts(state, sighting, timestamp, context, clock))

    def follow_parts(
        self,
        state: PersonState,
        sighting: Sighting | None,
        timestamp: float,
        context: StepContext,
        clock: StageClock,
    ) -> Parts[FollowedFrame]:
        """Find the person as `follow` does; where the person is detected again, in one part for each search."""
        # Baak 2013, 5.3.1: the person's depth as a cloud.
        cloud = None if sighting is None else Cloud.from_depth(sighting.depth, sighting.camera, self.level_rotation)
        clock.record("prepare")
        if sighting is None or cloud is None or len(cloud) < self._settings.smallest_person:
            row = replace(self.predicted_row(state, EMPTY), stage_ms=clock.milliseconds)
            return FollowedFrame(row, unseen(state, timestamp))

        # 5.3.4 and 5.4.2: centre, facing and geodesic extrema of the cloud.
        observation = self.observer.observe(cloud, timestamp, state, sighting.unobserved, sighting.joints)
        if state.centre is not None and not connected(state.centre, observation.centre, state.elapsed(timestamp)):
            state = forgotten(state)
            observation = self.observer.observe(cloud, timestamp, state, sighting.unobserved, sighting.joints)
        observation.prepare()
        clock.record("landmarks")

        # 5.4.1 and 5.4.3: hypotheses of the local optimisation and of the database lookup, and their costs.
        scored, asked = yield from self._hypotheses(state, observation, context, clock)

        # 5.4.4: late fusion; the hypothesis of least cost is the pose.
        costs = [self._selection_cost(each, context, sized=asked.sized) for each in scored]
        best = min(range(len(scored)), key=costs.__getitem__, default=None)
        if best is None:
            row, following = self.predicted_row(state, LOST), unseen(asked, timestamp)
        else:
            row, following = self._selected(scored[best], asked, observation)
        clock.record("select")
        row = replace(row, stage_ms=clock.milliseconds)
        if best is None:
            return FollowedFrame(row, following, observation, scored)
        cost = self._selection_cost(scored[best], context)
        return FollowedFrame(row, following, observation, scored, scored[best], cost)

    def shown(self, sighting: Sighting, timestamp: float) -> tuple[float, np.ndarray, float, bool]:
        """Return the visibility of the person in a frame.

        Returns
        -------
        shown : expected number of joints in view, each weighted by its reliability; without a network, the share of
            the image that the person covers
        facing : float64 (2,), see `sighted_facing`, without image joints `estimated_facing`
        top : y of the top of the head, see `head_top`
        whole : all joints are in view
        """
        cloud = Cloud.from_depth(sighting.depth, sighting.camera, self.level_rotation)
        observation = self.observer.observe(cloud, timestamp, self.state, sighting.unobserved, sighting.joints)
        estimate, facing = observation.estimate, sighted_facing(observation.lifted)
        if not facing.any():
            facing = estimated_facing(estimate)
        if estimate is None:
            return len(cloud) / cloud.depth.size, facing, math.nan, not observation.cut.any()
        joints = float((estimate.reliability * estimate.in_view).sum())
        whole = bool(estimate.in_view.min() > 0.5)  # each joint is more likely in view than not
        return joints, facing, head_top(cloud, estimate.points[HEAD]), whole

    def off_floor(self, scored: ScoredHypothesis) -> float:
        """Return the cost of a hypothesis that ends above or below the floor, metres."""
        if self.floor is None or scored.comparison.placed is None:
            return 0.0
        lowest = float((scored.comparison.placed.vertices * self.level_rotation[1]).sum(axis=1).min())
        return off_floor(lowest, self.floor)

    def _selection_cost(self, scored: ScoredHypothesis, context: StepContext, *, sized: bool = True) -> float:
        """Return the cost that selects the pose, metres; where the size is unknown, unlikely statures cost more."""
        cost = weighed(scored.cost, scored.hypothesis.pose, context.heading)
        return cost if sized else cost + stature_prior_cost(scored.body.height) + self.off_floor(scored)

    def _hypotheses(
        self, state: PersonState, observation: Observation, context: StepContext, clock: StageClock
    ) -> Parts[tuple[list[ScoredHypothesis], PersonState]]:
        """Return the hypotheses of all searches, and the state with the memory of the searches."""
        rng = self.rng(state)
        memory = dict(state.memory)
        went = _last_seen(state, observation.timestamp, self.held)
        known = [] if went is None else [replace(state, previous=went)]
        bodies = (state.body,) if state.sized else context.sizes
        # a person who was out of view for a moment keeps the heading
        redetected = not observation.follows and not known
        scored: list[ScoredHypothesis] = []
        for start in (*known, *(replace(state, body=body) for body in bodies)):
            for search in self.searches:
                best = min(scored, key=cost_of, default=None)
                if redetected and isinstance(search, SearchInParts):
                    proposal = yield from search.propose_parts(observation, start, rng, best)
                else:
                    proposal = search.propose(observation, start, rng, best)
                improved = [hypothesis.improves for hypothesis in proposal.hypotheses]
                scored = [each for each in scored if each not in improved]
                scored += [self._scored(each, start.body, observation, redetected) for each in proposal.hypotheses]
                if proposal.memory is not None:
                    memory[search.name] = proposal.memory
                clock.record(search.name)
                if redetected and proposal.hypotheses:
                    yield
        if self._verifier is not None and redetected and scored:
            scored += yield from self._verifier.verified(observation, scored)
            clock.record(self._verifier.name)
        return scored, replace(state, memory=memory, generator=self.after(rng), turn=_turn(state))

    def _scored(
        self, hypothesis: Hypothesis, body: Body, observation: Observation, redetected: bool
    ) -> ScoredHypothesis:
        """Return a hypothesis with its cost for the frame (5.4.4, Eq. 5.9), unless the search compared it already."""
        compared = hypothesis.comparison
        if compared is None:
            compared = self.objective.compare(body, hypothesis.pose, observation.scene)
        return ScoredHypothesis.of(hypothesis, body, compared, redetected=redetected)

    def _selected(
        self, winner: ScoredHypothesis, state: PersonState, observation: Observation
    ) -> tuple[FrameResult, PersonState]:
        """Return the winner as a row of the track, and the state of the next frame."""
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
        confidence = np.zeros(len(joints))
        if tracked:
            network = observation.network_evidence(joints, state.network if continues else None)
            confidence = self.objective.confidence(winner.comparison, joints, guess.spread, network)
            following = replace(following, network=network)
        seen = TRACKED if tracked else LOST
        row = self.row(reported, joints, confidence, guess.observed, seen, winner.hypothesis.source)
        return row, following

    def _completed(self, winner: ScoredHypothesis, before: Previous | None) -> Guess:
        """Return the winner with unobserved limbs as in the previous frame, unless the pose continues from it."""
        pose = winner.hypothesis.pose
        if self._occluded_limbs is None:
            return Guess(pose, np.zeros(len(skeleton.REPORTED)))
        return self._occluded_limbs.guess(
            pose, winner.comparison, self.objective, None if before is None else before.pose
        )


def unseen(before: PersonState, timestamp: float) -> PersonState:
    """Return the state after a frame without a sighting or without a hypothesis.

    A person who comes back may stand anywhere, in any pose, facing anywhere; after a short absence they are probably
    near the last place.
    """
    went = {} if before.previous is None else _remember_last_seen(before, before.previous)
    return replace(
        before, previous=None, centre=None, facing=None, in_view=None, timestamp=timestamp, smoothed=None, **went
    )


def forgotten(before: PersonState) -> PersonState:
    """Return the state in which only the person and the body are known, as before a first frame."""
    return replace(
        before, previous=None, last_seen=None, last_seen_at=None, centre=None, facing=None, timestamp=None, lost=0.0,
        in_view=None, smoothed=None, memory={},
    )  # fmt: skip


def _remember_last_seen(state: PersonState, previous: Previous) -> dict[str, Any]:
    return {"last_seen": replace(previous, before=None), "last_seen_at": state.timestamp}


def _last_seen(state: PersonState, timestamp: float, held: float) -> Previous | None:
    """Return the frame in which the person was last seen, unless that is more than `held` seconds ago."""
    if state.last_seen_at is None or abs(timestamp - state.last_seen_at) > held:
        return None
    return state.last_seen


def _turn(state: PersonState) -> int:
    return state.turn + (state.previous is not None and not state.lost)


def _in_view(observation: Observation, guess: Guess) -> np.ndarray | None:
    """Return the probability that joints have been in view recently; joints that the pose shows are in view."""
    expected = observation.in_view
    return None if expected is None else np.where(guess.observed, 1.0, expected)
