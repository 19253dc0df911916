"""Motion model: annotation by example clips and place classifiers, and its file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.io.archives import Column
from toolkit.io.errors import RetrievalError
from toolkit.retrieval.annotation.annotator import Annotation
from toolkit.retrieval.annotation.examples import ExampleSet
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.annotation.place_classifier import MEASURES, PlaceClassifier
from toolkit.retrieval.features.grades import BLOCK_COLUMNS
from toolkit.retrieval.features.relational import FEATURES, FeatureMatrix
from toolkit.retrieval.stored_arrays import StoredKind

RELEARN = "learn it again with `depthmocap learn`"
KIND = StoredKind("a motion model", 1, RELEARN, {
    "columns": Column("i", ("S", len(FEATURES)), -128, 127),
    "starts": Column("i", ("E1",), 0),
    "weights": Column("f", ("E", len(FEATURES)), 0.0, 1.0),
    "mean": Column("f", ("P", MEASURES)),
    "scale": Column("f", ("P", MEASURES), 1e-9),
    "judges": Column("f", ("P", MEASURES)),
    "offsets": Column("f", ("P",)),
})  # fmt: skip


@dataclass(frozen=True)
class _Header:
    """Header of a model file."""

    labels: tuple[str, ...]
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class MotionModel:
    """Motion classes as example clips, with a classifier for each.

    Attributes
    ----------
    examples : example clips
    classifiers : classifiers in the order of `examples.classes`
    """

    examples: ExampleSet
    classifiers: tuple[PlaceClassifier, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the classes, sorted."""
        return self.examples.classes

    def annotate(self, features: FeatureMatrix, least: float = 0.5) -> Annotation:
        """Label a document's frames, the most probable motions first, without overlap.

        Parameters
        ----------
        features : the document at 30 Hz
        least : smallest probability of a motion

        Raises
        ------
        RetrievalError
            The document is too short for every example.
        """
        if len(features) < self.examples.shortest:
            raise RetrievalError(
                f"motion {features.name!r} has {len(features)} frames at 30 Hz, but the shortest example needs "
                f"{self.examples.shortest}; give a longer motion"
            )
        length = len(features)
        doubts = np.full((len(self.labels), length), np.inf)
        found: list[tuple[float, int, int, int]] = []
        for row, (label, classifier) in enumerate(zip(self.labels, self.classifiers, strict=True)):
            places = self.examples.propose(label, [features])
            doubt = 1.0 - classifier.probability(places.described)
            for k in np.argsort(doubt, kind="stable"):
                first, stop = (
                    BLOCK_COLUMNS * int(places.firsts[k]),
                    min(BLOCK_COLUMNS * (int(places.lasts[k]) + 1), length),
                )
                np.minimum(doubts[row, first:stop], doubt[k], out=doubts[row, first:stop])
                if doubt[k] <= 1.0 - least:
                    found.append((float(doubt[k]), row, first, stop))
        frames = np.zeros(doubts.shape, dtype=bool)
        segments: list[Segment] = []
        rate = features.frame_rate
        shared = 0.3  # largest fraction of a motion's frames that more probable motions may cover
        for doubt_of_hit, row, first, stop in sorted(found):
            if np.count_nonzero(frames[:, first:stop].any(axis=0)) <= shared * (stop - first):
                frames[row, first:stop] = True
                segments.append(Segment(first / rate, stop / rate, self.labels[row], 1.0 - doubt_of_hit))
        return Annotation(
            features.name, self.labels, rate, doubts, frames,
            tuple(sorted(segments, key=lambda segment: (segment.start, segment.end, segment.label))),
            thresholds=(1.0 - least,) * len(self.labels), measure="doubt",
        )  # fmt: skip

    def save(self, path: str | Path) -> None:
        """Write the model as one NPZ file, atomically."""
        arrays = {
            "columns": self.examples.columns, "starts": self.examples.starts,
            "weights": self.examples.weights, "mean": np.array([classifier.mean for classifier in self.classifiers]),
            "scale": np.array([classifier.scale for classifier in self.classifiers]),
            "judges": np.array([classifier.weights for classifier in self.classifiers]),
            "offsets": np.array([classifier.offset for classifier in self.classifiers]),
        }  # fmt: skip
        KIND.save(path, {"labels": self.examples.labels, "names": self.examples.names}, arrays)

    @classmethod
    def load(cls, path: str | Path) -> MotionModel:
        """Read a file of `save`.

        Raises
        ------
        RetrievalError
            The file is missing, no model, damaged, of another version, or learned with other features.
        """
        header, arrays = KIND.load(path, _Header)
        labels, names = header.labels, header.names
        starts = arrays["starts"].astype(np.int64)
        fits = (
            len(labels) == len(names) == len(arrays["weights"]) == len(starts) - 1 > 0
            and len(arrays["offsets"]) == len(set(labels))
            and starts[0] == 0
            and starts[-1] == len(arrays["columns"])
            and bool((np.diff(starts) > 0).all())
        )
        if not fits:
            raise RetrievalError(f"the clips of {path} do not fit each other; {RELEARN}")
        examples = ExampleSet(labels, names, arrays["columns"].astype(np.int8), starts, arrays["weights"])
        return cls(examples, _classifiers(arrays))


def _classifiers(arrays: dict[str, np.ndarray]) -> tuple[PlaceClassifier, ...]:
    rows = zip(*(arrays[name] for name in ("mean", "scale", "judges", "offsets")), strict=True)
    return tuple(PlaceClassifier(mean, scale, weights, float(offset)) for mean, scale, weights, offset in rows)
