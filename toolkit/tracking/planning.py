"""Plan of the second pass over one person: the body, the times in sight, and the keyframes of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.fitting.shape import ShapeSettings
from toolkit.io.parts import Parts
from toolkit.people.connection import HELD
from toolkit.people.sighting import Sighting
from toolkit.tracking.body_learning import FollowedBody, RateLimiter
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower, StepContext
from toolkit.tracking.frame_detection import NOTHING_FOUND, FrameDetector
from toolkit.tracking.heading import directions_faced, directions_walked, heading, heading_disagreement, weighed
from toolkit.tracking.sightings import PersonSightings
from toolkit.tracking.stature import StatureBelief, height_stood, is_refuted, statures_of
from toolkit.tracking.trajectory_choice import Direction
from toolkit.tracks import TRACKED

SURVEYED = 0.25
"""Seconds between the surveyed frames, in which the joint network counts the visible joints."""
MOMENT_GAP = 1.0
"""Seconds between the frames with most visible joints on which sizes are tried; at most half of the time in view."""
CHECKED = 5.0
"""Seconds of each stretch; its frame with most visible joints is a keyframe."""


@dataclass(frozen=True)
class Stretch:
    """One time in sight.

    Attributes
    ----------
    first, last : its frames, both included
    keyframes : rising, frames in which the person is detected independently of the others
    """

    first: int
    last: int
    keyframes: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of the second pass over one person.

    Attributes
    ----------
    body : the person's own
    stretches : times in sight, rising
    heading : float64 (T, 2), expected heading in each frame, see `toolkit.tracking.heading.heading`
    relearned : the body is another than that of the first pass
    """

    body: Body
    stretches: tuple[Stretch, ...]
    heading: np.ndarray
    relearned: bool = False


@dataclass(frozen=True, eq=False)
class Survey:
    """Visibility of a person in some frames; see `Follower.shown`.

    Attributes
    ----------
    frames : int64 (N,), rising
    shown : float64 (N,), expected number of joints in view, weighted by reliability
    facing : float64 (N, 2), see `estimated_facing`
    tops : float64 (N,), y of the top of the head, see `head_top`
    whole : bool (N,), all joints are in view
    """

    frames: np.ndarray
    shown: np.ndarray
    facing: np.ndarray
    tops: np.ndarray
    whole: np.ndarray

    def best(self, count: int, first: int, last: int, timestamps: np.ndarray) -> list[int]:
        """Return the frames from `first` to `last` that show most, at least `MOMENT_GAP` or half of the time apart."""
        gap = min(MOMENT_GAP, 0.5 * float(timestamps[last] - timestamps[first]))
        inside = np.flatnonzero((self.frames >= first) & (self.frames <= last))
        chosen: list[int] = []
        for row in inside[np.argsort(-self.shown[inside], kind="stable")]:
            moment = timestamps[self.frames[row]]
            if all(abs(moment - timestamps[frame]) >= gap for frame in chosen):
                chosen.append(int(self.frames[row]))
            if len(chosen) == count:
                break
        return chosen


