"""Motion templates: common features of the clips of a motion class (thesis 2.3; Mueller and Roeder 2006).

A template is a real-valued matrix of 40 features over time. Values near 0 and 1 are shared by all training clips.
Other values vary among the clips and become wildcards when the template is quantised.
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
"""Entry of a quantised template that matches any value."""


@dataclass(frozen=True, eq=False)
class QuantisedTemplate:
    """Template of zeros, ones and wildcards (thesis 2.3).

    Attributes
    ----------
    values : int8 (40, N), 0, 1 or `WILDCARD`
    weights : float64 (N,), frames of an average training clip per column, about 1
    """

    values: np.ndarray
    weights: np.ndarray

    def __len__(self) -> int:
        return self.values.shape[1]

    @property
    def wildcards(self) -> np.ndarray:
        """Bool (40, N) mask of the wildcards."""
        return self.values == WILDCARD

    @cached_property
    def expanded(self) -> tuple[np.ndarray, np.ndarray]:
        """Values int8 (40, M) and weights (M,) with about one frame per column (see `expand`), for alignment."""
        return expand(self.values, self.weights)

    @cached_property
    def packed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The M columns for the kernels (Equation 5.2).

        Bit words and masks of the entries other than wildcards, uint64 (M,), and the cost of a differing entry, float64
        (M,).
        """
        values, weights = self.expanded
        known = values != WILDCARD
        scale = 0.5 * (weights + 1.0) / (np.maximum(known.sum(axis=0), 1) * values.shape[1])
        return pack(values == 1), pack(known), scale

    @property
    def shortest(self) -> int:
        """Smallest number of document frames of an alignment; every step may skip one of the M columns."""
        return 1 + self.expanded[0].shape[1] // 2

    def distance(self, document: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return distance function and start frames (L,) of packed document columns, uint64 (L,) (Equation 5.3)."""
        return dtw.distance_function(*self.packed, document)


@dataclass(frozen=True, eq=False)
class MotionTemplate:
    """Average of feature matrices under iterated warping.

    Attributes
    ----------
    values : float64 (40, N), the template; 0.5 marks the wildcards of the strict variant
    weights : float64 (N,), frames of an average training clip per column; their sum is about the clips' mean length
    """

    values: np.ndarray
    weights: np.ndarray

    @classmethod
    def of(cls, matrices: Sequence[FeatureMatrix], strict: bool = False) -> MotionTemplate:
        """Learn the template of one class from its clips.

        In each round every clip is the reference once, the others are warped to it and averaged, and the averages are
        the clips of the next round. The template is the average that started as the first clip.

        Parameters
        ----------
        matrices : feature matrices of the clips at 30 Hz
        strict : keep only entries with agreement of all aligned clips; the others become wildcards (for keyframes)

        Raises
        ------
        RetrievalError
            There are no clips, or a clip has no frames.
        """
        if not matrices:
            raise RetrievalError("a motion class without clips has no template; give at least one training clip")
        empty = [matrix.name for matrix in matrices if not len(matrix)]
        if empty:
            raise RetrievalError(f"training clip {empty[0]!r} has no frames; leave it out")
        clips = [(matrix.values.astype(np.float64), np.ones(len(matrix))) for matrix in matrices]
        spread: list[float] = []
        rounds = 10  # largest number of rounds of warping and averaging
        # Largest pairwise alignment cost, divided by the template's total weight, at which the rounds stop; 0 for the
        # strict variant.
        tolerance = 0.005
        for _ in range(rounds):
            paths, largest = _align_all(clips)
            spread.append(largest / float(clips[0][1].sum()))
            if spread[-1] <= (0.0 if strict else tolerance) or spread[-1:] == spread[-2:-1]:
                break
            clips = [_average(reference, clips, paths, strict) for reference in range(len(clips))]
        return cls(*clips[0])

    def quantised(self, delta: float = 0.05) -> QuantisedTemplate:
        """Return entries up to `delta` as 0, from 1 - `delta` on as 1, the rest as wildcards; delta in [0, 0.5)."""
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
    """Return the weighted mean of one clip and all others warped to it, its time axis adapted to the new weights."""
    base, base_weights = clips[reference]
    total, weights = base * base_weights, base_weights.copy()
    for other, (values, other_weights) in enumerate(clips):
        if other != reference:
            warped, new_weights = dtw.warp(paths[reference, other], values, other_weights, len(base_weights))
            total += warped * new_weights
            weights += new_weights
    settle = _settled if strict else np.asarray
    mean, weights = expand(settle(total / weights), weights / len(clips))
    lightest = 0.75  # weight below which a column is merged with its right neighbour
    mean, weights = contract(mean, weights, lightest)
    return expand(settle(mean), weights)


def _settled(values: np.ndarray) -> np.ndarray:
    """Replace every entry with disagreement by a wildcard."""
    undecided = 0.5
    return np.where((values > 0.0) & (values < 1.0), undecided, values)


def contract(values: np.ndarray, weights: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Merge columns lighter than `least` with their right neighbours, from the left.

    A remainder at the right end is merged with the column before it; merged columns are weighted means.
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
    """Return the alignment paths of every ordered pair (reference, warped), and the largest cost."""
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
