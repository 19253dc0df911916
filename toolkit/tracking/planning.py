"""Where a person of a recording is begun, and with what body: found in the frames that show most of them."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.fitting.shape import ShapeSettings
from toolkit.people.sighting import Sighting
from toolkit.tracking.body_learning import FollowedBody, RateLimiter
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import HELD, Follower
from toolkit.tracking.frame_detection import NOTHING_FOUND, Detection, FrameDetector
from toolkit.tracking.heading import directions_faced, heading
from toolkit.tracking.passes import Plan
from toolkit.tracking.sightings import PersonSightings
from toolkit.tracking.stature import StatureBelief, height_stood, statures_of

SURVEYED = 0.25
"""Seconds between the surveyed frames, in which the regressor counts the visible joints."""
MOMENTS, MOMENT_GAP = 4, 1.0
"""Frames with most visible joints, on which sizes are tried, the surest being the start; seconds between them, half of
all the time where that is less: one frame may mislead."""
CHECKED = 5.0
"""Seconds of each stretch; its frame with most visible joints is searched afresh."""

CANDIDATES, FEW = 3, 16
"""Bodies of different sizes that are followed, and through how many frames, before one is chosen."""


@dataclass(frozen=True, eq=False)
class Survey:
    """How much of a person some frames show.

    Attributes
    ----------
    frames : int64 (N,), rising
    shown : float64 (N,), joints that the regressor expects to be in view and is sure of
    facing : float64 (N, 2), where they have the person face, see `voted_facing`
    tops : float64 (N,), where the head ends, see `head_top`
    whole : bool (N,), neither the image border nor an occluder cuts off a limb
    """

    frames: np.ndarray
    shown: np.ndarray
    facing: np.ndarray
    tops: np.ndarray
    whole: np.ndarray

    def best(self, count: int, first: int, last: int, timestamps: np.ndarray) -> list[int]:
        """The frames from `first` to `last` that show most, the best first, `MOMENT_GAP` or half of the time apart."""
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
    """Surveys what was seen of a person, learns their body and chooses where to begin.

    Parameters
    ----------
    learner : follows with bodies of unknown size and learns the person's own
    follower : follows with a body that is known
    seen : the person's sightings
    timestamps : float64 (T,), seconds, of all frames of the recording
    stages : names of the followers' stages
    smallest : measured points that a sighting needs to be looked at
    body : the person's own, from the first pass
    relearn : search sizes and learn the body again if the person is truncated or occluded in every keyframe
    walked : float64 (T, 2), where they walk in each frame, see `directions_walked`
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
        *,
        relearn: bool = True,
        walked: np.ndarray | None = None,
    ) -> None:
        self._learner, self._follower, self._seen = learner, follower, seen
        self._walked = np.zeros((len(timestamps), 2)) if walked is None else walked
        self._looker = FrameDetector(follower, seen, timestamps, stages, self._walked)
        self._timestamps, self._stages, self._smallest = timestamps, stages, smallest
        self._body, self._relearn = body, relearn
        self.plan: Plan | None = None

    def run(self) -> Iterator[None]:
        """Make the plan, a frame at a time: the caller may stop in between. It stays None where too little was seen."""
        usable = self._seen.frames[self._seen.pixels >= self._smallest]
        if not len(usable):
            return
        stretches = times_in_sight(usable, self._timestamps)
        survey = yield from self._survey(usable)
        faced = directions_faced(self._timestamps[survey.frames], survey.facing, self._timestamps)
        self._looker.heading = heading(self._walked, faced)
        body = self._body
        moments = survey.best(MOMENTS, int(usable[0]), int(usable[-1]), self._timestamps)
        if self._relearn and not survey.whole[np.isin(survey.frames, moments)].any():
            stood = height_stood(survey.tops, self._learner.follower.floor)
            body = yield from self._own_body(moments, usable, stood)
        rows, checks, looks = [], [], dict[int, Detection]()
        for number, (first, last) in enumerate(stretches):
            best = survey.best(MOMENTS, first, last, self._timestamps) or [first]
            found = yield from self._looks(best, body)
            start = surest(found)
            looks |= found
            rows.append((first, last, start))
            others = set(best)
            for begin in np.arange(self._timestamps[first], self._timestamps[last], CHECKED):
                low, high = np.searchsorted(self._timestamps, [begin, begin + CHECKED]).tolist()
                others.update(survey.best(1, low, min(high - 1, last), self._timestamps))
            checks += [(frame, number, 0) for frame in sorted(others - {start})]
        starts = np.array(rows, dtype=np.int64).reshape(-1, 3)
        self.plan = Plan(body, starts, np.array(checks, dtype=np.int64).reshape(-1, 3), self._looker.heading, looks)

    def _survey(self, usable: np.ndarray) -> Generator[None, None, Survey]:
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

    def _own_body(self, moments: list[int], usable: np.ndarray, stood: float) -> Generator[None, None, Body]:
        """The body that explains the frames around the surest of these moments, whose head `stood` so high."""
        belief = yield from self._believed(moments, stood)
        looks = yield from self._looks(moments, belief.bodies[belief.likely[0]])
        start = surest(looks)
        around = frames_around(start, usable, self._timestamps, self._learner.settings)
        if not len(around):
            return belief.bodies[belief.likely[0]]  # only the size is chosen
        if len(belief.likely) > 1:
            few, learnt, costs = around[:: -(-len(around) // FEW)], [], []
            for k in belief.likely[:CANDIDATES]:
                body, cost = yield from self._learnt(belief.bodies[k], start, few, stood)
                learnt.append(body)
                costs.append(cost)
            belief = StatureBelief.of(tuple(learnt), stood).narrowed(dict(enumerate(costs)))
        body, _ = yield from self._learnt(ShapeSpace.load().body(belief.shape), start, around, stood)
        return body

    def _learnt(
        self, body: Body, start: int, around: np.ndarray, stood: float
    ) -> Generator[None, None, tuple[Body, float]]:
        """What becomes of a body that is taken for the person's in `start`, and then in the frames around it; and how
        far from them it lies, metres, once half of them were seen.
        """
        learner = self._learner
        learner.begin(body, statures_of(stood, body.height))
        learner.take(self._sighting(start), float(self._timestamps[start]))
        distances = [min(learner.follower.distance, NOTHING_FOUND)]
        begun = learner.follower.state
        for frames in (around[around > start], around[around < start][::-1]):
            learner.follower.state = replace(begun, body=learner.follower.state.body)
            for frame in frames.tolist():
                learner.take(self._sighting(frame), float(self._timestamps[frame]))
                distances.append(min(learner.follower.distance, NOTHING_FOUND))
                yield
        return learner.follower.state.body, float(np.mean(distances[len(distances) // 2 :]))

    def _believed(self, moments: list[int], stood: float) -> Generator[None, None, StatureBelief]:
        """How likely which size is, by looking for the person afresh with all of them."""
        follower = self._learner.follower
        unknown = follower.state
        belief = StatureBelief.of(follower.sizes, stood)
        for moment in moments:
            follower.state = unknown
            follower.sizes = tuple(belief.bodies[k] for k in belief.possible)
            follower.step(self._sighting(moment), float(self._timestamps[moment]), StageClock(self._stages))
            costs: dict[int, float] = {}
            for scored in follower.scored:
                number = next(k for k, body in enumerate(belief.bodies) if body is scored.body)
                costs[number] = min(costs.get(number, np.inf), follower.cost(scored) + follower.off_floor(scored))
            if costs:
                belief = belief.narrowed(costs)
            yield
        follower.sizes, follower.state = belief.bodies, unknown
        return belief

    def _looks(self, moments: list[int], body: Body) -> Generator[None, None, dict[int, Detection]]:
        """What looks afresh say of these moments, for a body."""
        looks = {}
        for moment in moments:
            looks[moment] = self._looker.redetect(moment, body)
            yield
        return looks

    def _sighting(self, frame: int) -> Sighting:
        """What is seen of the person in a frame, which both followers are about to look at."""
        sighting = self._seen[frame]
        self._follower.heading = self._learner.follower.heading = self._looker.heading[frame]
        assert sighting is not None, "planned frames are frames in which the person was seen"
        return sighting


def surest(looks: Mapping[int, Detection]) -> int:
    """The frame in which a pose was found at the least cost."""
    return min(looks, key=lambda frame: looks[frame].cost)


def times_in_sight(usable: np.ndarray, timestamps: np.ndarray) -> list[tuple[int, int]]:
    """First and last frame of each time in sight; who is hidden for a moment only is still there."""
    ends = np.flatnonzero(np.diff(timestamps[usable]) > HELD)
    firsts, lasts = np.concatenate([[0], ends + 1]), np.concatenate([ends, [len(usable) - 1]])
    return [(int(usable[a]), int(usable[b])) for a, b in zip(firsts, lasts, strict=True)]


def frames_around(start: int, usable: np.ndarray, timestamps: np.ndarray, settings: ShapeSettings) -> np.ndarray:
    """Frames around `start`, nearest in time and evenly spread, rising: as many as a body is learnt of."""
    chosen = []
    for frames in (usable[usable >= start], usable[usable < start][::-1]):
        pace = RateLimiter(settings.rate)
        chosen += [frame for frame in frames.tolist() if pace.takes(abs(timestamps[frame] - timestamps[start]))]
    nearest = sorted(chosen, key=lambda frame: abs(timestamps[frame] - timestamps[start]))
    return np.array(sorted(nearest[: round(settings.seconds * settings.rate)]), dtype=np.int64)
