"""Counterexamples from motions of unknown content: what looks much less like a class than its own clips do.

For a person who has no motions that are known to hold none of the classes. This goes beyond the thesis.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from toolkit.retrieval.annotation.judge import COST, Turn

UNLIKE = 1.15
"""What costs more than this many times the dearest right place is none: above it there was hardly a true motion, and
with more (1.3, 1.5) fewer false ones are left to learn from. Chosen on HDM05 actors bd and bk, each taught by the other
alone."""


def with_unlike(turns: Mapping[int, Turn], proposed: Mapping[int, np.ndarray]) -> dict[int, Turn]:
    """Each turn with the places in unknown motions that are too unlike its class to be of it.

    Parameters
    ----------
    turns : what examples found in documents of known truth
    proposed : per turn the measures (P, 42) of what the same examples found in unknown motions
    """
    costs = np.concatenate([measures[true, COST] for measures, true in turns.values()]) if turns else np.empty(0)
    if not len(costs) or not proposed:
        return dict(turns)
    grown = {}
    for turn, (measures, true) in turns.items():
        far = proposed[turn][proposed[turn][:, COST] > UNLIKE * costs.max()]
        grown[turn] = np.concatenate([measures, far]), np.append(true, np.zeros(len(far), dtype=bool))
    return grown
