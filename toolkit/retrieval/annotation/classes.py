"""Motion classes learned from labelled clips, and the file that keeps them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from toolkit import skeleton
from toolkit.archives import Column, check_columns, load_archive, save_archive
from toolkit.errors import RetrievalError
from toolkit.plain import parse_json
from toolkit.retrieval.annotation.annotator import THRESHOLD, MotionClass
from toolkit.retrieval.annotation.class_motion import ANGLE_COUNT, ClassMotion, Example, learn_motion
from toolkit.retrieval.features.relational import FEATURES, FeatureMatrix, feature_fingerprint
from toolkit.retrieval.templates import WILDCARD, MotionTemplate, QuantisedTemplate
from toolkit.typed import TypedReader

CLASSES_VERSION = 2
OLDER_VERSIONS = (1,)
"""Versions that are read as well; version 1 has no motions."""
RELEARN = "learn it again from labelled clips"
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
    threshold: float = THRESHOLD,
) -> list[MotionClass]:
    """One motion class per label from cut clips, a single template each (thesis 2.3), sorted by label.

    Parameters
    ----------
    clips : label -> feature matrices of its clips
    poses : label -> poses (T, P) of the same clips, one for each column; a label that has them knows how it moves
    threshold : `tau`, costs at or above it are no hits

    Raises
    ------
    RetrievalError
        No labels, or a label without clips.
    """
    if not clips:
        raise RetrievalError("there are no labelled clips to learn classes from; give at least one")
    empty = sorted(label for label, matrices in clips.items() if not matrices)
    if empty:
        raise RetrievalError(f"class {empty[0]!r} has no clips; give it at least one or leave it out")
    classes = []
    for label in sorted(clips):
        template = MotionTemplate.of(clips[label])
        motions: tuple[ClassMotion, ...] = ()
        if poses is not None and label in poses:
            motions = (learn_motion(template, [*map(Example, clips[label], poses[label])]),)
        classes.append(MotionClass(label, (template.quantised(label),), threshold, motions))
    return classes


def save_classes(path: str | Path, classes: Sequence[MotionClass]) -> None:
    """Write motion classes as one NPZ file, whole or not at all, with the fingerprint of the features."""
    arrays: dict[str, np.ndarray] = {}
    table = []
    for number, motion_class in enumerate(classes):
        for part, template in enumerate(motion_class.templates):
            arrays[f"values_{number}_{part}"] = template.values
            arrays[f"weights_{number}_{part}"] = template.weights
        for part, motion in enumerate(motion_class.motions):
            arrays |= {f"{name}_{number}_{part}": getattr(motion, name) for name in _MOTION}
        names = [template.name for template in motion_class.templates]
        table.append({"label": motion_class.label, "threshold": motion_class.threshold, "templates": names})
    header = {
        "version": CLASSES_VERSION, "features": feature_fingerprint(), "body": skeleton.fingerprint(), "classes": table
    }  # fmt: skip
    save_archive(path, {"header": np.array(json.dumps(header)), **arrays})


def load_classes(path: str | Path) -> list[MotionClass]:
    """Read what `save_classes` wrote.

    Raises
    ------
    RetrievalError
        The file is missing, no class file, of another version, or made with other features or another body.
    """
    arrays = load_archive(path, RetrievalError, RELEARN)
    if "header" not in arrays:
        raise RetrievalError(f"{path} is not a class file; learn one from labelled clips")
    header = parse_json(str(arrays["header"]), f"the header of {path}", RetrievalError, RELEARN)
    reader = TypedReader(RetrievalError, RELEARN, loose=True, source=f"the header of {path}")
    known = reader.read(header, _Header, "")
    if known.version not in (CLASSES_VERSION, *OLDER_VERSIONS):
        raise RetrievalError(f"{path} has classes of version {known.version}, not {CLASSES_VERSION}; learn them again")
    if known.classes is None:
        raise RetrievalError(f"{path} holds no motion templates; make them with `depthmocap learn --templates`")
    if known.features != feature_fingerprint():
        raise RetrievalError(
            f"{path} was learned with other features ({known.features}, here {feature_fingerprint()}); learn it again"
        )
    if known.body != skeleton.fingerprint():
        raise RetrievalError(
            f"{path} was learned with another body ({known.body}, here {skeleton.fingerprint()}); learn it again"
        )
    try:
        return [_stored_class(entry, number, arrays) for number, entry in enumerate(known.classes)]
    except KeyError as error:
        raise RetrievalError(f"{path} lacks {error}; {RELEARN}") from error


@dataclass(frozen=True)
class _Entry:
    """One class as a file's header says it."""

    label: str
    templates: tuple[str, ...]
    threshold: float


@dataclass(frozen=True)
class _Header:
    """What a file says of itself; older ones name no body."""

    version: int
    features: str
    classes: tuple[_Entry, ...] | None = None
    body: str = field(default_factory=skeleton.fingerprint)


def _stored_class(entry: _Entry, number: int, arrays: dict[str, np.ndarray]) -> MotionClass:
    templates, motions = [], []
    for part, name in enumerate(entry.templates):
        values, weights = arrays[f"values_{number}_{part}"], arrays[f"weights_{number}_{part}"]
        check_columns({"values": values, "weights": weights}, _TEMPLATE, RetrievalError, f"class {number}", RELEARN)
        templates.append(QuantisedTemplate(name, values, weights))
        if f"mean_{number}_{part}" in arrays:
            parts = {key: arrays[f"{key}_{number}_{part}"] for key in _MOTION}
            check_columns(parts, _MOTION, RetrievalError, f"class {number}", RELEARN)
            motions.append(ClassMotion(parts["mean"], parts["spread"], parts["covariance"], float(parts["memory"])))
    return MotionClass(entry.label, tuple(templates), entry.threshold, tuple(motions))
