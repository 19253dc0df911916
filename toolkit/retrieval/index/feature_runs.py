"""Runs of equal feature vectors and their inverted lists (thesis, Section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.kernels.motion.keyframe_search import keyframe_list, keyframe_list_near, listed_runs
from toolkit.retrieval.keyframes.query import Keyframe


@dataclass(frozen=True, eq=False)
class RunLists:
    """Runs of equal feature vectors of one feature set, and the inverted list of runs of each vector.

    Attributes
    ----------
    run_starts : int32 (R + 1,), first frame of each run, counted through all documents; the last entry is the number of
        frames
    run_vectors : unsigned (R,), feature vector of each run, bit i being feature i of the set
    document_runs : int32 (D + 1,), first run of each document; the last entry is R
    vectors : unsigned (U,), the feature vectors that occur, ascending
    list_offsets : int64 (U + 1,), the list of `vectors[u]` is `list_runs[list_offsets[u] : list_offsets[u + 1]]`
    list_runs : int32 (R,), run numbers, ascending within each list
    """

    run_starts: np.ndarray
    run_vectors: np.ndarray
    document_runs: np.ndarray
    vectors: np.ndarray
    list_offsets: np.ndarray
    list_runs: np.ndarray

    @classmethod
    def of(cls, vectors: np.ndarray, document_starts: np.ndarray) -> RunLists:
        """Return runs and lists of feature vectors (N,), of documents that start at `document_starts` (D + 1,)."""
        starts = np.union1d(np.flatnonzero(vectors[1:] != vectors[:-1]) + 1, document_starts)
        run_starts, run_vectors = starts.astype(np.int32), vectors[starts[:-1]]
        document_runs = np.searchsorted(starts, document_starts).astype(np.int32)
        order = np.argsort(run_vectors, kind="stable").astype(np.int32)
        vectors, first = np.unique(run_vectors[order], return_index=True)
        offsets = np.append(first, len(order)).astype(np.int64)
        return cls(run_starts, run_vectors, document_runs, vectors, offsets, order)

    def segments(self, mask: int, value: int) -> tuple[np.ndarray, np.ndarray]:
        """Return first and last frames of the segments with `v & mask == value`."""
        return keyframe_list(
            self.vectors, self.list_offsets, self.list_runs, self.run_starts, self.document_runs,
            self.vectors.dtype.type(mask), self.vectors.dtype.type(value),
        )  # fmt: skip

    def count(self, keyframe: Keyframe) -> int:
        """Return the number of runs in the inverted lists of a keyframe."""
        kind = self.vectors.dtype.type
        return int(listed_runs(self.vectors, self.list_offsets, kind(keyframe.mask), kind(keyframe.value)))

    def segments_near(self, windows: np.ndarray, frames: int, keyframe: Keyframe) -> tuple[np.ndarray, np.ndarray]:
        """Return a keyframe's `segments` within disjoint windows [first, last], int64 (W, 2)."""
        kind = self.vectors.dtype.type
        return keyframe_list_near(
            windows, self.run_vectors, self.run_starts, kind(keyframe.mask), kind(keyframe.value), frames
        )
