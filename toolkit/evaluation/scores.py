"""Scores of one run, the table of many, and its files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.evaluation.joint_errors import CURVE, LOST_ERROR
from toolkit.io.display_names import shown
from toolkit.io.files import save_bytes, save_csv, save_json
from toolkit.io.html import png_of
from toolkit.tracks import STATE_NAMES, TRACKED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from rich.table import Table

Figures = dict[str, float]


@dataclass(frozen=True, eq=False)
class RunScores:
    """Scores of one run; None where the run lacks the input. Fractions are in [0, 1].

    Attributes
    ----------
    recording : name of the recording
    run : path of the run folder
    frames, recorded_frames : rows of the track, frames of the recording; an interrupted run has fewer rows
    error_mm, median_mm : mean and median error of the joints, capped at 1 m
    visible_mm, hidden_mm : mean error of the joints that the camera sees and of those it does not
    a100, a100_hands_feet, a100_joints : share of joints within 100 mm, of all, of hands and feet, of each joint
    lost : share of frames with a mean error over 200 mm
    extrema, extrema_free : share of frames whose five extrema are the five end effectors, among frames in which all
        five are visible, and among those in which they also are free of the body
    agreement, agreement_offsets : share of joints, hands and feet left out, within 100 mm of another system's
        skeleton; plain, and with offsets fitted on other subjects
    agreement_hands_feet : share of hands and feet within 100 mm of another system's skeleton, plain
    overlap, residual_mm : silhouette overlap and median absolute depth residual of the fitted body, medians over
        frames
    states, sources : share of frames in each state, and of the tracked frames in which each hypothesis won
    frame_ms, frame_ms_p99, stages_ms : median and 99th percentile of the time per frame, median of each stage
    curve : A(t) at `joint_errors.CURVE`; empty without a reference, as are the next two
    frame_error_mm, timestamps : mean error of each frame and its time in seconds, for plots
    differences : differences to another system's joints, see `agreement.local_differences`; empty for a truth
    """

    recording: str
    run: str
    frames: int
    recorded_frames: int
    error_mm: float | None = None
    median_mm: float | None = None
    visible_mm: float | None = None
    hidden_mm: float | None = None
    a100: float | None = None
    a100_hands_feet: float | None = None
    a100_joints: Figures = field(default_factory=dict)
    lost: float | None = None
    extrema: float | None = None
    extrema_free: float | None = None
    agreement: float | None = None
    agreement_offsets: float | None = None
    agreement_hands_feet: float | None = None
    overlap: float | None = None
    residual_mm: float | None = None
    states: Figures = field(default_factory=dict)
    sources: Figures = field(default_factory=dict)
    frame_ms: float | None = None
    frame_ms_p99: float | None = None
    stages_ms: Figures = field(default_factory=dict)
    curve: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)
    frame_error_mm: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)
    timestamps: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)
    differences: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)

    @property
    def tracked(self) -> float | None:
        """Return the fraction of frames with state tracked."""
        return self.states.get(STATE_NAMES[TRACKED])

    def flat(self) -> dict[str, Any]:
        """Return all scores by name, nested ones as `states.lost`, without arrays."""
        row: dict[str, Any] = {}
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, dict):
                row.update({f"{item.name}.{key}": number for key, number in value.items()})
            elif item.name not in _ARRAYS:
                row[item.name] = value
        return row


_SERIES = ("frame_error_mm", "timestamps", "differences")
_ARRAYS = ("curve", *_SERIES)
_TEXT = ("recording", "run")

COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("error_mm", "error mm", ".0f"),
    ("a100", "within 100 mm %", "%"),
    ("agreement", "agrees within 100 mm %", "%"),
    ("tracked", "tracked %", "%"),
    ("frame_ms", "ms a frame", ".1f"),
    ("overlap", "body on depth %", "%"),
    ("frames", "frames", "d"),
)
"""Columns of the terminal table, most important first: name, heading, format. The first five available columns
are printed; files hold all."""


class EvaluationTable:
    """Scores of several runs; their mean weights all recordings equally."""

    def __init__(self, rows: Iterable[RunScores]) -> None:
        self.rows = list(rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[RunScores]:
        return iter(self.rows)

    def mean(self) -> RunScores:
        """Return the mean of each score over the recordings that have it; frames are summed."""
        values: dict[str, Any] = {"recording": f"mean of {len(self)}", "run": ""}
        for item in fields(RunScores):
            held = [getattr(row, item.name) for row in self.rows]
            if item.name in ("frames", "recorded_frames"):
                values[item.name] = sum(held)
            elif item.name == "curve":
                curves = [curve for curve in held if curve.size]
                values[item.name] = np.mean(curves, axis=0) if curves else np.empty(0)
            elif item.name in (*_TEXT, *_ARRAYS):
                continue
            elif any(isinstance(value, dict) for value in held):
                keys = dict.fromkeys(key for value in held for key in value)
                values[item.name] = {key: _mean([value.get(key) for value in held]) for key in keys}
            else:
                values[item.name] = _mean(held)
        return RunScores(**values)

    def to_rich(self, title: str | None = None) -> Table:
        """Return the terminal table, one line per run and their mean: six columns in 80 characters."""
        from rich.table import Table

        most, longest_name = 5, 26  # columns, and characters of a name in one line: together 80 characters
        held = [column for column in COLUMNS if any(_known(getattr(row, column[0])) for row in self.rows)][:most]
        table = Table(title=title)
        table.add_column("run", overflow="fold", max_width=longest_name)
        for _, heading, _ in held:
            table.add_column(heading, justify="right", max_width=1 + max(map(len, heading.split())))
        mean = [self.mean()] if len(self) > 1 else []
        for row in [*self.rows, *mean]:
            cells = [_cell(getattr(row, name), style) for name, _, style in held]
            table.add_row(_label(row), *cells, end_section=bool(mean) and row is self.rows[-1])
        return table

    def to_csv(self, path: str | Path) -> None:
        """Write all scores of each run as CSV, one line each, atomically."""
        flat = [row.flat() for row in self.rows]
        names = list(dict.fromkeys(name for row in flat for name in row))
        cells = ([row.get(name, "") for name in names] for row in flat)
        save_csv(path, names, ([shown(v, "table") if isinstance(v, str) else v for v in row] for row in cells))

    def to_json(self, path: str | Path) -> None:
        """Write all scores of each run, their mean and the accuracy curves as JSON, atomically."""
        value = {
            "curve_thresholds_mm": np.round(CURVE * 1000).tolist(),
            "mean": _plain(self.mean()) if self.rows else None,
            "runs": [_plain(row) for row in self.rows],
        }
        save_json(path, value)


def _label(row: RunScores) -> str:
    """Return the name of a row: its run folder, and the recording if its name differs."""
    run, (recording, *person) = Path(row.run), row.recording.split("/")
    folder = run.parent.name if person == [run.name] else run.name
    return row.recording if folder in ("", recording) else f"{'/'.join([folder, *person])} ({recording})"


def _mean(values: list[float | None]) -> float | None:
    held = [value for value in values if value is not None and _known(value)]
    return float(np.mean(held)) if held else None


def _known(value: float | None) -> bool:
    return value is not None and bool(np.isfinite(value))


def _cell(value: float | None, style: str) -> str:
    if value is None or not _known(value):
        return "-"
    return f"{100 * value:.1f}" if style == "%" else format(value, style)


def _plain(row: RunScores) -> dict[str, Any]:
    """Return the scores of a row without plot series."""
    return {f.name: getattr(row, f.name) for f in fields(row) if f.name not in _SERIES}


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
