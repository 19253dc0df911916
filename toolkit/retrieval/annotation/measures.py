"""Precision, recall and F of an annotation, over frames and over segments (thesis 5.4, Equations 5.8 to 5.16)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import RetrievalError


@dataclass(frozen=True)
class Segment:
    """Labelled segment of a document.

    Attributes
    ----------
    start, end : seconds; the end is exclusive
    label : motion class
    score : 1 minus the cost of the best alignment in it (fraction of agreeing features); 1 for a true segment
    """

    start: float
    end: float
    label: str
    score: float = 1.0

    def frames(self, frame_rate: float) -> tuple[int, int]:
        """Return the first frame and the frame after the last one."""
        return int(round(self.start * frame_rate)), int(round(self.end * frame_rate))


@dataclass(frozen=True)
class Scores:
    """Precision, recall and their harmonic mean, each in [0, 1].

    Attributes
    ----------
    right_found, found : correct retrieved items, and all retrieved items
    right_true, true : relevant items that were retrieved, and all relevant items
    """

    right_found: int
    found: int
    right_true: int
    true: int

    @property
    def precision(self) -> float:
        """Fraction of the retrieved items that are correct; 1 for no retrieved and no relevant items."""
        return self.right_found / self.found if self.found else float(not self.true)

    @property
    def recall(self) -> float:
        """Fraction of the relevant items that were retrieved; 1 for no relevant items."""
        return self.right_true / self.true if self.true else 1.0

    @property
    def f(self) -> float:
        """F-measure, harmonic mean of precision and recall (Equation 5.12)."""
        total = self.precision + self.recall
        return 2.0 * self.precision * self.recall / total if total else 0.0

    def __add__(self, other: Scores) -> Scores:
        """Return the scores of both document sets together."""
        return Scores(
            self.right_found + other.right_found, self.found + other.found,
            self.right_true + other.right_true, self.true + other.true,
        )  # fmt: skip


def label_frames(segments: Sequence[Segment], labels: Sequence[str], length: int, frame_rate: float) -> np.ndarray:
    """Return the bool (len(labels), length) mask of the frames with each label.

    Raises
    ------
    RetrievalError
        A segment has a label outside `labels`.
    """
    frames = np.zeros((len(labels), length), dtype=bool)
    for segment in segments:
        if segment.label not in labels:
            known = ", ".join(labels)
            raise RetrievalError(f"label {segment.label!r} is not one of the classes {known}; correct it or learn it")
        first, stop = segment.frames(frame_rate)
        frames[labels.index(segment.label), max(first, 0) : max(stop, 0)] = True
    return frames


def frame_scores(true: np.ndarray, found: np.ndarray) -> Scores:
    """Return P1, R1 and F1 of bool (classes, frames) labels; an item is a frame with one label (Eq. 5.8 to 5.12)."""
    both = int((true & found).sum())
    return Scores(both, int(found.sum()), both, int(true.sum()))


def segment_scores(true: Sequence[Segment], found: Sequence[Segment]) -> Scores:
    """Return P2, R2 and F2; a segment is correct if a segment of the other set with the same label overlaps it."""

    def overlaps(segment: Segment, others: Sequence[Segment]) -> bool:
        return any(o.label == segment.label and o.start < segment.end and segment.start < o.end for o in others)

    right_found = sum(overlaps(segment, true) for segment in found)
    right_true = sum(overlaps(segment, found) for segment in true)
    return Scores(right_found, len(found), right_true, len(true))


def check_truth(segments: Sequence[Segment], name: str) -> None:
    """Raise RetrievalError for true segments that cannot be scored.

    Raises
    ------
    RetrievalError
        A segment ends before it starts, or two segments of one label overlap.
    """
    for segment in segments:
        if not 0.0 <= segment.start < segment.end:
            raise RetrievalError(
                f"true segment {segment.label!r} of {name} runs from {segment.start} s to {segment.end} s; correct it"
            )
    last: dict[str, Segment] = {}
    for segment in sorted(segments, key=lambda s: s.start):
        before = last.get(segment.label)
        if before is not None and segment.start < before.end - 1e-9:
            raise RetrievalError(
                f"two true segments {segment.label!r} of {name} overlap "
                f"({before.start:g} to {before.end:g} s and {segment.start:g} to {segment.end:g} s); join or cut them"
            )
        if before is None or segment.end > before.end:
            last[segment.label] = segment
