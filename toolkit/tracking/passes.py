"""Second pass over one person of a recording: the frames are followed a second time, and the better trajectory chosen.

The first pass follows forwards. The second pass follows backwards with the same body; in keyframes, the person is
detected independently of all other frames, and the detection is followed on if it explains the frame better. Of both
trajectories the cheapest path is taken (Viterbi). Jumps that are left in it are followed through from the side from
which no trajectory has passed them, within a bound. With a body that was learnt again, the person is first followed
forwards from the keyframe with the least cost, which takes the place of the first pass.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from toolkit.body.body import Body
from toolkit.io.parts import Parts
from toolkit.kernels import linear
from toolkit.tracking.follower import Follower
from toolkit.tracking.frame_detection import NOTHING_FOUND, Detection, FrameDetector
from toolkit.tracking.planning import Plan, Stretch
from toolkit.tracking.sightings import PersonSightings
from toolkit.tracking.state import PersonState
from toolkit.tracking.trajectory_choice import Direction, Step, apart, better_parts
from toolkit.tracks import EMPTY, TRACKED, FrameResult
from toolkit.tracks.track import result_of

JUMP = 0.05
"""Metres, mean over the joints, by which a step has to exceed those beside it to be a jump."""
REPAIRED_SHARE = 0.5
"""Frames that are followed through jumps, per frame in sight, at most."""


@dataclass(frozen=True)
class Leg:
    """Frames that are followed in one direction.

    Attributes
    ----------
    stretch : they belong to
    start : first frame that is followed
    direction : direction of time
    """

    stretch: Stretch
    start: int
    direction: Direction

    @property
    def frames(self) -> range:
        """Frames from the start to the end of the stretch."""
        end = self.stretch.last + 1 if self.direction is Direction.FORWARD else self.stretch.first - 1
        return range(self.start, end, self.direction.value)


@dataclass(frozen=True)
class Jump:
    """Jump of a trajectory that is followed through.

    Attributes
    ----------
    frame : last frame before it, in the direction of the pass
    direction : in which no trajectory has passed it
    """

    frame: int
    direction: Direction


class Followed(NamedTuple):
    """Result of the second pass over a person: the person's body, and the steps by frame, of all frames in sight."""

    body: Body
    steps: dict[int, Step]


