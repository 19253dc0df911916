"""Fit the confidence of joints: write the regressions of `toolkit/fitting/assets/confidence.json`.

    python -m training.fit_confidence [--every 2] [--takes 1]

Tracks the training recordings: UTD-MHAD (people 1 and 3), MSR Action3D (1, 2 and 3), and `--takes` recordings of each
group of the clean suite and of the scenes (tuning split). `--every N` takes every N-th recording of each real person.
`depthmocap bench confidence judge` measures the result on other people, see `docs/confidence.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from benchmarks.confidence import Rows, distances, files_of, offsets_of, rows_of, sources
from tests.support.suite import WORK
from toolkit.body import skeleton
from toolkit.database import DEFAULT_DATABASE
from toolkit.database.database import PoseDatabase
from toolkit.fitting import joint_confidence as model
from toolkit.fitting.joint_confidence import FEATURES, WITHOUT_NETWORK, JointConfidence
from toolkit.io.files import save_json
from toolkit.landmarks.joint_network import RELIABLE_WITHIN
from toolkit.trackers.hybrid.tracker import HybridTracker

PEOPLE = {"utd_mhad": "13", "msr_action3d": "123"}
"""Training people of each data set, by the numbers in the names of their files."""
WEIGHTS = {"films": 0.7, "photographs": 0.2, "simulated": 0.1}
"""Weight of all joints of a kind together: the confidence is for real people, and photographs have uncovered limbs."""
REGULARISATION = 10.0
"""Inverse strength of the L2 penalty of the regressions, whose inputs lie in [0, 1]."""
SIGNS = tuple(1 if name in ("support", "observed", "precision") else -1 for name in FEATURES)
"""Direction in which each input changes the odds; the others raise doubt."""


class WatchedConfidence(JointConfidence):
    """Regressions that keep the inputs of each row, by the confidence that they returned for it.

    Attributes
    ----------
    inputs : bytes of a float32 (20,) confidence -> float64 (20, 9): features and distance between both passes
    """

    def __init__(self, content: dict[str, Any]) -> None:
        super().__init__(content)
        self.inputs: dict[bytes, np.ndarray] = {}

    def of(self, features: np.ndarray) -> np.ndarray:
        """See `JointConfidence.of`."""
        confidence = super().of(features)
        unknown = np.full((len(features), 1), np.nan)
        self.inputs[confidence.astype(np.float32).tobytes()] = np.concatenate([features, unknown], axis=1)
        return confidence

    def of_both(self, confidence: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """See `JointConfidence.of_both`."""
        both = super().of_both(confidence, apart)
        own = self.inputs[confidence.astype(np.float32).tobytes()].copy()
        own[:, -1] = apart
        self.inputs[both.astype(np.float32).tobytes()] = own
        return both


class WatchedTracker(HybridTracker):
    """Hybrid tracker with the default settings and database, and watched regressions."""

    def __init__(self) -> None:
        self.watched = WatchedConfidence(model.joint_confidence().content)
        super().__init__(PoseDatabase.load(DEFAULT_DATABASE), database_path=str(DEFAULT_DATABASE))

    @property
    def regressions(self) -> JointConfidence:
        """See `SearchingTracker.regressions`."""
        return self.watched


def tracked_inputs(every: int, takes: int, work: Path) -> list[tuple[Rows, np.ndarray]]:
    """Track all training recordings; return the rows of each person with their inputs, float64 (F, 20, 9)."""
    tracker, found = WatchedTracker(), []
    for source, file in files_of("tune", PEOPLE, every, takes):
        tracker.watched.inputs.clear()
        for rows in rows_of(tracker, source, file, work):
            found.append((rows, np.stack([tracker.watched.inputs[row.tobytes()] for row in rows.confidence])))
    return found


def kind_of(rows: Rows) -> str:
    """Return the entry of `WEIGHTS` of some rows."""
    return rows.source if rows.source in WEIGHTS else "films"


def fitted(inputs: np.ndarray, right: np.ndarray, weights: np.ndarray, signs: Sequence[int]) -> np.ndarray:
    """Return intercept and coefficients of a logistic regression, each coefficient with its sign or zero."""

    columns = np.concatenate([np.ones((len(inputs), 1)), inputs], axis=1)
    sides = np.where(right, 1.0, -1.0)

    def loss(coefficients: np.ndarray) -> tuple[float, np.ndarray]:
        odds = sides * (columns @ coefficients)
        slopes = -weights * sides / (1.0 + np.exp(np.clip(odds, -500.0, 500.0)))
        penalty = coefficients * ([0.0] + [1.0] * len(signs)) / REGULARISATION
        total = float(weights @ np.logaddexp(0.0, -odds) + 0.5 * penalty @ coefficients)
        return total, columns.T @ slopes + penalty

    bounds = [(None, None), *((0.0, None) if sign > 0 else (None, 0.0) for sign in signs)]
    return np.asarray(minimize(loss, np.zeros(len(bounds)), jac=True, method="L-BFGS-B", bounds=bounds).x)


def regressions(tracked: Sequence[tuple[Rows, np.ndarray]]) -> dict[str, Any]:
    """Fit all regressions: the content of `joint_confidence.ASSET`."""
    rows, inputs = [r for r, _ in tracked], np.concatenate([own for _, own in tracked])
    offsets = offsets_of(rows)
    counts = {kind: sum(len(r.apart) for r in rows if kind_of(r) == kind) for kind in WEIGHTS}
    total = sum(counts.values())
    weight = np.concatenate([np.full(len(r.apart), WEIGHTS[k] * total / counts[k]) for r in rows if (k := kind_of(r))])
    right = np.concatenate([distances(r, offsets) <= RELIABLE_WITHIN for r in rows])
    content: dict[str, Any] = {"network": {}, "depth": {}, "passes": {}}
    for group in model.GROUPS:
        columns = [k for k, name in enumerate(skeleton.REPORTED) if model.group_of(name) == group]
        own, labels = inputs[:, columns].reshape(-1, inputs.shape[2]), right[:, columns].ravel()
        weights = np.repeat(weight, len(columns))
        features, apart = own[:, : len(FEATURES)], own[:, -1]
        for name, count in (("network", len(FEATURES)), ("depth", WITHOUT_NETWORK)):
            content[name][group] = fitted(features[:, :count], labels, weights, SIGNS[:count]).round(4).tolist()
        table = content["network"][group]
        odds, both = table[0] + features @ table[1:], np.isfinite(apart)
        pairs = np.stack([odds, model.bounded(apart, model.SCALES["apart"])], axis=1)[both]
        content["passes"][group] = fitted(pairs, labels[both], weights[both], (1, -1)).round(4).tolist()
    return content


def main() -> None:
    """Track, fit and write the asset."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=int, default=2)
    parser.add_argument("--takes", type=int, default=1)
    options = parser.parse_args()
    tracked = tracked_inputs(options.every, options.takes, WORK)
    rows = [own for own, _ in tracked]
    about = {
        "command": f"python -m training.fit_confidence --every {options.every} --takes {options.takes}",
        "features": list(FEATURES),
        "frames": {source: sum(len(r.apart) for r in rows if r.source == source) for source in sources(rows)},
    }
    save_json(model.ASSET, {"about": about, **regressions(tracked)})
    print(about["frames"])


if __name__ == "__main__":
    main()
