"""Floor contact of occluded legs, from class templates that are aligned with the track (thesis 6.4.1, 6.4.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.app.stabilise.source_run import SourceRun
from toolkit.body.body import Body
from toolkit.body.sole import FEET, Sole
from toolkit.fitting.priors import ResidualTerm
from toolkit.io.spans import spans
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.priors.expectation import GapContext
from toolkit.retrieval.priors.limb_entries import ENTRIES
from toolkit.retrieval.templates import QuantisedTemplate


def contact_columns(template: QuantisedTemplate, leg: str) -> np.ndarray:
    """Return a bool (K,) mask of the template columns in which the foot of a leg is at rest.

    Both features of the leg are 0, each in a run of at least 5 columns.
    """
    values, _ = template.expanded
    found = np.ones(values.shape[1], dtype=np.bool_)
    # Numbers of the relational features that are 0 while a foot is at rest: foot raised, foot fast.
    features = {"right_leg": (17, 25), "left_leg": (18, 26)}
    for number in features[leg]:
        runs = np.zeros_like(found)
        for span in spans(values[number - 1] == 0):
            runs[span] = span.stop - span.start >= 5
        found &= runs
    return found


def contact_frames(allocation: Allocation, classes: Sequence[MotionClass], leg: str) -> np.ndarray:
    """Return a bool (T,) mask of the labelled frames in which the class template has the foot of `leg` at rest."""
    found = np.zeros(len(allocation.label), dtype=np.bool_)
    for row, motion_class in enumerate(classes):
        labelled = allocation.label == row
        found[labelled] = contact_columns(motion_class.template, leg)[allocation.column[labelled]]
    return found


def contact_terms(source: SourceRun, context: GapContext) -> dict[int, list[ResidualTerm]]:
    """Return the floor terms of each frame in which a leg is occluded and its class has the foot at rest.

    A foot that is visible in part of a contact stays at its median place there.
    """
    found: dict[int, list[ResidualTerm]] = {}
    for leg in FEET:
        sole = Sole.of(source.body, leg)
        for span in spans(contact_frames(context.allocation, context.classes, leg)):
            hidden = context.hidden[leg][span]
            if not hidden.any():
                continue
            visible = np.flatnonzero(~hidden) + span.start
            places = np.array([sole.at(source.body, context.poses[frame]) for frame in visible])
            place = np.median(places, axis=0) if len(visible) else None
            term = floor_term(source.body, leg, source.floor.height, place)
            for frame in (np.flatnonzero(hidden) + span.start).tolist():
                found.setdefault(frame, []).append(term)
    return found


def floor_term(body: Body, leg: str, height: float, place: np.ndarray | None) -> ResidualTerm:
    """Return a term that pulls heel and ball of a foot to the floor and to their place on it.

    Parameters
    ----------
    body : body that is fitted
    leg : `left_leg` or `right_leg`; only its angles change
    height : metres, y of the floor under the foot, level frame
    place : float64 (2, 3), metres, heel and ball at rest (only x and z are used); None if unknown
    """
    sole = Sole.of(body, leg)

    def residuals(pose: np.ndarray) -> np.ndarray:
        points = sole.at(body, pose)
        above = points[:, 1] - height
        return above if place is None else np.concatenate([above, (points - place)[:, [0, 2]].ravel()])

    weight, scale = 1.0, 0.1  # relative to one correspondence; metres of the Geman-McClure weight
    return ResidualTerm(weight, scale, ENTRIES[leg], residuals)
