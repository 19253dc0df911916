"""Files of an annotation: segments as CSV, a plot as in the thesis's Fig. 5.2, and a page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.io.display_names import shown
from toolkit.io.errors import RetrievalError
from toolkit.io.files import save_bytes, save_csv, save_text
from toolkit.io.html import page, picture, png_of, table
from toolkit.io.yaml_reader import read_table
from toolkit.retrieval.annotation.annotator import Annotation
from toolkit.retrieval.annotation.measures import (
    Scores,
    Segment,
    check_truth,
    frame_scores,
    label_frames,
    segment_scores,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = ("start", "end", "label", "score")
REPORT_FILES = SEGMENTS, PICTURE, PAGE = ("segments.csv", "annotation.png", "report.html")

_SCORE_WORDS = {
    "cost": "The score is the fraction of features that agree with the class's motion template along the segment;",
    "doubt": "The score is the probability that the segment is such a motion;",
}


def write_report(
    annotation: Annotation,
    folder: str | Path,
    truth: Sequence[Segment] | None = None,
) -> dict[str, Scores]:
    """Write segments.csv, annotation.png and report.html into a folder.

    Parameters
    ----------
    annotation : annotation to write
    folder : output folder, made if missing
    truth : true segments, if known

    Returns
    -------
    Scores over "frames" and over "segments"; empty without truth.

    Raises
    ------
    RetrievalError
        True segments overlap, are empty, or have an unknown label.
    """
    folder = Path(folder)
    scores = {} if truth is None else score(annotation, truth)
    rows = [(f"{s.start:.3f}", f"{s.end:.3f}", shown(s.label, "table"), f"{s.score:.4f}") for s in annotation.segments]
    save_csv(folder / SEGMENTS, COLUMNS, rows)
    drawn = png_of(plot_annotation(annotation, truth))
    save_bytes(folder / PICTURE, drawn)
    save_text(folder / PAGE, _page(annotation, truth, scores, drawn))
    return scores


def _missed_segments(truth: Sequence[Segment], found: Sequence[Segment]) -> list[Segment]:
    """Return the true segments without an overlapping found one of their label."""
    return [segment for segment in truth if not segment_scores([segment], found).right_true]


def score(annotation: Annotation, truth: Sequence[Segment]) -> dict[str, Scores]:
    """Return the scores over "frames" and over "segments" against true segments (thesis 5.4)."""
    check_truth(truth, annotation.name)
    true = label_frames(truth, annotation.labels, annotation.frames.shape[1], annotation.frame_rate)
    return {
        "frames": frame_scores(true, annotation.frames),
        "segments": segment_scores(truth, annotation.segments),
    }


def read_segments(path: str | Path) -> list[Segment]:
    """Return the segments of a CSV file with the columns start, end (seconds) and label.

    Raises
    ------
    RetrievalError
        The file is missing, has other columns, or a number cannot be read; the message names the line.
    """
    file = Path(path)
    segments = []
    rows = read_table(file, RetrievalError, "give a CSV file with the columns start, end and label")
    for line, row in enumerate(rows, start=2):
        try:
            segment = Segment(float(row["start"]), float(row["end"]), row["label"].strip())
            if not (np.isfinite([segment.start, segment.end]).all()):
                raise ValueError("start and end must be finite")
            segments.append(segment)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise RetrievalError(
                f"{file.name}, line {line}: expected numbers in the columns start and end and a label, got {row}"
            ) from error
    return segments


def plot_annotation(annotation: Annotation, truth: Sequence[Segment] | None) -> Figure:
    """Plot modified distance functions, and below them found, true and missed segments (Fig. 5.2)."""
    from matplotlib.figure import Figure

    classes, length = annotation.distances.shape
    seconds = length / annotation.frame_rate
    height = 0.24 * classes + 1.0
    figure = Figure(figsize=(11.0, 2 * height), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    visible = np.where(np.isfinite(annotation.distances), annotation.distances, np.nan)
    image = above.imshow(
        visible, aspect="auto", interpolation="nearest", cmap="viridis", vmin=0.0, vmax=max(annotation.thresholds),
        extent=(0.0, seconds, classes - 0.5, -0.5),
    )  # fmt: skip
    above.set_title(
        f"{shown(annotation.name, 'plot')}: {annotation.measure} of each class (white: no hit)", fontsize=10
    )
    figure.colorbar(image, ax=above, label=annotation.measure)
    truths = " and true (black; orange: missed)" if truth is not None else ""
    below.set_title(f"annotation: found (red){truths}", fontsize=10)
    missed = _missed_segments(truth or (), annotation.segments)
    for row, label in enumerate(annotation.labels):
        _bars(below, annotation.segments, label, row - 0.2, "tab:red")
        _bars(below, truth or (), label, row + 0.2, "black")
        _bars(below, missed, label, row + 0.2, "tab:orange")
    for axes in (above, below):
        axes.set_yticks(range(classes), [shown(label, "plot") for label in annotation.labels], fontsize=8)
        axes.set_ylim(classes - 0.5, -0.5)
        axes.set_yticks(np.arange(classes - 1) + 0.5, minor=True)
        axes.grid(which="minor", axis="y", linewidth=0.3)
        axes.tick_params(which="minor", length=0)
    below.set_xlim(0.0, seconds)
    below.set_xlabel("time (s)")
    return figure


def _bars(axes: Any, segments: Sequence[Segment], label: str, centre: float, colour: str) -> None:
    spans = [(segment.start, segment.end - segment.start) for segment in segments if segment.label == label]
    axes.broken_barh(spans, (centre - 0.18, 0.36), color=colour)


def _page(annotation: Annotation, truth: Sequence[Segment] | None, scores: dict[str, Scores], drawn: bytes) -> str:
    """Return the page: summary, plot and segments."""
    seconds = annotation.frames.shape[1] / annotation.frame_rate
    labelled = 100.0 * annotation.frames.any(axis=0).mean()
    parts = [
        f"<p>{seconds:.1f} seconds were searched for {len(annotation.labels)} motion classes. "
        f"{len(annotation.segments)} segments were found; they cover {labelled:.0f} % of the time.</p>",
    ]
    if annotation.too_long:
        parts.append(f"<p>Too long for this motion, and so not searched: {escape(', '.join(annotation.too_long))}.</p>")
    if scores:
        parts.append(table(
            ("compared with the true segments", "precision", "recall", "F"),
            [(f"over {name}", f"{s.precision:.2f}", f"{s.recall:.2f}", f"{s.f:.2f}") for name, s in scores.items()],
        ))  # fmt: skip
    parts.append(picture(drawn, "distance functions and segments over time"))
    parts.append(table(("from (s)", "to (s)", "motion", "score"), [_row(s, truth) for s in annotation.segments]))
    missed = _missed_segments(truth or (), annotation.segments)
    if missed:
        rows = [(f"{s.start:.2f}", f"{s.end:.2f}", escape(s.label)) for s in missed]
        parts.append(table(("missed from (s)", "to (s)", "motion"), rows))
    words = f"{_SCORE_WORDS[annotation.measure]} below {1.0 - max(annotation.thresholds):.2f} nothing is reported."
    parts.append(f"<p>{words}</p>")
    return page(annotation.name, parts)


def _row(segment: Segment, truth: Sequence[Segment] | None) -> tuple[str, str, str, str]:
    mark = ""
    if truth is not None:
        right = segment_scores(truth, [segment]).right_found
        mark = " <span class='ok'>right</span>" if right else " <span class='no'>not in the truth</span>"
    return f"{segment.start:.2f}", f"{segment.end:.2f}", escape(segment.label) + mark, f"{segment.score:.3f}"
