"""Annotation: which frames of an unknown motion belong to which motion class (thesis, Chapter 5).

Every class is a set of quantised motion templates. Subsequence DTW gives a distance function per class, its hits a
modified distance function; per frame the cheapest class wins, and the resulting runs are extended to whole motions.

Two rules go beyond the thesis, which counts every local minimum as a hit and keeps every run: one motion is one hit,
and a run of which other classes explain most is no motion (`DecisionSettings`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.errors import RetrievalError, SettingsError
from toolkit.kernels.motion import dtw
from toolkit.retrieval.annotation.class_motion import ClassMotion
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.relational import FeatureMatrix, pack
from toolkit.retrieval.templates import QuantisedTemplate, expand

THRESHOLD = 0.13
"""Largest cost of a hit, `tau` (thesis 5.2): mean share of mismatching features along the alignment."""

Intervals = Mapping[str, Sequence[tuple[int, int]]]
"""Class label -> frames that may hold it, as (first, one after the last); from a keyframe search."""


@dataclass(frozen=True)
class DecisionSettings:
    """What counts as a motion, among hits that overlap.

    Attributes
    ----------
    overlap : largest share of a hit that cheaper hits of its class may cover, in [0, 1]. Neighbouring local minima of a
        distance function are the same motion with more or less of what is before and behind it
    visible : smallest share of an extended run that has to be decided for its class, in [0, 1]. What is left of a hit
        beside a cheaper one of another class is no motion of its own
    """

    overlap: float = 0.1
    visible: float = 0.75

    def __post_init__(self) -> None:
        for name in ("overlap", "visible"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise SettingsError(f"{name} {getattr(self, name)} is no share; give a value in [0, 1]")


AS_PUBLISHED = DecisionSettings(overlap=1.0, visible=0.0)
"""The thesis's rules (5.2): every local minimum is a hit, every run is kept."""
PUBLISHED_THRESHOLD = 0.07
"""`tau` with which the thesis labels tracks (6.5)."""


@dataclass(frozen=True, eq=False)
class MotionClass:
    """A motion class as annotation uses it.

    Attributes
    ----------
    label : its name in segments
    templates : quantised templates of its subclasses, at least one
    threshold : costs at or above it are no hits
    motions : how it moves along the columns of each template; empty where only the templates are known
    """

    label: str
    templates: tuple[QuantisedTemplate, ...]
    threshold: float = THRESHOLD
    motions: tuple[ClassMotion, ...] = ()

    def __post_init__(self) -> None:
        if self.motions and len(self.motions) != len(self.templates):
            raise RetrievalError(f"motion class {self.label!r} has a motion for some templates only; learn it again")
        if not self.templates:
            raise RetrievalError(f"motion class {self.label!r} has no template; give it at least one training clip")
        if not 0.0 < self.threshold <= 1.0:
            raise RetrievalError(
                f"threshold {self.threshold} of class {self.label!r} is not in (0, 1]; try {THRESHOLD}"
            )


@dataclass(frozen=True, eq=False)
class Annotation:
    """What was found in a document of L frames with P classes.

    Attributes
    ----------
    name : the document
    labels : the P classes
    frame_rate : frames per second
    distances : float64 (P, L), modified distance functions, infinite outside all hits (Fig. 5.2a)
    decided : int64 (L,), cheapest class of each frame, -1 for none (Equation 5.6)
    frames : bool (P, L), labels after the segments' extension (Fig. 5.2c); a frame may bear several
    segments : the same as runs, sorted by start
    too_long : classes whose templates are all too long for the document, so that they could not be found
    thresholds : per class, distances at or above it are no hits
    measure : what the distances are: "cost" (share of features that differ) or "doubt" (1 minus probability)
    """

    name: str
    labels: tuple[str, ...]
    frame_rate: float
    distances: np.ndarray
    decided: np.ndarray
    frames: np.ndarray
    segments: tuple[Segment, ...]
    too_long: tuple[str, ...] = ()
    thresholds: tuple[float, ...] = ()
    measure: str = "cost"


