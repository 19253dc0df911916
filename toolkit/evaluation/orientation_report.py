"""Files of a check by inertial sensors: distances, errors, the picture of Fig. 7.7, and a page."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.evaluation.orientations import THRESHOLDS, RunCheck
from toolkit.io.files import save_bytes, save_csv, save_text
from toolkit.io.html import page, picture, png_of, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DISTANCES, ERRORS = "distances.csv", "errors.csv"
PICTURE, PAGE = "distances.png", "report.html"
ERROR_HEAD = ("part", "from s", "to s", "peak deg", "mean deg", "kind")


def write_check(check: RunCheck, folder: str | Path) -> None:
    """Write `distances.csv`, `errors.csv`, `distances.png` and `report.html`."""
    root = Path(folder)
    rows = [
        (f"{time:.4f}", curve.limb, _cell(full), _cell(axis))
        for curve in check.distances
        for time, full, axis in zip(curve.times, curve.full, curve.axis, strict=True)
    ]
    save_csv(root / DISTANCES, ("time", "limb", "full", "axis"), rows)
    errors = [
        (e.limb, f"{e.start:.3f}", f"{e.end:.3f}", f"{e.peak:.1f}", f"{e.mean:.1f}", e.kind) for e in check.errors
    ]
    save_csv(root / ERRORS, ("limb", "start", "end", "peak", "mean", "kind"), errors)
    drawn = png_of(_plot_check(check))
    save_bytes(root / PICTURE, drawn)
    save_text(root / PAGE, _page(check, drawn))


def _plot_check(check: RunCheck) -> Figure:
    """Draw distance curves with their threshold, detected errors in red and known errors in black, with P, R, F."""
    from matplotlib.figure import Figure

    count = len(check.distances) + (check.truth is not None)
    figure = Figure(figsize=(11.0, 1.3 + 1.7 * count), layout="constrained")
    axes = np.atleast_1d(figure.subplots(count, 1))
    for panel, curve in zip(axes, check.distances, strict=False):
        panel.plot(curve.times, curve.full, color="black", lw=1.0, label="orientation")
        panel.plot(curve.times, curve.axis, color="tab:blue", lw=0.9, label="direction of the bone")
        panel.axhline(check.threshold, color="0.5", lw=0.8, ls="--")
        for error in (e for e in check.errors if e.limb == curve.limb):
            colour = "tab:orange" if error.kind == "twist" else "tab:red"
            panel.axvspan(error.start, error.end, color=colour, alpha=0.25, lw=0)
        for segment in (s for s in check.truth or () if s.label == curve.limb):
            panel.plot([segment.start, segment.end], [176, 176], color="black", lw=4, solid_capstyle="butt")
        panel.set(ylim=(0, 180), yticks=(0, 45, 90, 135, 180), xlim=(curve.times[0], curve.times[-1]))
        panel.set_ylabel("degrees", fontsize=8)
        panel.set_title(curve.limb.replace("_", " "), fontsize=9, loc="left")
        panel.grid(alpha=0.3)
    axes[0].legend(fontsize=7, loc="upper right", ncols=2)
    axes[len(check.distances) - 1].set_xlabel("time, s", fontsize=8)
    if check.truth is not None:
        scores = check.over_thresholds()
        for name, colour in (("precision", "black"), ("recall", "tab:red"), ("f", "tab:green")):
            axes[-1].plot(THRESHOLDS, [getattr(s, name) for s in scores], color=colour, label=name)
        axes[-1].set(xlabel="threshold, degrees", ylim=(0, 1.02), title="over frames")
        axes[-1].legend(fontsize=7)
        axes[-1].grid(alpha=0.3)
    return figure


def error_rows(check: RunCheck) -> list[tuple[str, ...]]:
    """Return the cells of the table of errors, with the headings `ERROR_HEAD`."""
    return [(e.limb, f"{e.start:.2f}", f"{e.end:.2f}", f"{e.peak:.0f}", f"{e.mean:.0f}", e.kind) for e in check.errors]


def _cell(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.2f}"


def _page(check: RunCheck, drawn: bytes) -> str:
    """Return the page: summary, picture, errors, calibration, and an explanation."""
    parts = [f"<p>{len(check.errors)} segments disagree by more than {check.threshold:g} degrees.</p>"]
    if check.truth is not None:
        rows = [(n, f"{s.precision:.2f}", f"{s.recall:.2f}", f"{s.f:.2f}") for n, s in check.scores().items()]
        parts.append(table(("against known errors, over", "precision", "recall", "F"), rows))
    parts.append(picture(drawn, "distance curves"))
    parts.append(table(ERROR_HEAD, error_rows(check)))
    sensors = [
        (escape(limb), s.status, f"{s.spread:.0f}", f"{s.median:.1f}", f"{s.p90:.1f}", escape(s.reason))
        for limb, s in check.calibration.sensors.items()
    ]
    parts.append(table(("sensor", "calibration", "spread", "median", "90 %", "why"), sensors))
    parts.append(
        "<p>Angles are in degrees. A segment of the kind <i>twist</i> (orange) differs only by a rotation about "
        "the bone. Depth does not determine this rotation for forearms and straight limbs, so it is mostly "
        "no tracking error. Black bars above a curve are known errors.</p>"
    )
    return page(check.name, parts, about=": the track and its inertial sensors")