class Planner:
    """Makes the plan of one person.

    Parameters
    ----------
    learner : follows with bodies of unknown size and learns the person's own
    follower : follows with a body that is known
    seen : the person's sightings
    timestamps : float64 (T,), seconds, of all frames of the recording
    stages : names of the followers' stages
    smallest : measured points below which a sighting is not used
    body : the person's own, from the first pass
    relearn : search sizes and learn the body again if the person is truncated or occluded in every keyframe, or far
        smaller than the height of the head
    first_pass : rows (T,) of the first pass, with the track's columns
    """

    def __init__(
        self,
        learner: FollowedBody,
        follower: Follower,
        seen: PersonSightings,
        timestamps: np.ndarray,
        stages: tuple[str, ...],
        smallest: int,
        body: Body,
        first_pass: np.ndarray,
        *,
        relearn: bool = True,
    ) -> None:
        self._learner, self._follower, self._seen, self._first_pass = learner, follower, seen, first_pass
        self._timestamps, self._stages, self._smallest = timestamps, stages, smallest
        self._body, self._relearn = body, relearn
        self._heading = np.zeros((len(timestamps), 2))

    def run(self) -> Parts[Plan | None]:
        """Make the plan, a frame at a time: the caller may stop in between. Return None if too little was seen."""
        usable = self._seen.frames[self._seen.pixels >= self._smallest]
        if not len(usable):
            return None
        survey = yield from self._survey(usable)
        walked = directions_walked(self._first_pass, self._timestamps, self._follower.level_rotation)
        faced = directions_faced(self._timestamps[survey.frames], survey.facing, self._timestamps)
        self._heading = heading(walked, faced)
        moments_tried = 4  # frames with most visible joints, on which sizes are tried: one frame may mislead
        moments = survey.best(moments_tried, int(usable[0]), int(usable[-1]), self._timestamps)
        stood, body = height_stood(survey.tops, self._learner.follower.floor), self._body
        whole = bool(survey.whole[np.isin(survey.frames, moments)].any())
        relearned = self._relearn and (not whole or is_refuted(body.height, stood))
        if relearned:
            body = yield from self._own_body(moments, usable, stood)
        stretches = tuple(
            Stretch(first, last, self._keyframes(survey, first, last, moments if relearned else []))
            for first, last in times_in_sight(usable, self._timestamps)
        )
        return Plan(body, stretches, self._heading, relearned)

    def _keyframes(self, survey: Survey, first: int, last: int, moments: list[int]) -> tuple[int, ...]:
        """Return the frames that show most in every `CHECKED` seconds, those that head most wrongly, and `moments`."""
        times = self._timestamps
        frames = {moment for moment in moments if first <= moment <= last}
        for begin in np.arange(times[first], times[last] + 1e-9, CHECKED):
            low, high = np.searchsorted(times, [begin, begin + CHECKED]).tolist()
            frames.update(survey.best(1, low, min(high - 1, last), times))
        frames.update(self._turned(first, last))
        return tuple(sorted(frames or {first}))

    def _turned(self, first: int, last: int) -> list[int]:
        """Return of each run of frames whose heading in the first pass is wrong the most wrong one."""
        rows = self._first_pass[first : last + 1]
        disagreement = np.array([
            heading_disagreement(heads, row["pose"].copy()) if row["state"] == TRACKED else 0.0
            for heads, row in zip(self._heading[first : last + 1], rows, strict=True)
        ])  # fmt: skip
        # Heading disagreement of the first pass, see `heading_disagreement`, above which a frame is a keyframe.
        turned = 0.5
        wrong = np.concatenate([[False], disagreement > turned, [False]])
        begins, ends = np.flatnonzero(wrong[1:] & ~wrong[:-1]), np.flatnonzero(wrong[:-1] & ~wrong[1:])
        return [int(first + b + np.argmax(disagreement[b:e])) for b, e in zip(begins, ends, strict=True)]

    def _survey(self, usable: np.ndarray) -> Parts[Survey]:
        frames, views, due = [], [], -np.inf
        for frame in usable.tolist():
            moment = float(self._timestamps[frame])
            if moment >= due:
                due = moment + SURVEYED
                frames.append(frame)
                views.append(self._follower.shown(self._sighting(frame), moment))
                yield
        shown, facing, tops, whole = map(np.array, zip(*views, strict=True))
        return Survey(np.array(frames, dtype=np.int64), shown, facing.reshape(-1, 2), tops, whole)

    def _own_body(self, moments: list[int], usable: np.ndarray, stood: float) -> Parts[Body]:
        """Return the body that explains the frames around the best of these moments, whose head `stood` so high."""
        belief = yield from self._size_belief(moments, stood)
        likeliest = belief.bodies[belief.likely[0]]
        detector = FrameDetector(self._follower, likeliest, self._seen, self._timestamps, self._stages, self._heading)
        costs: dict[int, float] = {}
        for moment in moments:
            costs[moment] = detector.redetect(moment, Direction.FORWARD).followed.cost
            yield
        start = min(costs, key=costs.__getitem__)
        around = frames_around(start, usable, self._timestamps, self._learner.settings)
        if not len(around):
            return likeliest  # only the size is chosen
        # Bodies of different sizes that are followed, and through how many frames, before one is chosen.
        most_candidates, trial_frames = 3, 16
        if len(belief.likely) > 1:
            few, learnt, distances = around[:: -(-len(around) // trial_frames)], [], []
            for k in belief.likely[:most_candidates]:
                body, distance = yield from self._learnt(belief.bodies[k], start, few, stood)
                learnt.append(body)
                distances.append(distance)
            belief = StatureBelief.of(tuple(learnt), stood).narrowed(dict(enumerate(distances)))
        body, _ = yield from self._learnt(ShapeSpace.load().body(belief.shape), start, around, stood)
        return body

    def _learnt(self, body: Body, start: int, around: np.ndarray, stood: float) -> Parts[tuple[Body, float]]:
        """Return the body learnt in `start` and in the frames around it from a first one, and its mean distance from
        the later half of them, metres.
        """
        learner = self._learner
        learner.begin(body, statures_of(stood, body.height))
        distances = [self._taken(start)]
        begun = learner.state
        for frames in (around[around > start], around[around < start][::-1]):
            learner.rewind(begun)
            for frame in frames.tolist():
                distances.append(self._taken(frame))
                yield
        return learner.state.body, float(np.mean(distances[len(distances) // 2 :]))

    def _taken(self, frame: int) -> float:
        """Learn from a frame; return its distance, metres, at most `NOTHING_FOUND`."""
        learner = self._learner
        context = StepContext(learner.follower.sizes, self._heading[frame])
        return min(learner.take(self._sighting(frame), float(self._timestamps[frame]), context), NOTHING_FOUND)

    def _size_belief(self, moments: list[int], stood: float) -> Parts[StatureBelief]:
        """Return the probability of each size, from detections with all of them."""
        follower, unknown = self._learner.follower, self._learner.state
        belief = StatureBelief.of(tuple(follower.sizes), stood)
        for moment in moments:
            sizes = tuple(belief.bodies[k] for k in belief.possible)
            context = StepContext(sizes, self._heading[moment])
            clock, time = StageClock(self._stages), float(self._timestamps[moment])
            followed = follower.follow(unknown, self._sighting(moment), time, context, clock)
            costs: dict[int, float] = {}
            for scored in followed.scored:
                number = next(k for k, body in enumerate(belief.bodies) if body is scored.body)
                cost = weighed(scored.cost, scored.hypothesis.pose, context.heading) + follower.off_floor(scored)
                costs[number] = min(costs.get(number, np.inf), cost)
            if costs:
                belief = belief.narrowed(costs)
            yield
        return belief

    def _sighting(self, frame: int) -> Sighting:
        sighting = self._seen[frame]
        assert sighting is not None, "planned frames are frames in which the person was seen"
        return sighting


def times_in_sight(usable: np.ndarray, timestamps: np.ndarray) -> list[tuple[int, int]]:
    """Return the first and last frame of each time in sight; absences up to `HELD` seconds do not end one."""
    ends = np.flatnonzero(np.diff(timestamps[usable]) > HELD)
    firsts, lasts = np.concatenate([[0], ends + 1]), np.concatenate([ends, [len(usable) - 1]])
    return [(int(usable[a]), int(usable[b])) for a, b in zip(firsts, lasts, strict=True)]


def frames_around(start: int, usable: np.ndarray, timestamps: np.ndarray, settings: ShapeSettings) -> np.ndarray:
    """Return the frames around `start` from which a body is learnt: nearest in time, evenly spread, rising."""
    chosen = []
    for frames in (usable[usable >= start], usable[usable < start][::-1]):
        pace = RateLimiter(settings.rate)
        chosen += [frame for frame in frames.tolist() if pace.takes(abs(timestamps[frame] - timestamps[start]))]
    nearest = sorted(chosen, key=lambda frame: abs(timestamps[frame] - timestamps[start]))
    return np.array(sorted(nearest[: round(settings.seconds * settings.rate)]), dtype=np.int64)
