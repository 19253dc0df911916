"""Result page of a stabilised run: labels, gaps, and the error against true joints."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.app.stabilise.source_run import SourceRun
from toolkit.app.stabilise.stabiliser import Stabilised
from toolkit.body import skeleton
from toolkit.evaluation.joint_errors import frame_errors, joint_errors
from toolkit.io.display_names import shown
from toolkit.io.files import save_text
from toolkit.io.html import page, picture, png_of, table
from toolkit.retrieval.priors.gap_trajectories import KEPT
from toolkit.retrieval.priors.limb_entries import LIMBS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "report.html"


def write_page(source: SourceRun, result: Stabilised, folder: Path) -> Path:
    """Write `report.html` into a folder (after the thesis's Fig. 6.11 and 6.14)."""
    parts = [
        f"<p>{sum(gap.accepted for gap in result.gaps)} of {len(result.gaps)} gaps were filled.</p>",
        picture(png_of(_curves(source, result)), "costs, gaps and errors over time"),
    ]
    parts.append("<h2>Gaps</h2>" + _table(source, result))
    path = folder / PAGE
    save_text(path, page(source.run.name, parts, about=": stabilised"))
    return path


def _truth(source: SourceRun) -> np.ndarray | None:
    """Return the true joints (T, 20, 3) of a single person, None if the recording has none."""
    joints = source.recording.joints
    return None if joints is None or np.ndim(joints) != 3 else np.asarray(joints)


def _curves(source: SourceRun, result: Stabilised) -> Figure:
    from matplotlib.figure import Figure

    times = source.track.timestamps
    truth = _truth(source)
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    costs, gaps, errors = figure.subplots(3, 1, sharex=True)
    if result.annotation is not None:
        least = result.annotation.distances.min(axis=0)
        own = times[0] + np.arange(len(least)) / result.annotation.frame_rate
        costs.plot(own, np.where(np.isfinite(least), least, np.nan))
    costs.set_ylabel("lowest cost", fontsize=8)
    for segment in result.segments:
        costs.axvspan(times[0] + segment.start, times[0] + segment.end, color="0.9", lw=0)
        costs.text(times[0] + segment.start, costs.get_ylim()[1], shown(segment.label, "plot"), fontsize=6, va="top")
    for gap in result.gaps:
        colour = "tab:green" if gap.accepted else "0.7"
        gaps.barh(LIMBS.index(gap.limb), times[gap.stop - 1] - times[gap.start], left=times[gap.start], color=colour)
    gaps.set_yticks(range(len(LIMBS)), [limb.replace("_", " ") for limb in LIMBS], fontsize=8)
    gaps.set_title("gaps: filled (green), unchanged (grey)", fontsize=9, loc="left")
    for track, colour, label in ((source.track, "tab:red", "before"), (result.track, "tab:green", "after")):
        if truth is not None:
            own_errors = frame_errors(joint_errors(track.joints, truth[: len(track)]))
            errors.plot(times, 1000.0 * own_errors, color=colour, lw=0.9, label=label)
        else:
            limbs = np.concatenate([skeleton.OUTER[limb] for limb in LIMBS])
            errors.plot(times, track.confidence[:, limbs].mean(axis=1), color=colour, lw=0.9, label=label)
    errors.set_ylabel("mean error, mm" if truth is not None else "confidence of the limbs", fontsize=8)
    errors.set_xlabel("time, s", fontsize=8)
    errors.legend(fontsize=7)
    return figure


def _table(source: SourceRun, result: Stabilised) -> str:
    head = ("limb", "from (s)", "to (s)", "occluded frames", "selected", "moved (mm)", "distance before, after (mm)")
    times = source.track.timestamps
    rows = []
    for gap in result.gaps:
        selected = ", ".join(f"{name} {count}" for name, count in gap.sources.items() if name != KEPT) or "nothing"
        rows.append((
            gap.limb.replace("_", " "), f"{times[gap.start]:.2f}", f"{times[gap.stop - 1]:.2f}",
            str(gap.hidden.sum()), escape(selected), f"{1000 * gap.changed:.0f}",
            f"{1000 * gap.before:.1f}, {1000 * gap.after:.1f}",
        ))  # fmt: skip
    return table(head, rows)
