"""Judges: whether what looks like a class is one, from how it differs from the nearest example, feature by feature.

A sum of all differences, however weighted, cannot tell a kick with the other leg from a kick by somebody else. Which
differences matter is learned per class, by logistic regression (scikit-learn) on what the examples found in documents
whose truth is known. This goes beyond the thesis, whose wildcards say only which features vary within a class.
"""

from __future__ import annotations

from collections.abc import Sequence
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
    def learned(cls, measures: np.ndarray, true: np.ndarray) -> Judge:
        """From measures (H, 42) and whether each was right (H,); both sides count alike, however many they are.

        With fewer than two right or two wrong ones a judge looks at the cost alone.
        """
        if min(np.count_nonzero(true), np.count_nonzero(~true)) < 2:
            return cls.of_cost()
        from sklearn.linear_model import LogisticRegression

        mean, scale = measures.mean(axis=0), np.maximum(measures.std(axis=0), 1e-6)
        fitted = LogisticRegression(C=REGULARISATION, class_weight="balanced", max_iter=2000)
        fitted.fit((measures - mean) / scale, true)
        return cls(mean, scale, fitted.coef_[0].astype(np.float64), float(fitted.intercept_[0]))

    @classmethod
    def of_cost(cls, usual: float = USUAL_COST) -> Judge:
        """A judge that looks at the cost alone."""
        mean, weights = np.zeros(MEASURES), np.zeros(MEASURES)
        mean[COST], weights[COST] = 10.0 * usual, -0.1 * STEEPNESS
        return cls(mean, np.ones(MEASURES), weights, 0.0)

    @classmethod
    def cautious(cls, turns: Sequence[tuple[np.ndarray, np.ndarray]]) -> Judge:
        """Learned from measures and rightness in several turns, and undecided where that served best in turns unseen.

        Every turn is judged by what was learned from the others. Of `THRESHOLDS` on the probability the one with the
        best F becomes the judge's even odds, so that a class that is easily mistaken is judged with more care.
        """
        if not turns:
            return cls.of_cost()
        measures, true = (np.concatenate(part) for part in zip(*turns, strict=True))
        judge = cls.learned(measures, true)
        if len(turns) < 2:
            return judge
        chances = np.concatenate([
            cls.learned(*(np.concatenate(part) for part in zip(*[*turns[:k], *turns[k + 1 :]], strict=True)))
            .probability(turns[k][0])
            for k in range(len(turns))
        ])  # fmt: skip
        found = chances > np.array(THRESHOLDS)[:, None]
        scores = 2.0 * (found & true).sum(axis=1) / np.maximum(found.sum(axis=1) + true.sum(), 1)
        best = THRESHOLDS[int(scores.argmax())]
        return replace(judge, offset=judge.offset - float(np.log(best / (1.0 - best))))

    def probability(self, measures: np.ndarray) -> np.ndarray:
        """How sure the judge is that each of (H, 42) is right, float64 (H,); from 0.5 on it says yes."""
        odds = self.offset + (((measures - self.mean) / self.scale) * self.weights).sum(axis=1)
        return 1.0 / (1.0 + np.exp(-np.clip(odds, -500.0, 500.0)))
