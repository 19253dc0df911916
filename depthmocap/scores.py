"""Tracks compared with the truth, or with another system's joints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from depthmocap.tracks import Track

if TYPE_CHECKING:
    from toolkit.evaluation.scores import EvaluationTable


def evaluate(
    tracks: Track | Sequence[Track] | str | Path, truth: np.ndarray | str | Path | None = None
) -> EvaluationTable:
    """Scores of tracks, or of run folders: a table with `mean()`, `to_csv()` and `to_json()`.

    Parameters
    ----------
    tracks : of `depthmocap.track`, or the path of a run folder or of a folder of runs
    truth : joints (T, 20, 3), or (N, T, 20, 3) of several people in any order: metres, camera frame, NaN = unknown. Of
        run folders a file, or a folder matched by the recording's name; the recording's own truth by default

    Raises
    ------
    UsageError
        Tracks in memory come without a truth, or frames and joints do not fit.
    DepthMocapError
        See `toolkit.evaluation.evaluate.evaluate_runs`.
    """
    from toolkit.evaluation.evaluate import evaluate_runs, evaluate_tracks

    if isinstance(tracks, (str, Path)):
        return evaluate_runs([tracks], None if truth is None else [Path(str(truth))])
    several = [tracks] if isinstance(tracks, Track) else list(tracks)
    return evaluate_tracks([(each.name, each.person.track) for each in several], np.asarray(truth, dtype=np.float64))