class PreparedTemplate:
    """A quantised template as bit words, ready for the DTW kernel (Equation 5.2)."""

    def __init__(self, template: QuantisedTemplate) -> None:
        values, weights = expand(template.values, template.weights)
        known = values >= 0
        self.length = values.shape[1]
        self.bits, self.mask = pack(values == 1), pack(known)
        self.scale = 0.5 * (weights + 1.0) / (np.maximum(known.sum(axis=0), 1) * self.length)

    @property
    def shortest(self) -> int:
        """Fewest document frames that an alignment needs: every step may skip one template column."""
        return 1 + self.length // 2

    def distance(self, document: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance function and start frames (L,) of packed document columns, uint64 (L,) (Equation 5.3)."""
        return dtw.distance_function(self.bits, self.mask, self.scale, document)

    def trace(self, document: np.ndarray, unknown: np.ndarray) -> tuple[float, np.ndarray]:
        """Cost and template columns (L,) of the cheapest alignment that ends in the last of some packed document
        columns (L,), -1 outside it; rows `unknown` (L,) in a column do not count."""
        return dtw.trace(self.bits, self.mask, self.scale, document, unknown)

    def lower(
        self, modified: np.ndarray, document: np.ndarray, pieces: np.ndarray, threshold: float, overlap: float
    ) -> None:
        """Lower a modified distance function (L,) to that of this template on pieces (P, 2) of a document."""
        dtw.search_pieces(self.bits, self.mask, self.scale, document, pieces, threshold, overlap, modified)


class Annotator:
    """Annotates documents with fixed classes; the templates are prepared once."""

    def __init__(self, classes: Sequence[MotionClass], settings: DecisionSettings | None = None) -> None:
        """Prepare the classes.

        Raises
        ------
        RetrievalError
            No classes, or a label twice.
        """
        labels = [motion_class.label for motion_class in classes]
        if not labels or len(set(labels)) < len(labels):
            raise RetrievalError(f"annotation needs classes with different labels, got: {', '.join(labels) or 'none'}")
        self.classes = tuple(classes)
        self.labels = tuple(labels)
        self.settings = settings or DecisionSettings()
        self._templates = [[PreparedTemplate(template) for template in c.templates] for c in classes]

    @property
    def shortest(self) -> int:
        """Fewest frames that a document needs for any class."""
        return min(template.shortest for templates in self._templates for template in templates)

    def annotate(self, features: FeatureMatrix, intervals: Intervals | None = None) -> Annotation:
        """Label a document's frames.

        Parameters
        ----------
        features : the document at 30 Hz
        intervals : per class the frames to search, others are left out (thesis 5.3); a class without an entry is not
            searched at all; None searches everything

        Raises
        ------
        RetrievalError
            The document is shorter than any template allows, or intervals name an unknown class.
        """
        unknown = sorted(set(intervals or ()) - set(self.labels))
        if unknown:
            raise RetrievalError(f"intervals for unknown class {unknown[0]!r}; the classes: {', '.join(self.labels)}")
        if len(features) < self.shortest:
            raise RetrievalError(
                f"motion {features.name!r} has {len(features)} frames at 30 Hz, but the shortest template needs "
                f"{self.shortest}; give a longer motion"
            )
        shortest = [min(template.shortest for template in templates) for templates in self._templates]
        distances = self._distances(features, intervals)
        decided = decide(distances)
        frames = dtw.widen_runs(decided, distances, self.settings.visible)  # as long as distances do not rise (5.2)
        return Annotation(
            features.name, self.labels, features.frame_rate, distances, decided, frames,
            tuple(segments_of(frames, distances, self.labels, features.frame_rate)),
            tuple(label for label, need in zip(self.labels, shortest, strict=True) if len(features) < need),
            tuple(motion_class.threshold for motion_class in self.classes),
        )  # fmt: skip

    def _distances(self, features: FeatureMatrix, intervals: Intervals | None) -> np.ndarray:
        """Modified distance functions (P, L): the minimum over a class's templates, on its intervals only."""
        words = features.words
        whole = [(0, len(words))]
        distances = np.full((len(self.classes), len(words)), np.inf)
        for row, (motion_class, templates) in enumerate(zip(self.classes, self._templates, strict=True)):
            wanted = whole if intervals is None else intervals.get(motion_class.label, ())
            pieces = np.clip(np.array(wanted, dtype=np.int64).reshape(-1, 2), 0, len(words))
            for template in templates:
                template.lower(distances[row], words, pieces, motion_class.threshold, self.settings.overlap)
        return distances


def decide(distances: np.ndarray) -> np.ndarray:
    """Class of smallest modified distance per frame: int64 (L,), -1 where all are infinite (Equation 5.6)."""
    return np.where(np.isfinite(distances).any(axis=0), distances.argmin(axis=0), -1)


def runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """Maximal runs of True in bool (L,), as (first, one after the last)."""
    padded = np.concatenate([[False], flags, [False]])
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def segments_of(frames: np.ndarray, distances: np.ndarray, labels: Sequence[str], frame_rate: float) -> list[Segment]:
    """Runs of equal label as segments, sorted by start; the score is 1 minus the smallest distance within."""
    found = []
    for row, label in enumerate(labels):
        spans = runs(frames[row])
        edges = [edge for span in spans for edge in span]
        least = np.minimum.reduceat(np.append(distances[row], np.inf), edges)[::2] if spans else np.empty(0)
        found += [
            Segment(start / frame_rate, stop / frame_rate, label, 1.0 - score)
            for (start, stop), score in zip(spans, least.tolist(), strict=True)
        ]
    return sorted(found, key=lambda segment: (segment.start, segment.end, segment.label))
