"""Text description of a pose database."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.database.database import FORMAT_VERSION, PoseDatabase

LISTED_SOURCES = 15


def database_text(database: PoseDatabase) -> str:
    """Return lines with body, sampling, sources and extent of the end effectors."""
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
    if len(database.sources) > LISTED_SOURCES:
        lines.append(f"          and {len(database.sources) - LISTED_SOURCES} more")
    lines.append("end effectors about the centre, metres (5th to 95th percentile)")
    points = database.features.reshape(len(database), -1, 3)
    for name, (low, high) in zip(
        skeleton.END_EFFECTORS, np.moveaxis(np.quantile(points, [0.05, 0.95], axis=0), 1, 0), strict=True
    ):
        ranges = "  ".join(f"{axis} {a:+.2f} to {b:+.2f}" for axis, a, b in zip("xyz", low, high, strict=True))
        lines.append(f"  {name:<11} {ranges}")
    return "\n".join(lines)


def _largest_sources(database: PoseDatabase) -> list[tuple[str, int]]:
    counts = np.bincount(database.pose_source, minlength=len(database.sources))
    order = np.argsort(-counts, kind="stable")[:LISTED_SOURCES]
    return [(database.sources[i], int(counts[i])) for i in order]
