"""An evaluation as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.errors import UsageError
from toolkit.evaluation.joints import CURVE, LOST_ERROR
from toolkit.evaluation.scores import EvaluationTable, RunScores
from toolkit.files import atomic_path
from toolkit.names import shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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


LEGEND_ROWS = 12
"""More runs than this are drawn without a legend, in which no person could find anything."""


def plot_accuracy(table: EvaluationTable, path: str | Path) -> None:
    """Write A(t), the share of joints within t, of every run and their mean as a picture.

    Raises
    ------
    UsageError
        No run was compared with anything.
    """
    rows = _compared([row for row in table if row.curve.size], "A(t)")
    figure, axes = _figure()
    many = len(rows) > LEGEND_ROWS
    for row in rows:
        axes.plot(
            CURVE * 1000,
            100 * row.curve,
            lw=0.8 if many else 1.4,
            color="0.75" if many else None,
            label=shown(row.recording, "plot"),
        )
    if len(rows) > 1:
        axes.plot(CURVE * 1000, 100 * table.mean().curve, color="black", lw=2, label=f"mean of {len(rows)}")
    axes.set(xlabel="t, mm", ylabel="joints within t, %", xlim=(0, CURVE[-1] * 1000), ylim=(0, 100), title="A(t)")
    axes.grid(alpha=0.3)
    if not many:
        axes.legend(fontsize=8, loc="lower right")
    _write(figure, path)


def plot_errors(table: EvaluationTable, path: str | Path) -> None:
    """Write the mean error over time of every run as a picture.

    Raises
    ------
    UsageError
        No run was compared with anything.
    """
    rows = _compared([row for row in table if row.frame_error_mm.size], "error")
    figure, axes = _figure()
    many = len(rows) > LEGEND_ROWS
    for row in rows:
        axes.plot(
            row.timestamps - row.timestamps[0],
            row.frame_error_mm,
            lw=0.6 if many else 1.2,
            label=shown(row.recording, "plot"),
        )
    axes.axhline(LOST_ERROR * 1000, color="0.4", ls="--", lw=1)
    axes.annotate(
        "lost", (1.0, LOST_ERROR * 1000), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8
    )
    highest = max(float(np.nanmax(row.frame_error_mm, initial=0.0)) for row in rows)
    axes.set(xlabel="time, s", ylabel="mean distance of the joints, mm", ylim=(0, max(1.05 * highest, 220)))
    axes.grid(alpha=0.3)
    if not many:
        axes.legend(fontsize=8)
    _write(figure, path)


def _compared(rows: list[RunScores], what: str) -> list[RunScores]:
    if not rows:
        raise UsageError(f"no run has a reference, so there is no {what} to plot; name one with --reference")
    return rows


def _figure() -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    return figure, figure.add_subplot()


def _write(figure: Figure, path: str | Path) -> None:
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=130)
