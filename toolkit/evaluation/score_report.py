"""Files of an evaluation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.evaluation.joint_errors import CURVE, LOST_ERROR
from toolkit.evaluation.scores import EvaluationTable
from toolkit.io.display_names import shown
from toolkit.io.files import save_bytes
from toolkit.io.html import png_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FILES = ("table.csv", "table.json", "accuracy.png", "error.png")
"""Names of the files of `write_evaluation`."""


def write_evaluation(table: EvaluationTable, folder: str | Path) -> list[Path]:
    """Write `table.csv` and `table.json`, and with a reference also `accuracy.png` and `error.png`.

    Returns
    -------
    the paths of the written files
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
"""Maximum number of runs with a legend."""


def plot_accuracy(table: EvaluationTable, path: str | Path) -> None:
    """Draw A(t), the fraction of joints within t, of each compared run and of their mean."""
    rows = [row for row in table if row.curve.size]
    style = {"lw": 0.8, "color": "0.75"} if len(rows) > LEGEND_ROWS else {"lw": 1.4}
    with _plot(path, len(rows)) as axes:
        for row in rows:
            axes.plot(CURVE * 1000, 100 * row.curve, label=shown(row.recording, "plot"), **style)
        if len(rows) > 1:
            axes.plot(CURVE * 1000, 100 * table.mean().curve, color="black", lw=2, label=f"mean of {len(rows)}")
        axes.set(xlabel="t, mm", ylabel="joints within t, %", xlim=(0, CURVE[-1] * 1000), ylim=(0, 100), title="A(t)")


def plot_errors(table: EvaluationTable, path: str | Path) -> None:
    """Draw the mean error over time of each compared run."""
    rows = [row for row in table if row.frame_error_mm.size]
    with _plot(path, len(rows)) as axes:
        for row in rows:
            seconds, name = row.timestamps - row.timestamps[0], shown(row.recording, "plot")
            axes.plot(seconds, row.frame_error_mm, lw=0.6 if len(rows) > LEGEND_ROWS else 1.2, label=name)
        lost = LOST_ERROR * 1000
        axes.axhline(lost, color="0.4", ls="--", lw=1)
        axes.annotate("lost", (1.0, lost), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8)
        highest = max(float(np.nanmax(row.frame_error_mm, initial=0.0)) for row in rows)
        axes.set(xlabel="time, s", ylabel="mean distance of the joints, mm", ylim=(0, max(1.05 * highest, 220)))


@contextmanager
def _plot(path: str | Path, runs: int) -> Iterator[Axes]:
    """Yield axes for this number of runs and write the picture at the end."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    yield axes
    axes.grid(alpha=0.3)
    if runs <= LEGEND_ROWS:
        axes.legend(fontsize=8)
    save_bytes(path, png_of(figure, dpi=130))
