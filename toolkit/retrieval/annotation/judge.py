"""Judges: whether what looks like a class is one, from how it differs from the nearest example, feature by feature.

A sum of all differences, however weighted, cannot tell a kick with the other leg from a kick by another person. Which
differences matter is learned per class, by logistic regression (scikit-learn) on what the examples found in documents
whose truth is known. A class has few clips, and what tells right from wrong is much the same in all classes: a judge
starts from what all of them show together, and from there learns its own. This goes beyond the thesis, whose wildcards
say only which features vary within a class.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.retrieval.features.relational import FEATURES

REGULARISATION = 0.1
"""Inverse strength of the penalty on the weights of standardised differences: a class has few true examples."""
USUAL_COST, STEEPNESS = 0.13, 60.0
"""Where nothing could be learned: the cost at which a judge is undecided (the thesis's tau), and how sure it gets."""
THRESHOLDS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
"""Probabilities from which on a judge may say yes."""
MEASURES = len(FEATURES) + 2
"""Differences of the features, cost in tenths, logarithm of the relative duration."""
COST = len(FEATURES)
"""Which measure is the cost."""
TRUST = 3.0
"""How much more a judge may lean on what all classes show than on any measure of its own: standard deviations of the
common log odds. This and `CAUTION` were chosen on UTD-MHAD, 13 of its actions against the rest, one, two and three
subjects against another."""
CAUTION = 0.5
"""Share of the threshold found on people left out, in log odds, that is kept: there the judges knew a person less."""

Turn = tuple[np.ndarray, np.ndarray]
"""Measures (H, 42) of places, and whether each is right (H,)."""


@dataclass(frozen=True, eq=False)
class Judge:
    """A logistic regression on standardised measures.

    Attributes
    ----------
    mean, scale : float64 (42,), of the measures that it was learned from
    weights : float64 (42,)
    offset : of the log odds
    """

    mean: np.ndarray
    scale: np.ndarray
    weights: np.ndarray
    offset: float

    @classmethod
    def learned(cls, measures: np.ndarray, true: np.ndarray, common: np.ndarray | None = None) -> Judge:
        """From measures (H, 42) and whether each was right (H,); both sides count alike, however many they are.

        With fewer than two right or two wrong ones a judge looks at the cost alone. The log odds that the weights (42,)
        `common` to all classes give, if there are any, are one more measure, which the penalty hardly holds back.
        """
        if not _both_sides(true):
            return cls.of_cost()
        from sklearn.linear_model import LogisticRegression

        mean, scale = _moments(measures)
        known = (measures - mean) / scale
        weights = np.zeros(MEASURES) if common is None else common
        odds = (known * weights).sum(axis=1)
        factor = TRUST / max(float(odds.std()), 1e-6)
        fitted = LogisticRegression(C=REGULARISATION, class_weight="balanced", max_iter=2000)
        fitted.fit(np.column_stack([known, factor * odds]), true)
        *own, shared = fitted.coef_[0]
        return cls(mean, scale, own + shared * factor * weights, float(fitted.intercept_[0]))

    @classmethod
    def of_cost(cls) -> Judge:
        """A judge that looks at the cost alone."""
        mean, weights = np.zeros(MEASURES), np.zeros(MEASURES)
        mean[COST], weights[COST] = 10.0 * USUAL_COST, -0.1 * STEEPNESS
        return cls(mean, np.ones(MEASURES), weights, 0.0)

    def probability(self, measures: np.ndarray) -> np.ndarray:
        """How sure the judge is that each of (H, 42) is right, float64 (H,); from 0.5 on it says yes."""
        odds = self.offset + (((measures - self.mean) / self.scale) * self.weights).sum(axis=1)
        return 1.0 / (1.0 + np.exp(-np.clip(odds, -500.0, 500.0)))

    def moved(self, threshold: float) -> Judge:
        """The same judge with even odds nearer to where it gave a probability of `threshold`."""
        return replace(self, offset=self.offset - CAUTION * float(np.log(threshold / (1.0 - threshold))))


def learn_judges(turns: Mapping[str, Mapping[int, Turn]], *, cautious: bool) -> dict[str, Judge]:
    """A judge for each class, from what its examples found in several turns.

    Parameters
    ----------
    turns : per class and turn the measures of places and whether each is right
    cautious : move each judge's even odds towards where they served best in turns unseen, every turn being judged by
        what was learned from the others. Of `THRESHOLDS` on the probability that with the best F is taken, so that a
        class that is easily mistaken is judged with more care
    """
    judges = _learned_together({label: list(own.values()) for label, own in turns.items()})
    if not cautious:
        return judges
    chances: dict[str, list[Turn]] = {label: [] for label in turns}
    for left_out in sorted({turn for own in turns.values() for turn in own}):
        rest = {label: [part for turn, part in own.items() if turn != left_out] for label, own in turns.items()}
        others = _learned_together(rest)
        for label, own in turns.items():
            if left_out in own and rest[label]:
                measures, true = own[left_out]
                chances[label].append((others[label].probability(measures), true))
    return {label: judge.moved(_best_threshold(chances[label])) for label, judge in judges.items()}


def _learned_together(parts: Mapping[str, Sequence[Turn]]) -> dict[str, Judge]:
    """Judges that start from what all classes show."""
    taught = {label: joined(own) for label, own in parts.items() if own}
    common = _common(list(taught.values()))
    return {label: Judge.learned(*taught[label], common) if label in taught else Judge.of_cost() for label in parts}


def _common(classes: Sequence[Turn]) -> np.ndarray | None:
    """Weights (42,) of what all classes show, measures standardised class by class, each class counting as much as it
    has places; None if none has right and wrong ones."""
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


def _best_threshold(chances: Sequence[Turn]) -> float:
    """The one of `THRESHOLDS` with the best F over places, the smallest among equals; 0.5 where there are none."""
    if not chances:
        return 0.5
    probability, true = joined(chances)
    found = probability > np.array(THRESHOLDS)[:, None]
    scores = 2.0 * (found & true).sum(axis=1) / np.maximum(found.sum(axis=1) + true.sum(), 1)
    return THRESHOLDS[int(scores.argmax())]


def _both_sides(true: np.ndarray) -> bool:
    return bool(min(np.count_nonzero(true), np.count_nonzero(~true)) >= 2)


def _moments(measures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return measures.mean(axis=0), np.maximum(measures.std(axis=0), 1e-6)


def joined(parts: Sequence[Turn]) -> Turn:
    """Several turns as one."""
    return np.concatenate([first for first, _ in parts]), np.concatenate([true for _, true in parts])
