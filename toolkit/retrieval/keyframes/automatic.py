"""Keyframes chosen from a template or from one example without training (the authors' automatic choice of 2006)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.errors import RetrievalError, SettingsError
from toolkit.retrieval.features.relational import FEATURE_SETS, FEATURES, FeatureMatrix
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery, keyframes_of_column
from toolkit.retrieval.templates.quantised import WILDCARD, QuantisedTemplate

FADED_SHARE = 0.2
"""Share of the columns at each end over which scores fade out."""


@dataclass(frozen=True)
class ChoiceSettings:
    """Settings of the automatic choice, per feature set.

    Attributes
    ----------
    least_score : columns that score less are no keyframes
    most : largest number of keyframes per set
    apart : columns blanked around a keyframe, then on to the next valley of the score
    steady : an entry counts only if it stays the same for this many columns before and behind
    stiffness : stiffness of every gap of the query
    """

    least_score: float = 0.9
    most: int = 2
    apart: int = 5
    steady: int = 1
    stiffness: float = 0.5

    def __post_init__(self) -> None:
        if self.most < 1 or self.apart < 0 or self.steady < 1 or not 0.0 <= self.stiffness <= 1.0:
            raise SettingsError(
                f"most {self.most}, apart {self.apart}, steady {self.steady}, stiffness {self.stiffness} choose "
                "no keyframes; give at least 1, 0, 1, and 0 to 1"
            )


def template_of(example: FeatureMatrix) -> QuantisedTemplate:
    """One example as a template without wildcards."""
    return QuantisedTemplate(example.name, example.values.astype(np.int8), np.ones(len(example)))


def choose_query(template: QuantisedTemplate, settings: ChoiceSettings, label: str = "") -> KeyframeQuery:
    """A query of the columns that say most.

    In each set a column scores (2 ones + zeros) / features of the set, over the entries that are steady around it.
    Scores fade towards both ends of the template, where motions of a class differ most.

    Raises
    ------
    RetrievalError
        No column of any set scores enough, as in a template of wildcards.
    """
    values = steady_entries(template.values, settings.steady)
    placed: list[tuple[int, tuple[Keyframe, ...]]] = []
    for rows in FEATURE_SETS.values():
        part = values[rows]
        scores = (2.0 * (part == 1).sum(axis=0) + (part == 0).sum(axis=0)) / len(rows) * _fade(len(template))
        for n in _best_columns(scores, settings):
            column = np.full(len(FEATURES), WILDCARD, np.int8)
            column[rows] = part[:, n]
            placed.append((n, keyframes_of_column(column)))
    if not placed:
        raise RetrievalError(
            f"no column of {template.name!r} says enough for a keyframe (least score {settings.least_score}); "
            "choose another stretch or a lower score"
        )
    return KeyframeQuery.from_positions(placed, len(template), settings.stiffness, label)


def steady_entries(values: np.ndarray, reach: int) -> np.ndarray:
    """Entries int8 (40, N) that keep their value `reach` columns before and behind; others become wildcards."""
    padded = np.pad(values, [(0, 0), (reach, reach)], mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=1)
    return np.where((around == values[..., None]).all(axis=-1), values, WILDCARD)


def _fade(length: int) -> np.ndarray:
    """Window (N,): 1 in the middle, half a Hann window over the first and the last fifth."""
    ends = int(round(FADED_SHARE * length))
    rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(ends) + 1) / (ends + 1))
    window = np.ones(length)
    window[:ends] = rise
    window[length - ends :] = rise[::-1]
    return window


def _best_columns(scores: np.ndarray, settings: ChoiceSettings) -> list[int]:
    """Columns of highest score, each blanking its surroundings as far as the next valley, at least `apart` columns."""
    scores = scores.copy()
    chosen: list[int] = []
    while len(chosen) < settings.most and scores.max() >= settings.least_score:
        n = int(scores.argmax())
        chosen.append(n)
        first, last = max(n - settings.apart, 0), min(n + settings.apart, len(scores) - 1)
        while first > 0 and scores[first - 1] <= scores[first]:
            first -= 1
        while last < len(scores) - 1 and scores[last + 1] <= scores[last]:
            last += 1
        scores[first : last + 1] = 0.0
    return chosen
