"""Refined search on what the keyframe search leaves (thesis, Section 3.6)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from toolkit.errors import RetrievalError
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.search.find import HitRanges

DistanceFunction = Callable[[FeatureMatrix], tuple[np.ndarray, np.ndarray]]
"""Refined comparison of one piece: cost of the best alignment that ends in each frame, and its first frame."""


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
