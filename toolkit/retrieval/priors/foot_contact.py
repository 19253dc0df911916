"""Foot contact of occluded legs, from class templates aligned with a track (thesis 6.4.1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.io.spans import spans
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.templates import QuantisedTemplate

CONTACT_FEATURES: dict[str, tuple[int, int]] = {"right_leg": (17, 25), "left_leg": (18, 26)}
"""Numbers of the relational features that are 0 while a leg's foot is at rest: foot raised, foot fast."""


def contact_columns(template: QuantisedTemplate, leg: str, shortest: int = 5) -> np.ndarray:
    """Return a bool (K,) mask of the template columns in which the foot of a leg is at rest.

    Both features of the leg are 0, each in a run of at least `shortest` columns.
    """
    values, _ = template.expanded
    found = np.ones(values.shape[1], dtype=np.bool_)
    for number in CONTACT_FEATURES[leg]:
        runs = np.zeros_like(found)
        for span in spans(values[number - 1] == 0):
            runs[span] = span.stop - span.start >= shortest
        found &= runs
    return found


def contact_frames(allocation: Allocation, classes: Sequence[MotionClass], leg: str) -> np.ndarray:
    """Return a bool (T,) mask of the labelled frames in which the class template has the foot of `leg` at rest."""
    found = np.zeros(len(allocation.label), dtype=np.bool_)
    for row, motion_class in enumerate(classes):
        labelled = allocation.label == row
        found[labelled] = contact_columns(motion_class.template, leg)[allocation.column[labelled]]
    return found
