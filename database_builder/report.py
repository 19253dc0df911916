"""What a pose database covers, as text and as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit import skeleton
from toolkit.database.database import FORMAT_VERSION, PoseDatabase
from toolkit.errors import UsageError
from toolkit.files import atomic_path

COLOURS = {
    "left_hand": "#d62728",
    "right_hand": "#1f77b4",
    "left_foot": "#ff9896",
    "right_foot": "#9ec5e8",
    "head": "#7f7f7f",
}
"""Left reddish, right bluish."""
LISTED_SOURCES = 15
PICTURES = (".png", ".pdf", ".svg")
SHOWN_POSES = 5000
"""Dots in a picture; more only make it black."""


def database_text(database: PoseDatabase) -> str:
    """Facts about a database as lines: body, sampling, sources, extent of the end effectors, residual of the
    offsets."""
    notes = database.notes
    mirror = f", {int(database.mirrored.sum())} of them mirror images" if database.mirrored.any() else ""
    stop = f", at most {notes['max_poses']}" if notes.get("max_poses") else ""
    lines = [
        f"poses      {len(database)}{mirror}, selected from {notes.get('poses_read', 'unknown')}",
        f"threshold  {1000 * database.threshold:.2f} mm in the unit of Eq. 5.1 "
        f"({1000 * database.threshold * np.sqrt(len(skeleton.REPORTED)):.0f} mm root mean square per joint){stop}",
        f"body       {database.body_name}, torso {database.torso_length:.3f} m, scale {database.body_scale:g}, "
        f"fingerprint {skeleton.fingerprint()}, format {FORMAT_VERSION}",
        f"sources    {len(database.sources)}, {len(notes.get('skipped', []))} skipped",
    ]
    lines += [f"  {count:6d}  {name}" for name, count in _largest_sources(database)]
    lines.append("end effectors about the centre, metres (5th to 95th percentile)")
    points = database.features.reshape(len(database), -1, 3)
    for name, (low, high) in zip(
        skeleton.END_EFFECTORS, np.moveaxis(np.quantile(points, [0.05, 0.95], axis=0), 1, 0), strict=True
    ):
        ranges = "  ".join(f"{axis} {a:+.2f} to {b:+.2f}" for axis, a, b in zip("xyz", low, high, strict=True))
        lines.append(f"  {name:<11} {ranges}")
    if notes.get("residual"):
        lines.append("centre and facing in other views against the stored ones (median, 90th percentile)")
    for entry in notes.get("residual", []):
        lines.append(
            f"  yaw {entry['yaw_degrees']:+4.0f} deg, {entry['distance']:.0f} m: "
            f"centre {entry['centre_mm']:4.0f}, {entry['centre_90_mm']:4.0f} mm (bias {entry['bias_mm']:3.0f}), "
            f"facing {entry['facing_degrees']:4.1f}, {entry['facing_90_degrees']:4.1f} deg"
        )
    return "\n".join(lines)


def plot_coverage(database: PoseDatabase, path: str | Path) -> None:
    """Picture of the end effectors from the front, the side and above, of their heights, the facing and the sources.

    Raises
    ------
    UsageError
        The suffix is none of a picture.
    OutputError
        The picture cannot be written.
    """
    if Path(path).suffix.lower() not in PICTURES:
        raise UsageError(f"cannot draw to {path}; name it {', '.join('*' + suffix for suffix in PICTURES)}")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 9), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 3).ravel()
    points = database.features.reshape(len(database), -1, 3)
    views = (
        ("seen from the front", 0, 1, "x: to the subject's left (m)", "y: up (m)"),
        ("seen from the subject's left", 2, 1, "z: forward (m)", "y: up (m)"),
        ("seen from above", 0, 2, "x: to the subject's left (m)", "z: forward (m)"),
    )
    for axis, (title, across, up, across_label, up_label) in zip(axes, views, strict=False):
        for name, column in zip(skeleton.END_EFFECTORS, np.moveaxis(points[:SHOWN_POSES], 1, 0), strict=True):
            axis.plot(column[:, across], column[:, up], ".", ms=2, alpha=0.4, color=COLOURS[name], label=name)
        axis.set(title=title, xlabel=across_label, ylabel=up_label, aspect="equal")
        axis.grid(alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), markerscale=6, loc="outside lower center", ncols=5)
    for name, column in zip(skeleton.END_EFFECTORS, np.moveaxis(points, 1, 0), strict=True):
        axes[3].hist(column[:, 1], bins=60, histtype="step", color=COLOURS[name], label=name)
    axes[3].set(title="height above the centre", xlabel="y (m)", ylabel="poses")
    axes[4].hist(np.degrees(database.offsets[:, 3]), bins=60, color="#555555")
    axes[4].set(title="seen facing against the body's own", xlabel="degrees", ylabel="poses", yscale="log")
    names, counts = zip(*reversed(_largest_sources(database)), strict=True)
    axes[5].barh([Path(name).stem for name in names], counts, color="#555555")
    axes[5].set(title="sources with the most poses", xlabel="poses")
    figure.suptitle(
        f"{len(database)} poses, threshold {1000 * database.threshold:.1f} mm, {len(database.sources)} sources"
    )
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=100)


def _largest_sources(database: PoseDatabase) -> list[tuple[str, int]]:
    counts = np.bincount(database.pose_source, minlength=len(database.sources))
    order = np.argsort(-counts, kind="stable")[:LISTED_SOURCES]
    return [(database.sources[i], int(counts[i])) for i in order]
