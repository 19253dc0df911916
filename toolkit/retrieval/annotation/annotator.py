"""Annotation of the frames of an unknown motion with motion classes (thesis, Chapter 5).

Every class is a quantised motion template. Subsequence DTW gives a distance function per class, and its hits give a
modified distance function. The class with the lowest cost is selected in each frame, and the resulting runs are
extended to whole motions.

Two rules go beyond the thesis, which counts every local minimum as a hit and keeps every run: one motion is one hit,
and a run that is mostly explained by other classes is dropped (`DecisionSettings`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion import dtw
from toolkit.retrieval.annotation.class_motion import ClassMotion
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.relational import FeatureMatrix
from toolkit.retrieval.templates import QuantisedTemplate

HIT_THRESHOLD = 0.13
"""Largest cost of a hit, `tau` (thesis 5.4): mean fraction of mismatching features along the alignment."""

Intervals = Mapping[str, Sequence[tuple[int, int]]]
"""Class label -> frames to search, as (first, one after the last); from a keyframe search."""


@dataclass(frozen=True)
class DecisionSettings:
    """Acceptance of overlapping hits.

    Attributes
    ----------
    overlap : largest fraction of a hit that cheaper hits of its class may cover, in [0, 1]. Neighbouring local minima
        of a distance function are the same motion with different boundaries
    visible : smallest fraction of an extended run that is decided for its class, in [0, 1]. The remainder of a hit
        beside a cheaper one of another class is no separate motion
    """

    overlap: float = 0.1
    visible: float = 0.75


AS_PUBLISHED = DecisionSettings(overlap=1.0, visible=0.0)
"""Rules of the thesis (5.2): every local minimum is a hit, every run is kept."""


@dataclass(frozen=True, eq=False)
class MotionClass:
    """Motion class for annotation.

    Attributes
    ----------
    label : name in segments
    template : quantised template of its clips
    threshold : costs at or above it are no hits
    motion : mean motion along the columns of the template; None if unknown
    """

    label: str
    template: QuantisedTemplate
    threshold: float = HIT_THRESHOLD
    motion: ClassMotion | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.threshold <= 1.0:
            raise RetrievalError(
                f"threshold {self.threshold} of class {self.label!r} is not in (0, 1]; try {HIT_THRESHOLD}"
            )


@dataclass(frozen=True, eq=False)
class Annotation:
    """Annotation of a document of L frames with P classes.

    Attributes
    ----------
    name : name of the document
    labels : labels of the P classes
    frame_rate : frames per second
    distances : float64 (P, L), modified distance functions, infinite outside all hits (Fig. 5.2a)
    frames : bool (P, L), labels after the segments' extension (Fig. 5.2c); a frame may have several
    segments : the same as runs, sorted by start
    too_long : classes with templates that are longer than the document and were not searched
    thresholds : per class, distances at or above it are no hits
    measure : type of the distances: "cost" (fraction of differing features) or "doubt" (1 minus probability)
    """

    name: str
    labels: tuple[str, ...]
    frame_rate: float
    distances: np.ndarray
    frames: np.ndarray
    segments: tuple[Segment, ...]
    too_long: tuple[str, ...] = ()
    thresholds: tuple[float, ...] = ()
    measure: str = "cost"


class Annotator:
    """Annotator of documents with fixed classes."""

    def __init__(self, classes: Sequence[MotionClass], settings: DecisionSettings | None = None) -> None:
        """Set the classes.

        Raises
        ------
        RetrievalError
            There are no classes, or a label is repeated.
        """
        labels = [motion_class.label for motion_class in classes]
        if not labels or len(set(labels)) < len(labels):
            raise RetrievalError(f"annotation needs classes with different labels, got: {', '.join(labels) or 'none'}")
        self.classes = tuple(classes)
        self.labels = tuple(labels)
        self.settings = settings or DecisionSettings()

    @property
    def shortest(self) -> int:
        """Smallest number of frames of a document for any class."""
        return min(motion_class.template.shortest for motion_class in self.classes)

    def annotate(self, features: FeatureMatrix, intervals: Intervals | None = None) -> Annotation:
        """Label a document's frames.

        Parameters
        ----------
        features : features of the document at 30 Hz
        intervals : frames to search for each class (thesis 5.3); a class without an entry is not searched; None
            searches everything

        Raises
        ------
        RetrievalError
            The document is shorter than every template allows, or intervals name an unknown class.
        """
        unknown = sorted(set(intervals or ()) - set(self.labels))
        if unknown:
            raise RetrievalError(f"intervals for unknown class {unknown[0]!r}; the classes: {', '.join(self.labels)}")
        if len(features) < self.shortest:
            raise RetrievalError(
                f"motion {features.name!r} has {len(features)} frames at 30 Hz, but the shortest template needs "
                f"{self.shortest}; give a longer motion"
            )
        distances, searched = self._distances(features, intervals)
        decided = np.full(len(features), -1)  # the cheapest class of each frame (Equation 5.6), -1 for none
        found = distances[:, searched]
        decided[searched] = np.where(np.isfinite(found).any(axis=0), found.argmin(axis=0), -1)
        frames = dtw.widen_runs(decided, distances, self.settings.visible)  # as long as distances do not rise (5.2)
        return Annotation(
            features.name, self.labels, features.frame_rate, distances, frames,
            tuple(segments_of(frames, distances, self.labels, features.frame_rate)),
            tuple(c.label for c in self.classes if len(features) < c.template.shortest),
            tuple(motion_class.threshold for motion_class in self.classes),
        )  # fmt: skip

    def _distances(self, features: FeatureMatrix, intervals: Intervals | None) -> tuple[np.ndarray, np.ndarray]:
        """Return modified distances (P, L), each on the intervals of its class, and all searched frames (L,)."""
        words = features.words
        whole = [(0, len(words))]
        distances, searched = np.full((len(self.classes), len(words)), np.inf), np.zeros(len(words), dtype=bool)
        for row, motion_class in zip(distances, self.classes, strict=True):
            wanted = whole if intervals is None else intervals.get(motion_class.label, ())
            pieces = np.clip(np.array(wanted, dtype=np.int64).reshape(-1, 2), 0, len(words))
            dtw.search_pieces(
                *motion_class.template.packed, words, pieces, motion_class.threshold, self.settings.overlap, row
            )
            for start, stop in pieces.tolist():
                searched[start:stop] = True
        return distances, searched


def segments_of(frames: np.ndarray, distances: np.ndarray, labels: Sequence[str], frame_rate: float) -> list[Segment]:
    """Return runs of equal label as segments, sorted by start; the score is 1 minus the smallest distance."""
    length = frames.shape[1]
    places = np.flatnonzero(frames)  # of rows one after the other; a run ends with its row
    heads = np.flatnonzero((np.diff(places, prepend=-2) > 1) | (places % length == 0))
    if not len(places):
        return []
    rows, starts = np.divmod(places[heads], length)
    stops = starts + np.diff(heads, append=len(places))
    scores = 1.0 - np.minimum.reduceat(distances.ravel()[places], heads)
    found = [
        Segment(start / frame_rate, stop / frame_rate, labels[row], score)
        for row, start, stop, score in zip(*(a.tolist() for a in (rows, starts, stops, scores)), strict=True)
    ]
    return sorted(found, key=lambda segment: (segment.start, segment.end, segment.label))
