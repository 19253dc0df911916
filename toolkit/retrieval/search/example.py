"""Search by example: the stretches of all documents that are most like a stretch of a clip.

Subsequence DTW in two steps: of graded features at 7.5 Hz, then of these and the places of the limbs around the best
hits at 30 Hz. No keyframe decides what is looked at: automatic ones, the thesis's road, missed every second motion of
another person.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion.graded import distinct_hits, graded_distances
from toolkit.retrieval.features import places
from toolkit.retrieval.features.grades import BLOCK, FULL, coarse, importance
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.search.find import Match

MARGIN = 2 * BLOCK
"""Frames by which a hit may grow or move on each side when it is looked at more closely."""
SPARE = 10
"""Hits looked at beyond those asked for: some turn out to be worse, or the same motion."""
SHORTEST = 4
"""Coarse columns of the shortest example, about half a second."""
PLACES = 0.5
"""Share of the places in a cost, that of the grades being the rest. More is a little better for mocap and much worse
for skeletons of a Kinect, which place idle limbs differently on every person: tuned on HDM05 actors bd and bk with easy
and hard filler and on UTD-MHAD subjects 1 and 3."""
HASTE = 0.02
"""Cost of a match e times as long as the example or as short, chosen likewise: sneaking is a slow walk, among other
things."""
LONGEST = 3000
"""Frames of the longest example, 100 seconds; a minute of work for an hour of documents."""


@dataclass(frozen=True, eq=False)
class SearchExample:
    """What to search for.

    Attributes
    ----------
    name : of the clip
    grades : int8 (40, N), graded features at 30 Hz
    places : int8 (24, N), places of the limbs
    weights : float64 (40,), how much each feature counts, sum 1
    """

    name: str
    grades: np.ndarray
    places: np.ndarray
    weights: np.ndarray

    @classmethod
    def of(cls, features: FeatureMatrix) -> SearchExample:
        """A whole feature matrix as an example, weighted by what it does with each feature.

        Raises
        ------
        RetrievalError
            It is too short or too long.
        """
        if not (SHORTEST - 1) * BLOCK < len(features) <= LONGEST:
            raise RetrievalError(
                f"the example {features.name!r} lasts {features.duration:.2f} s; give between "
                f"{SHORTEST * BLOCK / FEATURE_RATE:.2f} and {LONGEST / FEATURE_RATE:.0f} s"
            )
        return cls(features.name, features.grades, features.places, importance(features.grades))


def search_example(index: KeyframeIndex, example: SearchExample, limit: int, threshold: float = np.inf) -> list[Match]:
    """The `limit` stretches most like the example, cheapest first.

    The cost of a match is the mean along the best alignment of the weighted difference of grades, from 0 (equal) to 1
    (every feature at its other extreme), and of the difference of places, 1 being 1.3 body lengths; and a little for
    another duration. Documents shorter than half the example hold none.

    Raises
    ------
    RetrievalError
        No document is long enough.
    """
    longest = int(np.diff(index.document_starts).max())
    need = 1 + example.grades.shape[1] // 2
    if longest < need:
        raise RetrievalError(
            f"the longest document of the index has {longest} frames at 30 Hz, but {example.name!r} needs {need}; "
            "use a shorter example"
        )
    columns, starts = index.coarse
    template = _Template.of(coarse(example.grades), example.weights)
    costs, origins = graded_distances(template.columns, template.weights, columns, starts)
    hits = distinct_hits(costs, origins, starts, np.inf, limit + SPARE)
    weights = np.concatenate([(1.0 - PLACES) * example.weights, PLACES * places.importance(example.places)])
    fine = _Template.of(np.concatenate([example.grades, example.places]), weights)
    found = [_refined(index, fine, int(d), int(first), int(last)) for d, first, last in hits]
    return _distinct(sorted((m for m in found if m.cost < threshold), key=_rank))[:limit]


def _rank(match: Match) -> tuple[float, str, float]:
    return match.cost, match.document, match.start


def _distinct(matches: list[Match]) -> list[Match]:
    """Matches, cheapest first, without those of which a cheaper one covers more than half."""
    kept: dict[str, list[Match]] = {}
    for match in matches:
        others = kept.setdefault(match.document, [])
        shared = (min(match.end, other.end) - max(match.start, other.start) for other in others)
        if all(2 * seconds <= match.end - match.start for seconds in shared):
            others.append(match)
    return sorted((m for group in kept.values() for m in group), key=_rank)


@dataclass(frozen=True, eq=False)
class _Template:
    """An example as the kernel takes it; with these weights a path costs the mean over its columns."""

    columns: np.ndarray
    weights: np.ndarray

    @classmethod
    def of(cls, rows: np.ndarray, weights: np.ndarray) -> _Template:
        scaled = weights / (2.0 * FULL * rows.shape[1])
        return cls(np.ascontiguousarray(rows.T, dtype=np.float32), scaled.astype(np.float32))


def _refined(index: KeyframeIndex, template: _Template, document: int, first: int, last: int) -> Match:
    """The best alignment around a hit of coarse columns `first` to `last` of a document."""
    offset, end = (int(frame) for frame in index.document_starts[document : document + 2])
    stop = min(BLOCK * (last + 1) + MARGIN, end - offset)
    begin = max(min(BLOCK * first - MARGIN, stop - len(template.columns)), 0)
    rows = slice(offset + begin, offset + stop)
    piece = np.concatenate([index.grades[rows], index.places[rows]], axis=1)
    costs, starts = graded_distances(template.columns, template.weights, piece, np.array([0, len(piece)]))
    best = int(costs.argmin())
    start, stop = int(starts[best]), best + 1
    cost = float(costs[best]) + HASTE * abs(math.log((stop - start) / len(template.columns)))
    return Match(index.names[document], (begin + start) / FEATURE_RATE, (begin + stop) / FEATURE_RATE, cost)
