"""Search by example: the segments of all documents with the lowest cost against a segment of a clip.

Subsequence DTW in two steps: graded features at 7.5 Hz, then grades and limb positions around the best hits at 30 Hz.
No keyframes restrict the search: automatic keyframes, as in the thesis, missed half of the motions of other people.
"""

from __future__ import annotations

import math

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion.graded import distinct_hits, graded_distances
from toolkit.retrieval.features import places
from toolkit.retrieval.features.grades import BLOCK_COLUMNS, FULL, coarse, importance
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.search.find import Match


def search_example(
    index: KeyframeIndex, example: FeatureMatrix, limit: int = 20, threshold: float = np.inf
) -> list[Match]:
    """Return the `limit` segments most similar to the example, cheapest first.

    The cost of a match is the mean along the best alignment of the weighted difference of grades, from 0 (equal) to 1
    (all features at the other extreme), and of the difference of limb positions, 1 being 1.3 body lengths, plus a
    penalty for another duration. Documents shorter than half the example have no match.

    Raises
    ------
    RetrievalError
        The example is too short or too long, or no document is long enough.
    """
    shortest = 4  # coarse columns of the shortest example, about half a second
    longest = 3000  # frames of the longest example, 100 seconds; it takes a minute for an hour of documents
    if not (shortest - 1) * BLOCK_COLUMNS < len(example) <= longest:
        raise RetrievalError(
            f"the example {example.name!r} lasts {example.duration:.2f} s; give between "
            f"{shortest * BLOCK_COLUMNS / FEATURE_RATE:.2f} and {longest / FEATURE_RATE:.0f} s"
        )
    available = int(np.diff(index.document_starts).max())
    need = 1 + len(example) // 2
    if available < need:
        raise RetrievalError(
            f"the longest document of the index has {available} frames at 30 Hz, but {example.name!r} needs {need}; "
            "use a shorter example"
        )
    columns, starts = index.coarse
    grade_weights = importance(example.grades)
    costs, origins = graded_distances(*_template(coarse(example.grades), grade_weights), columns, starts)
    spare_hits = 10  # number of additional hits in the second step, because some become worse or coincide
    hits = distinct_hits(costs, origins, starts, np.inf, limit + spare_hits)
    # Weight of the limb positions in a cost; the rest is the weight of the grades. More is slightly better for mocap
    # and much worse for Kinect skeletons, whose idle limbs vary between people. Tuned on HDM05 actors bd and bk with
    # easy and hard filler and on UTD-MHAD subjects 1 and 3.
    places_weight = 0.5
    weights = np.concatenate([(1.0 - places_weight) * grade_weights, places_weight * places.importance(example.places)])
    fine = _template(np.concatenate([example.grades, example.places]), weights)
    found = [_refined(index, fine, int(d), int(first), int(last)) for d, first, last in hits]
    return _distinct(sorted((m for m in found if m.cost < threshold), key=_rank))[:limit]


def _rank(match: Match) -> tuple[float, str, float]:
    return match.cost, match.document, match.start


def _distinct(matches: list[Match]) -> list[Match]:
    """Return the matches, cheapest first, without those of which a cheaper one covers more than half."""
    kept: dict[str, list[Match]] = {}
    for match in matches:
        others = kept.setdefault(match.document, [])
        shared = (min(match.end, other.end) - max(match.start, other.start) for other in others)
        if all(2 * seconds <= match.end - match.start for seconds in shared):
            others.append(match)
    return sorted((m for group in kept.values() for m in group), key=_rank)


def _template(rows: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return columns and weights for the kernels, by which the cost of a path is the mean over its columns."""
    scaled = weights / (2.0 * FULL * rows.shape[1])
    return np.ascontiguousarray(rows.T, dtype=np.float32), scaled.astype(np.float32)


def _refined(
    index: KeyframeIndex, template: tuple[np.ndarray, np.ndarray], document: int, first: int, last: int
) -> Match:
    """Return the best alignment around a hit of coarse columns `first` to `last` of a document."""
    length = len(template[0])
    offset, end = (int(frame) for frame in index.document_starts[document : document + 2])
    refined_frames = 2 * BLOCK_COLUMNS  # frames by which a hit may change on each side in the second step
    stop = min(BLOCK_COLUMNS * (last + 1) + refined_frames, end - offset)
    begin = max(min(BLOCK_COLUMNS * first - refined_frames, stop - length), 0)
    rows = slice(offset + begin, offset + stop)
    piece = np.concatenate([index.grades[rows], index.places[rows]], axis=1)
    costs, starts = graded_distances(*template, piece, np.array([0, len(piece)]))
    best = int(costs.argmin())
    start, stop = int(starts[best]), best + 1
    duration_cost = 0.02  # cost of a match that is e times longer or shorter than the example, tuned likewise
    cost = float(costs[best]) + duration_cost * abs(math.log((stop - start) / length))
    return Match(index.names[document], (begin + start) / FEATURE_RATE, (begin + stop) / FEATURE_RATE, cost)
