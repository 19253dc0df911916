"""Result page of a stabilised run: labels, gaps, the largest changes, and the error against true joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.app.stabilise.source_run import SourceRun
from toolkit.app.stabilise.stabiliser import Stabilised
from toolkit.body import skeleton
from toolkit.evaluation.joint_errors import frame_errors, joint_errors
from toolkit.io.display_names import shown
from toolkit.io.files import save_bytes, save_text
from toolkit.io.html import page, picture, png_of, table
from toolkit.retrieval.priors.gap_trajectories import KEPT
from toolkit.retrieval.priors.limb_entries import LIMBS
from toolkit.tracks import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE, CHANGES = "report.html", "changes.png"


@dataclass(frozen=True)
class PageSettings:
    """Selection and crop of the drawn changes.

    Attributes
    ----------
    changes : number of changes that are drawn
    distance : frames, smallest distance between two drawn changes
    margin : pixels around the person
    """

    changes: int = 3
    distance: int = 20
    margin: int = 12


SETTINGS = PageSettings()


def write_page(source: SourceRun, result: Stabilised, folder: Path) -> Path:
    """Write `report.html` into a folder (after the thesis's Fig. 6.11, 6.13 and 6.14), and `changes.png` if any."""
    parts = [
        f"<p>{sum(gap.accepted for gap in result.gaps)} of {len(result.gaps)} gaps were filled.</p>",
        picture(png_of(_curves(source, result)), "costs, gaps and errors over time"),
    ]
    changes = largest_changes(source.track, result.track)
    if changes:
        drawn = png_of(_drawn(source, result.track, changes))
        parts.append("<h2>The largest changes</h2><p>Red: before. Green: after. White: true joints, if known.</p>")
        parts.append(picture(drawn, "poses before and after"))
        save_bytes(folder / CHANGES, drawn)
    parts.append("<h2>Gaps</h2>" + _table(source, result))
    path = folder / PAGE
    save_text(path, page(source.run.name, parts, about=": stabilised"))
    return path


def largest_changes(before: Track, after: Track) -> list[int]:
    """Return the frames with the largest joint displacements, at most `PageSettings.changes`, `PageSettings.distance`
    apart.
    """
    moved = np.linalg.norm(after.joints - before.joints, axis=2).max(axis=1)
    found: list[int] = []
    for frame in np.argsort(-moved, kind="stable"):
        if moved[frame] <= 0.0 or len(found) == SETTINGS.changes:
            break
        if all(abs(int(frame) - other) >= SETTINGS.distance for other in found):
            found.append(int(frame))
    return found


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


def _drawn(source: SourceRun, after: Track, frames: Sequence[int]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.0 * len(frames), 4.6), layout="constrained")
    panels = figure.subplots(1, len(frames), squeeze=False)[0]
    truth, camera = _truth(source), source.recording.camera
    depths = {i: f.depth_mm for i, f in enumerate(source.recording.stream()) if i in set(frames)}
    for panel, frame in zip(panels, frames, strict=True):
        depth = np.where(depths[frame] > 0, depths[frame], np.nan)
        panel.imshow(depth, cmap="gray_r")
        shown = [(source.track.joints[frame], "tab:red"), (after.joints[frame], "tab:green")]
        if truth is not None:
            shown.insert(0, (truth[frame], "white"))
        for joints, colour in shown:
            _draw_bones(panel, camera.project(joints), colour)
        pixels = camera.project(after.joints[frame])
        low, high = pixels.min(axis=0) - SETTINGS.margin, pixels.max(axis=0) + SETTINGS.margin
        panel.set(xlim=(low[0], high[0]), ylim=(high[1], low[1]), xticks=[], yticks=[])
        panel.set_title(f"frame {frame}", fontsize=9)
    return figure


def _draw_bones(panel: Axes, pixels: np.ndarray, colour: str) -> None:
    for ends in pixels[skeleton.BONE_ROWS]:
        panel.plot(ends[:, 0], ends[:, 1], color=colour, lw=1.6)


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
