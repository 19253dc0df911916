"""Motion templates: what the clips of a motion class have in common (thesis 2.3; Mueller and Roeder 2006).

A template is a real-valued matrix of 40 features over time. Values near 0 and 1 are shared by all training clips,
values in between vary among them and become wildcards when the template is quantised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion import dtw
from toolkit.retrieval.features.relational import FeatureMatrix, pack

WILDCARD = -1
"""Entry of a quantised template that leaves the feature open."""
_UNDECIDED = 0.5
MAX_ROUNDS = 10
"""Most rounds of warping and averaging."""
TOLERANCE = 0.005
"""They stop when the largest pairwise alignment cost, divided by the template's total weight, is at most this; those of
the strict variant at 0."""
CONTRACT_BELOW = 0.75
"""Columns lighter than this are merged with their right neighbours."""


@dataclass(frozen=True, eq=False)
class QuantisedTemplate:
    """A template of zeros, ones and wildcards (thesis 2.3).

    Attributes
    ----------
    values : int8 (40, N), 0, 1 or `WILDCARD`
    weights : float64 (N,), how many frames of an average training clip a column stands for, about 1
    """

    values: np.ndarray
    weights: np.ndarray

    def __len__(self) -> int:
        return self.values.shape[1]

    @property
    def wildcards(self) -> np.ndarray:
        """Bool (40, N): the open entries."""
        return self.values == WILDCARD

    @cached_property
    def expanded(self) -> tuple[np.ndarray, np.ndarray]:
        """Values int8 (40, M) and weights (M,), every column being about one frame (see `expand`); it is these that a
        document is aligned with."""
        return expand(self.values, self.weights)

    @cached_property
    def packed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The M columns as the kernels take them (Equation 5.2): bit words and masks of what is no wildcard, uint64
        (M,), and what a differing entry costs, float64 (M,)."""
        values, weights = self.expanded
        known = values != WILDCARD
        scale = 0.5 * (weights + 1.0) / (np.maximum(known.sum(axis=0), 1) * values.shape[1])
        return pack(values == 1), pack(known), scale

    @property
    def shortest(self) -> int:
        """Fewest document frames that an alignment needs: every step may skip one of the M columns."""
        return 1 + self.expanded[0].shape[1] // 2

    def distance(self, document: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance function and start frames (L,) of packed document columns, uint64 (L,) (Equation 5.3)."""
        return dtw.distance_function(*self.packed, document)

    def trace(self, document: np.ndarray, unknown: np.ndarray) -> tuple[float, np.ndarray]:
        """Cost and template columns (L,) of the cheapest alignment that ends in the last of some packed document
        columns (L,), -1 outside it; rows `unknown` (L,) in a column do not count."""
        return dtw.trace(*self.packed, document, unknown)


@dataclass(frozen=True, eq=False)
class MotionTemplate:
    """Average of feature matrices under iterated warping.

    Attributes
    ----------
    values : float64 (40, N), the template; 0.5 marks the wildcards of the strict variant
    weights : float64 (N,), frames of an average training clip per column; their sum is about the clips' mean length
    spread : float64 (rounds + 1,) or shorter, largest pairwise cost per frame before each round
    """

    values: np.ndarray
    weights: np.ndarray
    spread: np.ndarray

    @classmethod
    def of(cls, matrices: Sequence[FeatureMatrix], strict: bool = False) -> MotionTemplate:
        """Learn the template of one class from its clips.

        In each round every clip is the reference once, all others are warped on to it and averaged, and the averages
        are the clips of the next round; the template is the one that began as the first clip.

        Parameters
        ----------
        matrices : feature matrices of the clips at 30 Hz
        strict : keep only entries in which all aligned clips agree, all others become wildcards (for keyframes)

        Raises
        ------
        RetrievalError
            No clips, or a clip without frames.
        """
        if not matrices:
            raise RetrievalError("a motion class without clips has no template; give at least one training clip")
        empty = [matrix.name for matrix in matrices if not len(matrix)]
        if empty:
            raise RetrievalError(f"training clip {empty[0]!r} has no frames; leave it out")
        clips = [(matrix.values.astype(np.float64), np.ones(len(matrix))) for matrix in matrices]
        spread: list[float] = []
        for _ in range(MAX_ROUNDS):
            paths, largest = _align_all(clips)
            spread.append(largest / float(clips[0][1].sum()))
            if spread[-1] <= (0.0 if strict else TOLERANCE) or spread[-1:] == spread[-2:-1]:
                break
            clips = [_average(reference, clips, paths, strict) for reference in range(len(clips))]
        return cls(*clips[0], np.array(spread))

    def quantised(self, delta: float = 0.05) -> QuantisedTemplate:
        """Entries up to `delta` become 0, from 1 - `delta` on 1, the rest wildcards; delta in [0, 0.5)."""
        if not 0.0 <= delta < 0.5:
            raise RetrievalError(f"quantisation threshold {delta} is not in [0, 0.5); use 0.05, or 0 for keyframes")
        values = np.full(self.values.shape, WILDCARD, dtype=np.int8)
        values[self.values <= delta + 1e-9] = 0
        values[self.values >= 1.0 - delta - 1e-9] = 1
        return QuantisedTemplate(values, self.weights.copy())


def _average(
    reference: int,
    clips: list[tuple[np.ndarray, np.ndarray]],
    paths: dict[tuple[int, int], np.ndarray],
    strict: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Weighted mean of one clip and all others warped on to it, its time axis adapted to the new weights."""
    base, base_weights = clips[reference]
    total, weights = base * base_weights, base_weights.copy()
    for other, (values, other_weights) in enumerate(clips):
        if other != reference:
            warped, new_weights = dtw.warp(paths[reference, other], values, other_weights, len(base_weights))
            total += warped * new_weights
            weights += new_weights
    settle = _settled if strict else np.asarray
    mean, weights = expand(settle(total / weights), weights / len(clips))
    mean, weights = contract(mean, weights, CONTRACT_BELOW)
    return expand(settle(mean), weights)


def _settled(values: np.ndarray) -> np.ndarray:
    """Every entry on which clips or columns differ becomes a wildcard."""
    return np.where((values > 0.0) & (values < 1.0), _UNDECIDED, values)


def contract(values: np.ndarray, weights: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Merge from the left columns lighter than `least` with their right neighbours until they reach it.

    A remainder at the right end joins the column before it; merged columns are weighted means.
    """
    starts, gathered = [0], 0.0
    for column, weight in enumerate(weights):
        gathered += weight
        if gathered >= least:
            starts.append(column + 1)
            gathered = 0.0
    if starts[-1] < len(weights) and len(starts) > 1:
        starts.pop()
    if starts[-1] == len(weights):
        starts.pop()
    sums = np.add.reduceat(weights, starts)
    return np.add.reduceat(values * weights, starts, axis=1) / sums, sums


def _align_all(clips: list[tuple[np.ndarray, np.ndarray]]) -> tuple[dict[tuple[int, int], np.ndarray], float]:
    """Alignment paths of every ordered pair (reference, warped), and the largest cost among them."""
    paths, largest = {}, 0.0
    for i, (reference, reference_weights) in enumerate(clips):
        for j, (warped, warped_weights) in enumerate(clips):
            if i != j:
                cost, paths[i, j] = dtw.align(reference, reference_weights, warped, warped_weights)
                largest = max(largest, cost)
    return paths, largest


def expand(values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Replace a column of weight w by max(1, round(w)) equal columns that share its weight."""
    copies = np.maximum(1, np.floor(weights + 0.5)).astype(np.int64)
    return np.ascontiguousarray(np.repeat(values, copies, axis=1)), np.repeat(weights / copies, copies)
