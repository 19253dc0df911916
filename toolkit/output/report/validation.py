"""Page, table and figures of a validation against markers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.evaluation.marker_statistics import LIMITS
from toolkit.evaluation.marker_validation import Validation
from toolkit.io.files import save_csv, save_json, save_text
from toolkit.io.html import page, picture, png_of, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FILES = ("validation.html", "validation.csv", "validation.json")
JOINT_HEAD = ("joint", "frames", "mean mm", "RMS mm", "median mm", "95 % mm", "bias x, y, z mm", "limits x, y, z mm")
ANGLE_HEAD = ("angle", "frames", "bias deg", "SD deg", "RMS deg", "limits deg", "r", "range deg", "reference range deg")
STRIDE_HEAD = ("side", "strides", "reference", "time s", "reference s", "length m", "reference m")


def write_validation(validation: Validation, folder: str | Path) -> list[Path]:
    """Write `FILES` into a folder, each atomically, and return their paths.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    target = Path(folder)
    rows = [JOINT_HEAD, *joint_rows(validation), ANGLE_HEAD, *angle_rows(validation)]
    save_text(target / FILES[0], _page(validation))
    save_csv(target / FILES[1], rows[0], rows[1:])
    save_json(target / FILES[2], validation.figures())
    return [target / name for name in FILES]


def joint_rows(validation: Validation) -> list[tuple[str, ...]]:
    """Return the cells of the table of joints; a joint with one marker on the skin has a star."""
    return [
        (
            row.joint + "*" * row.on_skin, str(row.frames), f"{row.mean:.1f}", f"{row.rms:.1f}", f"{row.median:.1f}",
            f"{row.p95:.1f}", ", ".join(f"{round(value)}" for value in row.bias),
            ", ".join(f"±{value:.0f}" for value in row.limits),
        )
        for row in validation.joints
    ]  # fmt: skip


def angle_rows(validation: Validation) -> list[tuple[str, ...]]:
    """Return the cells of the table of angles."""
    return [
        (
            row.angle, str(row.frames), f"{row.bias:.1f}", f"{row.sd:.1f}", f"{row.rms:.1f}",
            f"{row.lower:.1f} to {row.upper:.1f}", f"{row.correlation:.2f}", f"{row.range_track:.1f}",
            f"{row.range_reference:.1f}",
        )
        for row in validation.angles
    ]  # fmt: skip


def stride_rows(validation: Validation) -> list[tuple[str, ...]]:
    """Return the cells of the table of strides."""
    return [
        (
            row.side, str(row.count_track), str(row.count_reference), f"{row.time_track:.2f}",
            f"{row.time_reference:.2f}", f"{row.length_track:.2f}", f"{row.length_reference:.2f}",
        )
        for row in validation.strides
    ]  # fmt: skip


def summary(validation: Validation) -> list[str]:
    """Return the description of the comparison, one sentence each."""
    lines = [f"{validation.frames} frames in common, {100 * validation.tracked:.0f} % of them tracked."]
    if math.isfinite(validation.mean_mm):
        lines.append(f"Mean distance of the joints {validation.mean_mm:.1f} mm (marker set {validation.marker_set}).")
    how = (
        f"correlation of the speeds {validation.correlation:.2f}" if math.isfinite(validation.correlation) else "given"
    )
    lines.append(f"Clock of the reference: {validation.lag:+.3f} s ({how}).")
    if validation.alignment is not None:
        lines.append(
            f"One rigid alignment for the recording: median residual {1000 * validation.alignment.residual:.1f} mm."
        )
    return [*lines, *(f"Note: {note}." for note in validation.notes)]


def _page(validation: Validation) -> str:
    parts = [f"<p>{'<br>'.join(summary(validation))}</p>"]
    if validation.joints:
        parts += ["<h2>Joints</h2>", table(JOINT_HEAD, joint_rows(validation))]
        parts.append(
            "<p>Track minus markers. x right, y up, z towards the camera. Limits: 95 % limits of agreement.</p>"
        )
    if validation.angles:
        parts += ["<h2>Angles</h2>", table(ANGLE_HEAD, angle_rows(validation))]
        kind = (
            "of OpenSim's model" if not validation.joints else "at the middle of three joint centres, by both systems"
        )
        parts.append(f"<p>Angles {kind}; limits: 95 % limits of agreement (Bland and Altman 1986).</p>")
        parts.append(picture(png_of(_curves(validation)), "angles of both systems over time"))
        parts.append(picture(png_of(_bland_altman(validation)), "differences of the angles against their means"))
    if validation.strides:
        parts += ["<h2>Strides</h2>", table(STRIDE_HEAD, stride_rows(validation))]
    return page(validation.person, parts, about=f" against {validation.reference}")


def _grid(validation: Validation, title: str) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure with axes for each angle, by its name."""
    from matplotlib.figure import Figure

    columns = 2
    rows = -(-len(validation.curves) // columns)
    figure = Figure(figsize=(11.0, 2.1 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(validation.curves) :]:
        axis.set_axis_off()
    named = dict(zip(validation.curves, axes, strict=False))
    for name, axis in named.items():
        axis.set_title(f"{name.replace('_', ' ')}{title}", fontsize=9)
    return figure, named


def _curves(validation: Validation) -> Figure:
    figure, axes = _grid(validation, ", degrees")
    for name, (track, reference) in validation.curves.items():
        axes[name].plot(validation.times, reference, color="0.2", label="reference")
        axes[name].plot(validation.times, track, color="C1", label="track")
    next(iter(axes.values())).legend(fontsize=8)
    return figure


def _bland_altman(validation: Validation) -> Figure:
    figure, axes = _grid(validation, ": difference against mean, degrees")
    for name, (track, reference) in validation.curves.items():
        difference = track - reference
        axes[name].plot((track + reference) / 2, difference, ".", ms=2, color="C0")
        bias, spread = np.nanmean(difference), LIMITS * np.nanstd(difference, ddof=1)
        for level, style in ((bias, "-"), (bias - spread, "--"), (bias + spread, "--")):
            axes[name].axhline(level, color="0.3", ls=style, lw=0.8)
    return figure
