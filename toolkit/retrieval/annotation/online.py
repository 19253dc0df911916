"""Online annotation: each pose is processed once, and an event reports the end of a motion.

The costs of subsequence DTW are causal: a column needs the two before it. Features need a short look-ahead, because
their velocities are smoothed. A minimum is confirmed after a few columns without a lower one. Overlapping hits are
decided as in `annotator`: the hit with the lowest cost is kept, and the remainder of another one is dropped.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.kernels.motion import dtw
from toolkit.kernels.motion import relations as r
from toolkit.retrieval.annotation.annotator import DecisionSettings, MotionClass
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion, points_of_body
from toolkit.retrieval.features.relational import FEATURE_RATE, FEATURES, FeatureMatrix, pack, program
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.search.find import find

_TESTS = {"<": r.BELOW, "<=": r.AT_MOST, ">": r.ABOVE, ">=": r.AT_LEAST, "within": r.WITHIN}


class FrameFeatures:
    """Features of single frames of one body.

    Parameters
    ----------
    body : body of the poses
    frame_rate : frames a second

    Attributes
    ----------
    loose, strict : float64 (40,), thresholds in metres, metres per second or degrees, in the units of `lengths`
    """

    def __init__(self, body: Body, frame_rate: float) -> None:
        self._points, self._rate, self._body = points_of_body(body), frame_rate, body
        self._program = program(frame_rate)
        self._tests = np.array([_TESTS[feature.test] for feature in FEATURES])
        self.loose, self.strict = np.empty(len(FEATURES)), np.empty(len(FEATURES))

    def measure(self, joints: np.ndarray) -> None:
        """Set the units of length from named joints (24, 3)."""
        lengths = BodyLengths.of(Motion("now", joints[None], self._rate))
        units = np.array([lengths.unit(feature.unit) for feature in FEATURES])
        self.loose[:] = [feature.loose for feature in FEATURES] * units
        self.strict[:] = [feature.strict for feature in FEATURES] * units

    def joints(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return named joints (24, 3), metres, and the root's x axis (3,) of a pose (P,), in its frame."""
        joints, axis = np.empty((len(NAMED_JOINTS), 3)), np.empty(3)
        r.named_joints(
            skeleton.check_pose(pose), skeleton.PARENTS, self._body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS,
            *self._points, joints, axis,
        )  # fmt: skip
        return joints, axis

    def quantities(
        self, joints: np.ndarray, axes: np.ndarray, frame: int, rows: np.ndarray | slice = slice(None)
    ) -> np.ndarray:
        """Return the quantities of features, float64 (40,) or some, in one frame of joints (T, 24, 3)."""
        wanted = self._program[rows]
        values = np.empty(len(wanted))
        r.quantities(joints, axes, frame, self._rate, wanted, values)
        return values

    def push(self, joints: np.ndarray, axes: np.ndarray, frame: int, on: np.ndarray) -> None:
        """Update the features (40,) of the previous frame to this one, with their hysteresis."""
        r.push_tests(self.quantities(joints, axes, frame), self._tests, self.loose, self.strict, on)


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
        self._thresholds = np.array([motion_class.threshold for motion_class in classes])
        self._alignments = aligned = CausalAlignments(classes)
        self._reach = 2 * int(aligned.lengths.max(initial=0))  # columns of the longest hit: every step may take two
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
        self._alignments.push(pack(values[:, None])[0])
        column = self._alignments.column
        costs, starts = self._alignments.whole()
        for row in np.flatnonzero(costs < self._thresholds):
            pending = self._pending[row]
            if pending is None or costs[row] < pending.cost:
                self._pending[row] = _Hit(float(costs[row]), int(starts[row]), column)
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
            events.append(self._event(row, hit, now))
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

    def _event(self, row: int, hit: _Hit, now: float) -> Event:
        start, end = self._times[hit.start], self._times[hit.end]
        return Event(self.labels[row], start, end, now, now - end, hit.cost)


class FeatureStream:
    """Feature columns at 30 Hz from poses at any rate, equal to `relational_features` of the whole motion."""

    def __init__(self, body: Body, frame_rate: float) -> None:
        self._features, self._rate = FrameFeatures(body, frame_rate), frame_rate
        # Longest smoothing window of a feature, seconds; half of it and the next frame are look-ahead.
        longest_window = 0.25
        window = max(1, int(np.ceil(longest_window * frame_rate - 1e-9)))
        self._ahead, self._behind = window // 2 + 1, (window - 1) // 2 + 1
        self._frames: deque[tuple[np.ndarray, np.ndarray, float]] = deque(maxlen=self._ahead + self._behind + 1)
        self._count = 0
        self._next = 0
        self._on = np.zeros(len(FEATURES), dtype=bool)

    @property
    def now(self) -> float:
        """Time of the last pose, seconds."""
        return self._frames[-1][2] if self._frames else 0.0

    def push(self, pose: np.ndarray, time: float) -> list[tuple[np.ndarray, float]]:
        """Add a pose; return the columns bool (40,) that are now complete, and their times."""
        joints, axis = self._features.joints(pose)
        if not self._count:
            self._features.measure(joints)
        self._frames.append((joints, axis, time))
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
        joints, axes, times = (np.array(part) for part in zip(*self._frames, strict=True))
        first = self._count - len(self._frames)
        found = []
        for i in range(frame, frame + count):
            self._features.push(joints, axes, i - first, self._on)
            while int(np.rint(self._next * self._rate / FEATURE_RATE)) <= i:
                found.append((self._on.copy(), float(times[i - first])))
                self._next += 1
        return found


class CausalAlignments:
    """Costs of `QuantisedTemplate.distance` up to the present column, for every template and its prefixes.

    Parameters
    ----------
    classes : classes with the templates

    Attributes
    ----------
    lengths : int64 (P,), columns of the template of each of P classes
    column : number of the last column of the document, -1 before the first one
    costs, starts : float64 and int64 (K,), cheapest alignment of each prefix that ends in the last column, infinite for
        none, and its first column
    """

    def __init__(self, classes: Sequence[MotionClass]) -> None:
        packed = [motion_class.template.packed for motion_class in classes]
        self._bits, self._mask, self._scale = (np.concatenate(part) for part in zip(*packed, strict=True))
        self.lengths = np.array([len(bits) for bits, _, _ in packed], dtype=np.int64)
        self._bounds = np.concatenate([[0], np.cumsum(self.lengths)])
        self._costs = np.full((3, self._bounds[-1]), np.inf)
        self._starts = np.full(self._costs.shape, -1, dtype=np.int64)
        self.column = -1

    def push(self, word: np.uint64) -> None:
        """Add one column of the document, as a bit word."""
        self.column += 1
        dtw.push_columns(
            self._bits, self._mask, self._scale, self._bounds, word, self.column, self._costs, self._starts
        )

    @property
    def costs(self) -> np.ndarray:
        """See the class."""
        return self._costs[self.column % 3]

    @property
    def starts(self) -> np.ndarray:
        """See the class."""
        return self._starts[self.column % 3]

    def whole(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the cost of each class's whole template and its start: float64 and int64 (P,)."""
        ends = self._bounds[1:] - 1
        return self.costs[ends], self.starts[ends]
