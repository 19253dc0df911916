"""Online annotation: each pose is processed once, and an event reports the end of a motion.

An alignment that ends in the last column is at most twice as long as its template. Features need a short look-ahead,
because their velocities are smoothed. A minimum is confirmed after a few columns without a lower one. Overlapping hits
are decided as in `annotator`: the hit with the lowest cost is kept, and the remainder of another one is dropped.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.retrieval.annotation.annotator import DecisionSettings, MotionClass
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import Motion, from_poses
from toolkit.retrieval.features.relational import FEATURE_RATE, FEATURES, FeatureMatrix, pack, quantities_in, tests_of
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.search.find import find

RULES = DecisionSettings()
"""Acceptance of overlapping hits."""


@dataclass(frozen=True)
class Event:
    """Motion that has ended.

    Attributes
    ----------
    label : motion class
    start, end : seconds of the recording
    time : seconds of the recording at the report
    delay : seconds from the end to the report
    cost : mean fraction of differing features
    """

    label: str
    start: float
    end: float
    time: float
    delay: float
    cost: float

    def to_json(self) -> str:
        """Return the event as one line of JSON."""
        rounded = {k: round(v, 4) if isinstance(v, float) else v for k, v in asdict(self).items()}
        return json.dumps(rounded)


@dataclass(frozen=True)
class _Hit:
    """Cheapest alignment of a class so far: its cost, and first and last column."""

    cost: float
    start: int
    end: int


class OnlineAnnotator:
    """Annotator of a motion, pose by pose.

    Parameters
    ----------
    classes : motion classes
    body : body of the poses; its bones are the units of length
    frame_rate : approximate poses a second
    queries : learned keyframe queries; a hit of a class with queries needs a match of one of them
    """

    def __init__(
        self,
        classes: Sequence[MotionClass],
        body: Body,
        frame_rate: float,
        queries: Sequence[KeyframeQuery] = (),
    ) -> None:
        self.labels = tuple(motion_class.label for motion_class in classes)
        self._classes = tuple(classes)
        lengths = [len(motion_class.template.packed[0]) for motion_class in classes]
        self._reach = 2 * max(lengths, default=0)  # columns of the longest hit: every step may take two
        self._words: deque[np.uint64] = deque(maxlen=self._reach)
        self._queries = [[q for q in queries if q.label == label] for label in self.labels]
        self._features = FeatureStream(body, frame_rate)
        self._pending: list[_Hit | None] = [None] * len(classes)
        self._reported: list[tuple[int, _Hit]] = []
        self.columns: list[np.ndarray] = []
        self._times: list[float] = []

    def push(self, pose: np.ndarray, time: float) -> list[Event]:
        """Add the next pose (P,), any frame with y up, at `time` seconds; return the new events."""
        events = []
        for values, column_time in self._features.push(pose, time):
            events += self._push_column(values, column_time, time)
        return events

    def finish(self) -> list[Event]:
        """Return the remaining events at the end of the motion."""
        events = []
        now = self._features.now
        for values, column_time in self._features.finish():
            events += self._push_column(values, column_time, now)
        return events + self._confirmed(now, everything=True)

    def _push_column(self, values: np.ndarray, column_time: float, now: float) -> list[Event]:
        self.columns.append(values)
        self._times.append(column_time)
        self._words.append(pack(values[:, None])[0])
        words, column = np.array(self._words), len(self.columns) - 1
        for row, motion_class in enumerate(self._classes):
            costs, starts = motion_class.template.distance(words)
            pending = self._pending[row]
            if costs[-1] < min(motion_class.threshold, np.inf if pending is None else pending.cost):
                self._pending[row] = _Hit(float(costs[-1]), column + 1 - len(words) + int(starts[-1]), column)
        return self._confirmed(now)

    def _confirmed(self, now: float, *, everything: bool = False) -> list[Event]:
        """Return events of the confirmed hits, the cheapest first."""
        hold = 3  # columns of 1/30 s without a lower cost that confirm a minimum
        column = len(self.columns) - 1
        waiting = sorted((hit.cost, row) for row, hit in enumerate(self._pending) if hit is not None)
        if not waiting:
            return []
        events: list[Event] = []
        open_hits: list[_Hit] = []
        for _, row in waiting:
            hit = self._pending[row]
            assert hit is not None  # `waiting` has no None
            rival = any(other.start <= hit.end and hit.start <= other.end for other in open_hits)
            if not everything and (column - hit.end < hold or rival):
                open_hits.append(hit)
                continue
            self._pending[row] = None
            if self._explained(row, hit) or not self._keyframes_met(row, hit):
                continue
            near = [(r, reported) for r, reported in self._reported if reported.end >= column - self._reach]
            self._reported = [*near, (row, hit)]
            start, end = self._times[hit.start], self._times[hit.end]
            events.append(Event(self.labels[row], start, end, now, now - end, hit.cost))
        return sorted(events, key=lambda event: (event.end, event.label))

    def _explained(self, row: int, hit: _Hit) -> bool:
        """Return True if earlier events explain the hit, by the decision rules."""
        frames = np.zeros(hit.end - hit.start + 1, dtype=bool)
        own = frames.copy()
        for reported_row, reported in self._reported:
            first, stop = max(reported.start - hit.start, 0), reported.end + 1 - hit.start
            if stop > 0:
                frames[first:stop] = True
                if reported_row == row:
                    own[first:stop] = True
        return bool(own.mean() > RULES.overlap or 1.0 - frames.mean() < RULES.visible)

    def _keyframes_met(self, row: int, hit: _Hit) -> bool:
        if not self._queries[row]:
            return True
        values = np.stack(self.columns[hit.start : hit.end + 1], axis=1)
        columns = KeyframeIndex.build([FeatureMatrix("hit", values)])
        return any(len(find(columns, query)) for query in self._queries[row])


class FeatureStream:
    """Feature columns at 30 Hz from poses at any rate, equal to `relational_features` of the whole motion."""

    def __init__(self, body: Body, frame_rate: float) -> None:
        self._body, self._rate = body, frame_rate
        self._lengths: BodyLengths | None = None  # of the first frame
        # Longest smoothing window of a feature, seconds; half of it and the next frame are look-ahead.
        longest_window = 0.25
        window = max(1, int(np.ceil(longest_window * frame_rate - 1e-9)))
        self._ahead, self._behind = window // 2 + 1, (window - 1) // 2 + 1
        self._frames: deque[tuple[Motion, float]] = deque(maxlen=self._ahead + self._behind + 1)
        self._count = 0
        self._next = 0
        self._on = np.zeros(len(FEATURES), dtype=bool)

    @property
    def now(self) -> float:
        """Time of the last pose, seconds."""
        return self._frames[-1][1] if self._frames else 0.0

    def push(self, pose: np.ndarray, time: float) -> list[tuple[np.ndarray, float]]:
        """Add a pose; return the columns bool (40,) that are now complete, and their times."""
        motion = from_poses(pose, self._body, self._rate, "now")
        self._lengths = self._lengths or BodyLengths.of(motion)
        self._frames.append((motion, time))
        self._count += 1
        if self._count <= self._ahead:
            return []
        return self._columns(self._count - 1 - self._ahead, 1)

    def finish(self) -> list[tuple[np.ndarray, float]]:
        """Return the columns whose look-ahead is incomplete at the end."""
        waiting = min(self._ahead, self._count)
        return self._columns(self._count - waiting, waiting) if waiting else []

    def _columns(self, frame: int, count: int) -> list[tuple[np.ndarray, float]]:
        """Return the columns of some frames; hysteresis processes every frame."""
        assert self._lengths is not None  # `push` sets it
        joints = np.concatenate([motion.joints for motion, _ in self._frames])
        axes = np.concatenate([motion.root_axis for motion, _ in self._frames])
        first = self._count - len(self._frames)
        found = []
        for i in range(frame, frame + count):
            loose, strict = tests_of(quantities_in(joints, axes, i - first, self._rate)[:, None], self._lengths)
            self._on = strict[:, 0] | (self._on & loose[:, 0])
            while int(np.rint(self._next * self._rate / FEATURE_RATE)) <= i:
                found.append((self._on, self._frames[i - first][1]))
                self._next += 1
        return found
