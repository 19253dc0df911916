"""Annotation while a motion goes on: each pose is looked at once, and an event says that a motion has ended.

The costs of subsequence DTW are causal: a column needs the two before it. Features need a short look ahead, for their
velocities are smoothed. A minimum is confirmed after a few columns without a lower one, and the classes compete as in
`annotator`: the cheapest hit of a stretch wins, and what it leaves of another is no motion.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.kernels.motion import dtw
from toolkit.retrieval.annotation.annotator import DecisionSettings, MotionClass
from toolkit.retrieval.features.frames import FrameFeatures
from toolkit.retrieval.features.relational import FEATURE_RATE, FEATURES, FeatureMatrix, pack
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.search.find import find

SMOOTHING = 0.25
"""Seconds of the longest window of a feature; half of it, and the next frame, lie in the future."""
RULES = DecisionSettings()
"""What counts as a motion among hits that overlap."""
HOLD = 3
"""Columns of 1/30 s without a lower cost that confirm a minimum."""


@dataclass(frozen=True)
class Event:
    """A motion that has ended.

    Attributes
    ----------
    label : motion class
    start, end : seconds of the recording
    time : seconds of the recording at which this was known
    delay : seconds between the two
    cost : mean share of features that differ
    """

    label: str
    start: float
    end: float
    time: float
    delay: float
    cost: float

    def to_json(self) -> str:
        """One line."""
        rounded = {k: round(v, 4) if isinstance(v, float) else v for k, v in asdict(self).items()}
        return json.dumps(rounded)


@dataclass(frozen=True)
class _Hit:
    """A class's cheapest alignment so far: its cost, and first and last column."""

    cost: float
    start: int
    end: int


class OnlineAnnotator:
    """Labels a motion pose by pose.

    Parameters
    ----------
    classes : what to look for
    body : whose poses will come; its bones are the units of length
    frame_rate : poses a second, about
    queries : learned keyframe queries; a hit of a class that has some counts only if one is met within it
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
        self._told: list[tuple[int, _Hit]] = []
        self.columns: list[np.ndarray] = []
        self._times: list[float] = []

    def push(self, pose: np.ndarray, time: float) -> list[Event]:
        """Take in the next pose (P,), any frame with y up, at `time` seconds; returns what is known now."""
        events = []
        for values, column_time in self._features.push(pose, time):
            events += self._push_column(values, column_time, time)
        return events

    def finish(self) -> list[Event]:
        """What is known when no more poses come: every minimum that was waiting."""
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
        """Hits that no lower cost has replaced for long enough, the cheapest first."""
        column = len(self.columns) - 1
        waiting = sorted((hit.cost, row) for row, hit in enumerate(self._pending) if hit is not None)
        if not waiting:
            return []
        events: list[Event] = []
        open_hits: list[_Hit] = []
        for _, row in waiting:
            hit = self._pending[row]
            assert hit is not None  # only those that wait were sorted
            rival = any(other.start <= hit.end and hit.start <= other.end for other in open_hits)
            if not everything and (column - hit.end < HOLD or rival):
                open_hits.append(hit)
                continue
            self._pending[row] = None
            if self._explained(row, hit) or not self._keyframes_met(row, hit):
                continue
            self._told = [(r, told) for r, told in self._told if told.end >= column - self._reach] + [(row, hit)]
            events.append(self._event(row, hit, now))
        return sorted(events, key=lambda event: (event.end, event.label))

    def _explained(self, row: int, hit: _Hit) -> bool:
        """Whether what was told already leaves too little of a hit: as the decision rules say."""
        frames = np.zeros(hit.end - hit.start + 1, dtype=bool)
        own = frames.copy()
        for told_row, told in self._told:
            first, stop = max(told.start - hit.start, 0), told.end + 1 - hit.start
            if stop > 0:
                frames[first:stop] = True
                if told_row == row:
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
    """Feature columns at 30 Hz from poses at any rate, as `relational_features` gives them for the whole."""

    def __init__(self, body: Body, frame_rate: float) -> None:
        self._features, self._rate = FrameFeatures(body, frame_rate), frame_rate
        window = max(1, int(np.ceil(SMOOTHING * frame_rate - 1e-9)))
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
        """Columns bool (40,) and their times that are known after one more pose."""
        joints, axis = self._features.joints(pose)
        if not self._count:
            self._features.measure(joints)
        self._frames.append((joints, axis, time))
        self._count += 1
        if self._count <= self._ahead:
            return []
        return self._columns(self._count - 1 - self._ahead, 1)

    def finish(self) -> list[tuple[np.ndarray, float]]:
        """The columns that were waiting for what does not come any more."""
        waiting = min(self._ahead, self._count)
        return self._columns(self._count - waiting, waiting) if waiting else []

    def _columns(self, frame: int, count: int) -> list[tuple[np.ndarray, float]]:
        """Columns that fall on some frames; hysteresis needs every frame, at whatever rate."""
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
    """What `QuantisedTemplate.distance` says of the columns so far, of every template and every beginning of one.

    Parameters
    ----------
    classes : whose templates are aligned

    Attributes
    ----------
    lengths : int64 (P,), columns of the template of each of P classes
    column : number of the last column of the document, -1 before the first one
    costs, starts : float64 and int64 (K,), cheapest alignment of each beginning that ends in the last column, infinite
        where there is none, and its first column
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
        """One more column of the document, as a bit word."""
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
        """Per class the cost of its whole template and its start: float64 and int64 (P,)."""
        ends = self._bounds[1:] - 1
        return self.costs[ends], self.starts[ends]
