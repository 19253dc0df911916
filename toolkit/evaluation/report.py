"""An evaluation as files."""

from __future__ import annotations

from pathlib import Path

from toolkit.evaluation.plots import plot_accuracy, plot_errors
from toolkit.evaluation.scores import EvaluationTable

FILES = ("table.csv", "table.json", "accuracy.png", "error.png")
"""What `write_evaluation` writes."""


def write_evaluation(table: EvaluationTable, folder: str | Path) -> list[Path]:
    """Write `table.csv` and `table.json`, and where something was compared `accuracy.png` and `error.png`.

    Returns
    -------
    the files that were written
    """
    rows, figures, accuracy, error = (Path(folder) / name for name in FILES)
    table.to_csv(rows)
    table.to_json(figures)
    if not any(row.curve.size for row in table):
        return [rows, figures]
    plot_accuracy(table, accuracy)
    plot_errors(table, error)
    return [rows, figures, accuracy, error]
