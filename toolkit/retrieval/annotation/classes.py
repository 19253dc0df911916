"""Motion classes learned from labelled clips, and their file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.io.archives import Column, check_columns
from toolkit.io.errors import RetrievalError
from toolkit.retrieval.annotation.annotator import HIT_THRESHOLD, MotionClass
from toolkit.retrieval.annotation.class_motion import ANGLE_COUNT, ClassMotion, Example, learn_motion
from toolkit.retrieval.features.relational import FEATURES, FeatureMatrix
from toolkit.retrieval.learning.queries import check_classes
from toolkit.retrieval.stored_arrays import StoredKind
from toolkit.retrieval.templates import WILDCARD, MotionTemplate, QuantisedTemplate

RELEARN = "learn it with `depthmocap learn --templates`"
KIND = StoredKind("a file of motion templates", 3, RELEARN, {"values_0": Column("i"), "weights_0": Column("f")})
_TEMPLATE = {
    "values": Column("i", (len(FEATURES), "columns"), WILDCARD, 1),
    "weights": Column("f", ("columns",), 0, 1e6),
}
_MOTION = {
    "mean": Column("f", ("expanded", ANGLE_COUNT), -10, 10),
    "spread": Column("f", ("expanded", ANGLE_COUNT), 1e-6, 10),
    "covariance": Column("f", (ANGLE_COUNT, ANGLE_COUNT), -100, 100),
    "memory": Column("f", (), 1e-3, 1e3),
}


def learn_classes(
    clips: Mapping[str, Sequence[FeatureMatrix]],
    *,
    poses: Mapping[str, Sequence[np.ndarray]] | None = None,
    threshold: float = HIT_THRESHOLD,
) -> list[MotionClass]:
    """Return one motion class per label from cut clips (thesis 2.3), sorted by label.

    Parameters
    ----------
    clips : label -> feature matrices of its clips
    poses : label -> poses (T, P) of the same clips, one for each column, for the mean motion of the class
    threshold : `tau`, costs at or above it are no hits

    Raises
    ------
    RetrievalError
        There are no labels, or a label has no clips.
    """
    check_classes(clips)
    classes = []
    for label in sorted(clips):
        template = MotionTemplate.of(clips[label])
        motion = None
        if poses is not None and label in poses:
            motion = learn_motion(template, [*map(Example, clips[label], poses[label])])
        classes.append(MotionClass(label, template.quantised(), threshold, motion))
    return classes


@dataclass(frozen=True)
class _Entry:
    """Header entry of one class."""

    label: str
    threshold: float


@dataclass(frozen=True)
class _Header:
    """Header of a class file."""

    body: str
    classes: tuple[_Entry, ...]


def save_classes(path: str | Path, classes: Sequence[MotionClass]) -> None:
    """Write motion classes as one NPZ file, atomically, with the fingerprint of the features."""
    arrays: dict[str, np.ndarray] = {}
    for number, motion_class in enumerate(classes):
        arrays |= {f"{name}_{number}": getattr(motion_class.template, name) for name in _TEMPLATE}
        if motion_class.motion is not None:
            arrays |= {f"{name}_{number}": getattr(motion_class.motion, name) for name in _MOTION}
    table = [{"label": c.label, "threshold": c.threshold} for c in classes]
    KIND.save(path, {"body": skeleton.fingerprint(), "classes": table}, arrays)


def load_classes(path: str | Path) -> list[MotionClass]:
    """Read a file of `save_classes`.

    Raises
    ------
    RetrievalError
        The file is missing, no class file, of another version, or made with other features or another body.
    """
    header, arrays = KIND.load(path, _Header)
    if header.body != skeleton.fingerprint():
        raise RetrievalError(
            f"{path} was learned with another body ({header.body}, here {skeleton.fingerprint()}); {RELEARN}"
        )
    try:
        return [_stored_class(entry, number, arrays) for number, entry in enumerate(header.classes)]
    except KeyError as error:
        raise RetrievalError(f"{path} lacks {error}; {RELEARN}") from error


def _stored_class(entry: _Entry, number: int, arrays: dict[str, np.ndarray]) -> MotionClass:
    where = f"class {entry.label!r}"
    values, weights = (arrays[f"{name}_{number}"] for name in _TEMPLATE)
    check_columns({"values": values, "weights": weights}, _TEMPLATE, RetrievalError, where, RELEARN)
    motion = None
    if f"mean_{number}" in arrays:
        parts = {name: arrays[f"{name}_{number}"] for name in _MOTION}
        check_columns(parts, _MOTION, RetrievalError, where, RELEARN)
        motion = ClassMotion(parts["mean"], parts["spread"], parts["covariance"], float(parts["memory"]))
    return MotionClass(entry.label, QuantisedTemplate(values, weights), entry.threshold, motion)
