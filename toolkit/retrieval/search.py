"""Keyframe-based search and the refined search on what it leaves (thesis, Sections 3.4 to 3.6)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.errors import RetrievalError
from toolkit.kernels.keyframe_search import UNBOUNDED, keyframe_search, windows_around
from toolkit.retrieval.features import FEATURE_RATE, FeatureMatrix
from toolkit.retrieval.index import KeyframeIndex
from toolkit.retrieval.keyframes import Keyframe, KeyframeQuery

DistanceFunction = Callable[[FeatureMatrix], tuple[np.ndarray, np.ndarray]]
"""Refined comparison of one piece: cost of the best alignment that ends in each frame, and its first frame."""


@dataclass(frozen=True, eq=False)
class HitRanges:
    """Disjoint pieces of documents, in order.

    Attributes
    ----------
    documents : int64 (H,), number of the document
    starts : int64 (H,), first frame in the document, from 0, at 30 Hz
    stops : int64 (H,), frame after the last one
    processed : number of runs that were merged or looked at to find them
    """

    documents: np.ndarray
    starts: np.ndarray
    stops: np.ndarray
    processed: int = 0

    def __len__(self) -> int:
        return len(self.documents)

    @property
    def frames(self) -> int:
        """Number of frames in all ranges."""
        return int((self.stops - self.starts).sum())

    def extended(self, index: KeyframeIndex, left: int, right: int) -> HitRanges:
        """Every range longer by `left` frames before and `right` behind, inside its document; overlaps are joined."""
        lengths = np.diff(index.document_starts)[self.documents]
        starts = np.maximum(self.starts - left, 0)
        stops = np.minimum(self.stops + right, lengths)
        new = np.ones(len(self), dtype=bool)
        new[1:] = (self.documents[1:] != self.documents[:-1]) | (starts[1:] >= stops[:-1])
        first = np.flatnonzero(new)
        last = np.append(first[1:], len(self))[: len(first)] - 1
        return HitRanges(self.documents[first], starts[first], stops[last], self.processed)


@dataclass(frozen=True)
class Match:
    """One result of the refined search.

    Attributes
    ----------
    document : its name
    start, end : seconds from the start of the document
    cost : mean share of mismatching features along the best alignment, 0 = all agree
    """

    document: str
    start: float
    end: float
    cost: float


def find(index: KeyframeIndex, query: KeyframeQuery) -> HitRanges:
    """All hit relevant ranges of a query (Algorithm 1), joined where they overlap; no hit crosses a document's end.

    A query is a hit at frames n_1 <= ... <= n_K of one document if frame n_k matches keyframe k and every distance
    n_(k+1) - n_k lies within the query's bounds (Eq. 3.2 and 3.3).
    """
    minimum = np.array([least for least, _ in query.bounds], np.int64)
    maximum = np.array([UNBOUNDED if greatest is None else greatest for _, greatest in query.bounds], np.int64)
    lists = keyframe_lists(index, query.keyframes, minimum, maximum)
    offsets = np.cumsum([0, *(len(starts) for starts, _, _ in lists)])
    starts, ends = (np.concatenate([part[i] for part in lists]) for i in (0, 1))
    ranges = keyframe_search(starts, ends, offsets, minimum, maximum, index.document_starts)
    documents = np.searchsorted(index.document_starts, ranges[:, 0], side="right") - 1
    first = index.document_starts[documents]
    return HitRanges(documents, ranges[:, 0] - first, ranges[:, 1] + 1 - first, sum(count for _, _, count in lists))


def keyframe_lists(
    index: KeyframeIndex, keyframes: Sequence[Keyframe], minimum: np.ndarray, maximum: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray, int]]:
    """Inverted keyframe lists without frames that cannot be part of a hit.

    The rarest keyframe's list is merged first, and cut down to the frames that also match the keyframes meant for the
    same frame. From there on, in both directions, a hit has the next keyframe at a bounded distance from a segment of
    the last one, so it is read from the runs there wherever that is less work than merging its own list. What is left
    out is in no hit, and the parts of a segment that belong to one match stay together.
    """
    counts = [index.sets[keyframe.feature_set].count(keyframe) for keyframe in keyframes]
    first = last = rarest = int(np.argmin(counts))
    while first > 0 and maximum[first - 1] == 0:
        first -= 1
    while last + 1 < len(keyframes) and maximum[last] == 0:
        last += 1
    starts, ends, processed = index.keyframe_list(keyframes[rarest])
    for k in range(first, last + 1):
        if k != rarest:
            windows, frames = windows_around(starts, ends, 0, 0, index.document_starts)
            starts, ends, looked = index.sets[keyframes[k].feature_set].segments_near(windows, frames, keyframes[k])
            processed += looked
    lists = {k: (starts, ends, processed if k == rarest else 0) for k in range(first, last + 1)}

    def add(k: int, neighbour: int, least: int, greatest: int) -> None:
        starts, ends, _ = lists[neighbour]
        runs = index.sets[keyframes[k].feature_set]
        windows, frames = windows_around(starts, ends, least, greatest, index.document_starts)
        if frames * len(runs.run_vectors) < counts[k] * index.frames:
            lists[k] = runs.segments_near(windows, frames, keyframes[k])
        else:
            lists[k] = index.keyframe_list(keyframes[k])

    for k in range(last + 1, len(keyframes)):
        add(k, k - 1, minimum[k - 1], maximum[k - 1])
    for k in range(first - 1, -1, -1):
        add(k, k + 1, -maximum[k], -minimum[k])
    return [lists[k] for k in range(len(keyframes))]


def pieces(index: KeyframeIndex, query: KeyframeQuery, ranges: HitRanges, factor: float = 3.0) -> HitRanges:
    """What the refined search looks at: `factor` times the query's lead to the left, `factor` times its tail to the
    right.

    The authors used 3 for retrieval; annotation has its own (`preselection.EXTENSION`).
    """
    return ranges.extended(index, round(factor * query.lead), round(factor * query.tail))


def rank(
    index: KeyframeIndex, searched: HitRanges, distance: DistanceFunction, threshold: float = np.inf
) -> list[Match]:
    """Refined search: alignments in the pieces `searched`, cheapest first.

    In each piece the cheapest end is taken repeatedly while it costs less than `threshold`; ends from half the hit's
    length before to a tenth behind its own end are then closed, and later hits that start near its start are dropped.
    """
    matches = []
    for document, start, stop in zip(searched.documents, searched.starts, searched.stops, strict=True):
        costs, firsts = distance(index.features(int(document), int(start), int(stop)))
        for first, last, cost in pick(costs, firsts, threshold):
            begin, end = (int(start) + first) / FEATURE_RATE, (int(start) + last + 1) / FEATURE_RATE
            matches.append(Match(index.names[document], begin, end, cost))
    return sorted(matches, key=lambda match: (match.cost, match.document, match.start))


def pick(costs: np.ndarray, firsts: np.ndarray, threshold: float) -> list[tuple[int, int, float]]:
    """Hits (first frame, last frame, cost) of a distance function `costs` (L,) with alignment starts `firsts` (L,).

    A hit of length n forbids further ends from 0.5 n before to 0.1 n after its end; a later path that starts between
    0.1 n before and 0.5 n after its start is dropped.
    """
    costs = np.asarray(costs, np.float64).copy()
    if costs.shape != np.shape(firsts):
        raise RetrievalError(
            f"a distance function gave {costs.shape} costs and {np.shape(firsts)} starts; give one per frame"
        )
    hits: list[tuple[int, int, float]] = []
    while len(costs):
        last = int(np.argmin(costs))
        cost = float(costs[last])
        if not (np.isfinite(cost) and cost < threshold):
            break
        first = int(firsts[last])
        length = last - first + 1
        if any(-0.1 * (b - a + 1) <= first - a <= 0.5 * (b - a + 1) for a, b, _ in hits):
            costs[last] = np.inf
            continue
        hits.append((first, last, cost))
        costs[max(0, last - int(0.5 * length)) : last + int(0.1 * length) + 1] = np.inf
    return hits
