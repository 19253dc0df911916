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

from toolkit.retrieval.annotation.annotator import HIT_THRESHOLD
from toolkit.retrieval.features.relational import FEATURES

REGULARISATION = 0.1
"""Inverse strength of the penalty on the weights of standardised differences; a class has few true examples."""
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
        # The common log-odds weigh as much as three measures; as the caution of `moved` chosen on UTD-MHAD, 13 actions
        # against the rest, one, two and three subjects against another.
        factor = 3.0 / max(float(odds.std()), 1e-6)
        fitted = LogisticRegression(C=REGULARISATION, class_weight="balanced", max_iter=2000)
        fitted.fit(np.column_stack([known, factor * odds]), true)
        *own, shared = fitted.coef_[0]
        return cls(mean, scale, own + shared * factor * weights, float(fitted.intercept_[0]))

    @classmethod
    def of_cost(cls) -> PlaceClassifier:
        """Return a classifier of the cost alone."""
        mean, weights = np.zeros(MEASURES), np.zeros(MEASURES)
        steepness = 60.0  # slope of the log-odds over the cost; even odds are at the thesis's tau
        mean[COST], weights[COST] = 10.0 * HIT_THRESHOLD, -0.1 * steepness
        return cls(mean, np.ones(MEASURES), weights, 0.0)

    def probability(self, measures: np.ndarray) -> np.ndarray:
        """Return the probability of each row of (H, 42), float64 (H,)."""
        odds = self.offset + (((measures - self.mean) / self.scale) * self.weights).sum(axis=1)
        return 1.0 / (1.0 + np.exp(-np.clip(odds, -500.0, 500.0)))

    def moved(self, threshold: float) -> PlaceClassifier:
        """Return the classifier with its even odds moved towards the probability `threshold`."""
        # Only half of the way in log-odds, because the final classifiers have more people than the held-out ones.
        return replace(self, offset=self.offset - 0.5 * float(np.log(threshold / (1.0 - threshold))))


def learn_classifiers(folds: Mapping[str, Mapping[int, Fold]], *, cautious: bool) -> dict[str, PlaceClassifier]:
    """Return a classifier for each class, from the places that its examples found in several folds.

    Parameters
    ----------
    folds : per class and fold the measures of places and their correctness
    cautious : move each classifier's even odds towards the best threshold on held-out folds, so that a
        class with many false positives gets a higher threshold
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
    fitted = LogisticRegression(C=REGULARISATION, max_iter=2000)
    fitted.fit(np.concatenate(known), np.concatenate(right), sample_weight=np.concatenate(counts))
    return np.asarray(fitted.coef_[0], dtype=np.float64)


def _best_threshold(chances: Sequence[Fold]) -> float:
    """Return the threshold with the highest F over places, the smallest of equals; 0.5 without places."""
    if not chances:
        return 0.5
    probability, true = joined(chances)
    thresholds = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
    found = probability > np.array(thresholds)[:, None]
    scores = 2.0 * (found & true).sum(axis=1) / np.maximum(found.sum(axis=1) + true.sum(), 1)
    return thresholds[int(scores.argmax())]


def _both_sides(true: np.ndarray) -> bool:
    return bool(min(np.count_nonzero(true), np.count_nonzero(~true)) >= 2)


def _moments(measures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return measures.mean(axis=0), np.maximum(measures.std(axis=0), 1e-6)


def joined(parts: Sequence[Fold]) -> Fold:
    """Concatenate several folds."""
    return np.concatenate([first for first, _ in parts]), np.concatenate([true for _, true in parts])
