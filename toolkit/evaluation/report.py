"""An evaluation as files."""

from __future__ import annotations

from pathlib import Path

from toolkit.evaluation.plots import plot_accuracy, plot_errors
from toolkit.evaluation.scores import EvaluationTable


def write_evaluation(table: EvaluationTable, folder: str | Path) -> list[Path]:
    """Write `table.csv` and `table.json`, and where something was compared `accuracy.png` and `error.png`.

    Returns
    -------
    the files that were written
    """
    root = Path(folder)
    table.to_csv(root / "table.csv")
    table.to_json(root / "table.json")
    written = [root / "table.csv", root / "table.json"]
    if any(row.curve.size for row in table):
        plot_accuracy(table, root / "accuracy.png")
        plot_errors(table, root / "error.png")
        written += [root / "accuracy.png", root / "error.png"]
    return written