class BidirectionalTracker:
    """Follows one person of a recording a second time and chooses the trajectory.

    Parameters
    ----------
    follower : follows with the person's own body
    seen : the person's sightings
    timestamps : float64 (T,), seconds, of all frames of the recording
    plan : body, stretches and keyframes
    stages : names of the follower's stages
    first_pass : rows (T,) of the first pass, with the track's columns
    """

    def __init__(
        self,
        follower: Follower,
        seen: PersonSightings,
        timestamps: np.ndarray,
        plan: Plan,
        stages: tuple[str, ...],
        first_pass: np.ndarray,
    ) -> None:
        self._detector = FrameDetector(follower, plan.body, seen, timestamps, stages, plan.heading)
        self._objective = follower.objective
        self._timestamps, self._first_pass = timestamps, first_pass
        self._plan = plan
        self._trajectory: dict[int, Step] = {}
        self._detections: dict[int, Detection] = {}
        self._forward: dict[int, FrameResult] = {}

    def run(self) -> Parts[Followed]:
        """Follow the person, a frame at a time: the caller may stop in between."""
        for stretch in self._plan.stretches:
            for leg in self._legs(stretch):
                yield from self._followed(leg)
            self._trajectory |= self._better_forward(stretch)
        left = int(REPAIRED_SHARE * len(self._trajectory))
        for jump in self._jumps_left():
            left -= yield from self._repaired(jump, left)
        return Followed(self._plan.body, self._trajectory)

    def _legs(self, stretch: Stretch) -> list[Leg]:
        """Return the frames to follow: all backwards; before that forwards from the best keyframe with a new body."""
        backwards = Leg(stretch, stretch.last, Direction.BACKWARD)
        if not self._plan.relearned:
            return [backwards]
        best = min(stretch.keyframes, key=lambda frame: self._detected(frame).followed.cost)
        return [Leg(stretch, best, Direction.FORWARD), backwards]

    def _detected(self, frame: int) -> Detection:
        """Return the detection in a keyframe."""
        if frame not in self._detections:
            most_stored = 32  # detections of 1 MB each; others are computed again
            if len(self._detections) == most_stored:
                self._detections.pop(next(iter(self._detections)))
            self._detections[frame] = self._detector.redetect(frame, Direction.BACKWARD)
        return self._detections[frame]

    def _followed(self, leg: Leg) -> Iterator[None]:
        """Follow a leg."""
        state = None
        for frame in leg.frames:
            if leg.direction is Direction.FORWARD:
                found = self._detected(frame) if state is None else self._followed_or_detected(leg, frame, state)
                self._forward[frame] = found.step.result
            else:
                found = self._followed_or_detected(leg, frame, state or self._state_of_rival(frame))
                cost, result = self._cost_of_rival(frame, found), self._doubted(found.step.result, self._rival(frame))
                self._trajectory[frame] = replace(found.step, result=result, direction=leg.direction, rival_cost=cost)
                self._detections.pop(frame, None)
            state = found.followed.state
            yield

    def _followed_or_detected(self, leg: Leg, frame: int, state: PersonState) -> Detection:
        """Follow to a frame; in a keyframe, return the detection if it is another pose that explains more."""
        detector = self._detector
        followed = detector.follow(frame, state, leg.direction)
        if frame not in leg.stretch.keyframes or followed.followed.state.previous is None:
            return followed
        detected = self._detected(frame)
        different = 0.10  # metres, mean over the joints, from which on a detection is another pose
        if apart(detected.step.result, followed.step.result) < different:
            return followed
        old, new = (
            detector.cost(frame, found.step.result.pose, detected.followed, prior=True)
            for found in (followed, detected)
        )
        return detected if new < old else followed

    def _rival(self, frame: int) -> FrameResult | None:
        """Return the row of the forward trajectory with the same body; None without one."""
        return self._forward.get(frame) if self._plan.relearned else result_of(self._first_pass[frame])

    def _doubted(self, result: FrameResult, other: FrameResult | None) -> FrameResult:
        """Return a row whose confidence includes the distance from the row of another trajectory."""
        if other is None or result.state != TRACKED or other.state == EMPTY:
            return result
        distances = linear.lengths(result.joints.astype(np.float64) - other.joints)
        confidence = self._objective.confidence_of_both(result.confidence, distances)
        return replace(result, confidence=confidence.astype(np.float32))

    def _state_of_rival(self, frame: int) -> PersonState:
        """Return the state before a frame in which the forward trajectory found the person."""
        rival = self._rival(frame)
        if rival is None or rival.state == EMPTY:
            return self._detector.unknown
        return replace(self._detector.state_at(frame, rival.pose), timestamp=None)

    def _cost_of_rival(self, frame: int, found: Detection) -> float:
        """Return the cost of the forward trajectory in a frame that was followed, metres."""
        rival = self._rival(frame)
        if rival is None or rival.state == EMPTY:
            return NOTHING_FOUND if rival is not None and found.step.result.state == EMPTY else math.inf
        return self._detector.cost(frame, rival.pose, found.followed)

    def _better_forward(self, stretch: Stretch) -> dict[int, Step]:
        """Return the steps of the forward trajectory on the cheapest path through both trajectories."""
        frames, entries = range(stretch.first, stretch.last + 1), []
        for f in frames:
            second = self._trajectory[f]
            other = self._rival(f) or second.result
            gap = 0.0 if second.result.state == EMPTY else apart(other, second.result)
            entries.append((second.rival_cost, second.cost, gap))
        costs = np.array(entries)
        chosen = better_parts(costs[:, 0], costs[:, 1], costs[:, 2], (True, True))
        return {f: self._forward_step(f) for f, better in zip(frames, chosen, strict=True) if not better}

    def _forward_step(self, frame: int) -> Step:
        """Return the step of the forward trajectory in a frame that was followed backwards."""
        step = self._trajectory[frame]
        result = self._doubted(self._rival(frame) or step.result, step.result)
        result = replace(result, stage_ms=step.result.stage_ms)
        return Step(result, step.rival_cost, rival_cost=step.rival_cost)

    def _jumps_left(self) -> list[Jump]:
        """Return the jumps of the trajectory, the largest first, each from the side from which it was not passed."""
        found: list[tuple[float, Jump]] = []
        for stretch in self._plan.stretches:
            steps = (self._trajectory[f] for f in range(stretch.first, stretch.last + 1))
            moved = np.array([0.0, *(apart(a.result, b.result) for a, b in pairwise(steps)), 0.0])
            excesses = moved[1:-1] - np.maximum(moved[:-2], moved[2:])
            for k in np.flatnonzero(excesses >= JUMP).tolist():
                excess, before, after = excesses[k], *(self._trajectory[stretch.first + i] for i in (k, k + 1))
                if EMPTY in (before.result.state, after.result.state) or _continues(before, after):
                    continue
                if before.direction is Direction.BACKWARD:
                    found.append((-excess, Jump(stretch.first + k, Direction.FORWARD)))
                if after.direction is Direction.FORWARD:
                    found.append((-excess, Jump(stretch.first + k + 1, Direction.BACKWARD)))
        return [jump for _, jump in sorted(found, key=lambda entry: entry[0])]

    def _repaired(self, jump: Jump, most: int) -> Parts[int]:
        """Follow through a jump until the trajectory is met again, and keep the better steps; return the number of
        frames, at most `most`.
        """
        stretch = next(s for s in self._plan.stretches if s.first <= jump.frame <= s.last)
        frames = Leg(stretch, jump.frame, jump.direction).frames[1:][:most]
        state = self._detector.state_at(jump.frame, self._trajectory[jump.frame].result.pose)
        steps: dict[int, Step] = {}
        differed = float(self._timestamps[jump.frame])
        agreed = 0.04  # metres, mean over the joints: the trajectories have met
        agreed_seconds = 0.5  # seconds for which they have to agree
        for frame in frames:
            found = self._detector.follow(frame, state, jump.direction)
            known = self._trajectory[frame].result
            state, steps[frame] = (
                found.followed.state,
                replace(found.step, result=self._doubted(found.step.result, known)),
            )
            moment = float(self._timestamps[frame])
            if apart(found.step.result, known) > agreed:
                differed = moment
            elif abs(moment - differed) > agreed_seconds:
                break
            yield
        if steps:
            self._trajectory |= self._better_of(steps, stretch, jump)
        return len(steps)

    def _better_of(self, steps: Mapping[int, Step], stretch: Stretch, jump: Jump) -> dict[int, Step]:
        """Return the steps behind a jump on the cheapest path through them and the trajectory."""
        frames = sorted(steps)
        known = {f: self._trajectory[f] for f in frames}
        gaps = [apart(known[f].result, steps[f].result) for f in frames]
        forward = jump.direction is Direction.FORWARD
        ends = forward or frames[0] == stretch.first, not forward or frames[-1] == stretch.last
        costs = np.array([[known[f].cost, steps[f].cost] for f in frames])
        chosen = better_parts(costs[:, 0], costs[:, 1], np.array(gaps), ends)
        return {f: steps[f] for f, better in zip(frames, chosen, strict=True) if better}


def _continues(before: Step, after: Step) -> bool:
    """Return True if one of two consecutive steps was followed from the other without a new detection."""
    if before.direction is not after.direction:
        return False
    return after.continues if before.direction is Direction.FORWARD else before.continues
