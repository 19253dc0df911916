"""Place classifiers: the probability that a place is of a class, by feature differences from the nearest example.

A weighted sum of all differences cannot separate a kick with the other leg from a kick by another person. Each class
learns its weights by logistic regression (scikit-learn) on the places found in documents of known truth. A class has
few clips, and the differences are similar in all classes, so each classifier starts from common weights. Not part of
the thesis, whose wildcards only mark the features that vary within a class.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.retrieval.features.relational import FEATURES


@dataclass(frozen=True)
class ClassifierSettings:
    """Settings of the place classifiers.

    Attributes
    ----------
    regularisation : inverse strength of the penalty on the weights of standardised differences; a class has few
        true examples
    usual_cost : cost at even odds without training data (tau of the thesis)
    steepness : slope of the log-odds without training data
    thresholds : candidate probability thresholds
    trust : weight of the common log-odds relative to a single measure, in standard deviations; as `caution` chosen
        on UTD-MHAD, 13 actions against the rest, one, two and three subjects against another
    caution : fraction of the threshold found on held-out people, in log-odds, that is kept, because the final
        classifiers have more people
    """

    regularisation: float = 0.1
    usual_cost: float = 0.13
    steepness: float = 60.0
    thresholds: tuple[float, ...] = (
        0.3,
        0.4,
        0.5,
        0.6,
        0.7,
        0.8,
        0.9,
        0.95,
    )
    trust: float = 3.0
    caution: float = 0.5


SETTINGS = ClassifierSettings()

MEASURES = len(FEATURES) + 2
"""Number of measures: differences of the features, cost in tenths, logarithm of the relative duration."""
COST = len(FEATURES)
"""Row of the cost among the measures."""

Fold = tuple[np.ndarray, np.ndarray]
"""Measures (H, 42) of places, and their correctness (H,)."""


@dataclass(frozen=True, eq=False)
class PlaceClassifier:
    """Logistic regression on standardised measures.

    Attributes
    ----------
    mean, scale : float64 (42,), of the training measures
    weights : float64 (42,)
    offset : offset of the log-odds
    """

    mean: np.ndarray
    scale: np.ndarray
    weights: np.ndarray
    offset: float

    @classmethod
    def learned(cls, measures: np.ndarray, true: np.ndarray, common: np.ndarray | None = None) -> PlaceClassifier:
        """Fit a classifier to measures (H, 42) and their correctness (H,), with balanced weights of both sides.

        With fewer than two correct or two wrong places, the classifier uses the cost alone. The log-odds of the weights
        (42,) `common` to all classes, if given, are one more measure with a weak penalty.
        """
        if not _both_sides(true):
            return cls.of_cost()
        from sklearn.linear_model import LogisticRegression

        mean, scale = _moments(measures)
        known = (measures - mean) / scale
        weights = np.zeros(MEASURES) if common is None else common
        odds = (known * weights).sum(axis=1)
        factor = SETTINGS.trust / max(float(odds.std()), 1e-6)
        fitted = LogisticRegression(C=SETTINGS.regularisation, class_weight="balanced", max_iter=2000)
        fitted.fit(np.column_stack([known, factor * odds]), true)
        *own, shared = fitted.coef_[0]
        return cls(mean, scale, own + shared * factor * weights, float(fitted.intercept_[0]))

    @classmethod
    def of_cost(cls) -> PlaceClassifier:
        """Return a classifier of the cost alone."""
        mean, weights = np.zeros(MEASURES), np.zeros(MEASURES)
        mean[COST], weights[COST] = 10.0 * SETTINGS.usual_cost, -0.1 * SETTINGS.steepness
        return cls(mean, np.ones(MEASURES), weights, 0.0)

    def probability(self, measures: np.ndarray) -> np.ndarray:
        """Return the probability of each row of (H, 42), float64 (H,)."""
        odds = self.offset + (((measures - self.mean) / self.scale) * self.weights).sum(axis=1)
        return 1.0 / (1.0 + np.exp(-np.clip(odds, -500.0, 500.0)))

    def moved(self, threshold: float) -> PlaceClassifier:
        """Return the classifier with its even odds moved towards the probability `threshold`."""
        return replace(self, offset=self.offset - SETTINGS.caution * float(np.log(threshold / (1.0 - threshold))))


def learn_classifiers(folds: Mapping[str, Mapping[int, Fold]], *, cautious: bool) -> dict[str, PlaceClassifier]:
    """Return a classifier for each class, from the places that its examples found in several folds.

    Parameters
    ----------
    folds : per class and fold the measures of places and their correctness
    cautious : move each classifier's even odds towards the best threshold on held-out folds. Of
        `ClassifierSettings.thresholds` the one with the highest F is used, so that a class with many false positives
        gets a higher threshold
    """
    classifiers = _learned_together({label: list(own.values()) for label, own in folds.items()})
    if not cautious:
        return classifiers
    chances: dict[str, list[Fold]] = {label: [] for label in folds}
    for left_out in sorted({fold for own in folds.values() for fold in own}):
        rest = {label: [part for fold, part in own.items() if fold != left_out] for label, own in folds.items()}
        others = _learned_together(rest)
        for label, own in folds.items():
            if left_out in own and rest[label]:
                measures, true = own[left_out]
                chances[label].append((others[label].probability(measures), true))
    return {label: classifier.moved(_best_threshold(chances[label])) for label, classifier in classifiers.items()}


def _learned_together(parts: Mapping[str, Sequence[Fold]]) -> dict[str, PlaceClassifier]:
    """Return classifiers that start from the weights common to all classes."""
    taught = {label: joined(own) for label, own in parts.items() if own}
    common = _common(list(taught.values()))
    return {
        label: PlaceClassifier.learned(*taught[label], common) if label in taught else PlaceClassifier.of_cost()
        for label in parts
    }


def _common(classes: Sequence[Fold]) -> np.ndarray | None:
    """Return the weights (42,) common to all classes, None without correct and wrong places.

    Measures are standardised for each class; a class counts by its number of places.
    """
    taught = [(measures, true) for measures, true in classes if _both_sides(true)]
    if not taught:
        return None
    from sklearn.linear_model import LogisticRegression

    known, right, counts = [], [], []
    for measures, true in taught:
        mean, scale = _moments(measures)
        known.append((measures - mean) / scale)
        right.append(true)
        counts.append(0.5 * len(true) / np.where(true, np.count_nonzero(true), np.count_nonzero(~true)))
    fitted = LogisticRegression(C=SETTINGS.regularisation, max_iter=2000)
    fitted.fit(np.concatenate(known), np.concatenate(right), sample_weight=np.concatenate(counts))
    return np.asarray(fitted.coef_[0], dtype=np.float64)


def _best_threshold(chances: Sequence[Fold]) -> float:
    """Return the value of `ClassifierSettings.thresholds` with the highest F over places, the smallest of equals; 0.5
    without places.
    """
    if not chances:
        return 0.5
    probability, true = joined(chances)
    found = probability > np.array(SETTINGS.thresholds)[:, None]
    scores = 2.0 * (found & true).sum(axis=1) / np.maximum(found.sum(axis=1) + true.sum(), 1)
    return SETTINGS.thresholds[int(scores.argmax())]


def _both_sides(true: np.ndarray) -> bool:
    return bool(min(np.count_nonzero(true), np.count_nonzero(~true)) >= 2)


def _moments(measures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return measures.mean(axis=0), np.maximum(measures.std(axis=0), 1e-6)


def joined(parts: Sequence[Fold]) -> Fold:
    """Concatenate several folds."""
    return np.concatenate([first for first, _ in parts]), np.concatenate([true for _, true in parts])
