"""Page of a stabilised run: labels, gaps, largest changes, and the error if the truth is known."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.app.stabilise.loop import Round
from toolkit.app.stabilise.source_run import SourceRun
from toolkit.body import skeleton
from toolkit.evaluation.joint_errors import frame_errors, joint_errors
from toolkit.io.display_names import shown
from toolkit.io.files import save_bytes, save_text
from toolkit.io.html import page, picture, png_of, table
from toolkit.io.spans import spans
from toolkit.retrieval.priors.gap_trajectories import KEPT
from toolkit.retrieval.priors.limb_entries import LIMBS, OUTER
from toolkit.retrieval.priors.marks import USED
from toolkit.tracks import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE, CHANGES = "report.html", "changes.png"
SHOWN = 3
"""Number of changes in the picture."""
APART = 20
"""Minimum distance between two changes, frames."""
MARGIN = 12
"""Margin around the person, pixels."""


def write_page(source: SourceRun, rounds: Sequence[Round], best: Round, folder: Path) -> Path:
    """Write `report.html` into a folder (after Fig. 6.11, 6.13 and 6.14 of the thesis), and `changes.png` if a limb
    changed; `best` is the selected round."""
    parts = [
        f"<p>{len(rounds)} rounds; {sum(g.accepted for r in rounds for g in r.gaps)} of "
        f"{sum(len(r.gaps) for r in rounds)} gaps were filled.</p>",
        picture(png_of(_curves(source, rounds, best)), "costs, gaps, priors and errors over time"),
    ]
    changes = largest_changes(source.track, best.track)
    if changes:
        drawn = png_of(_drawn(source, best.track, changes))
        parts.append("<h2>The largest changes</h2><p>Red: before. Green: afterwards. White: the truth, if known.</p>")
        parts.append(picture(drawn, "poses before and after"))
        save_bytes(folder / CHANGES, drawn)
    parts.append("<h2>Gaps</h2>" + _table(source, rounds))
    path = folder / PAGE
    save_text(path, page(source.run.name, parts, about=": stabilised"))
    return path


def largest_changes(before: Track, after: Track) -> list[int]:
    """Return at most `SHOWN` frames with the largest movement of limbs, apart from each other."""
    moved = np.linalg.norm(after.joints - before.joints, axis=2).max(axis=1)
    found: list[int] = []
    for frame in np.argsort(-moved, kind="stable"):
        if moved[frame] <= 0.0 or len(found) == SHOWN:
            break
        if all(abs(int(frame) - other) >= APART for other in found):
            found.append(int(frame))
    return found


def _truth(source: SourceRun) -> np.ndarray | None:
    """Return the true joints (T, 20, 3) of the person, or None."""
    joints = source.recording.joints
    return None if joints is None or np.ndim(joints) != 3 else np.asarray(joints)


def _curves(source: SourceRun, rounds: Sequence[Round], best: Round) -> Figure:
    from matplotlib.figure import Figure

    times = source.track.timestamps
    truth = _truth(source)
    figure = Figure(figsize=(11.0, 9.0), layout="constrained")
    costs, gaps, priors, errors = figure.subplots(4, 1, sharex=True)
    for number, found in enumerate(rounds, start=1):
        if found.annotation is not None:
            least = found.annotation.distances.min(axis=0)
            own = times[0] + np.arange(len(least)) / found.annotation.frame_rate
            costs.plot(own, np.where(np.isfinite(least), least, np.nan), label=f"round {number}")
            costs.legend(fontsize=7)
    costs.set_ylabel("least cost", fontsize=8)
    for segment in best.segments:
        costs.axvspan(times[0] + segment.start, times[0] + segment.end, color="0.9", lw=0)
        costs.text(times[0] + segment.start, costs.get_ylim()[1], shown(segment.label, "plot"), fontsize=6, va="top")
    for gap in (g for found in rounds for g in found.gaps):
        colour = "tab:green" if gap.accepted else "0.7"
        gaps.barh(LIMBS.index(gap.limb), times[gap.stop - 1] - times[gap.start], left=times[gap.start], color=colour)
    gaps.set_yticks(range(len(LIMBS)), [limb.replace("_", " ") for limb in LIMBS], fontsize=8)
    gaps.set_title("gaps: filled (green) and left unchanged", fontsize=9, loc="left")
    _draw_priors(priors, best.priors, times)
    for track, colour, label in ((source.track, "tab:red", "before"), (best.track, "tab:green", "afterwards")):
        if truth is not None:
            own_errors = frame_errors(joint_errors(track.joints, truth[: len(track)]))
            errors.plot(times, 1000.0 * own_errors, color=colour, lw=0.9, label=label)
        else:
            limbs = np.concatenate([OUTER[limb] for limb in LIMBS])
            errors.plot(times, track.confidence[:, limbs].mean(axis=1), color=colour, lw=0.9, label=label)
    errors.set_ylabel("mean error, mm" if truth is not None else "confidence of the limbs", fontsize=8)
    errors.set_xlabel("time, s", fontsize=8)
    errors.legend(fontsize=7)
    return figure


def _draw_priors(panel: Axes, priors: np.ndarray, times: np.ndarray) -> None:
    """Draw the template entries over time: 1 dark, 0 light, one row per feature."""
    for place, number in enumerate(USED):
        for value, colour in ((1, "tab:blue"), (0, "lightskyblue")):
            for span in spans(priors[number - 1] == value):
                panel.barh(place, times[span.stop - 1] - times[span.start], left=times[span.start], color=colour)
    panel.set_yticks(range(len(USED)), [f"F{number}" for number in USED], fontsize=6)
    panel.set_title("priors: features that the label requires to be 1 (dark) and 0 (light)", fontsize=9, loc="left")


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
        low, high = pixels.min(axis=0) - MARGIN, pixels.max(axis=0) + MARGIN
        panel.set(xlim=(low[0], high[0]), ylim=(high[1], low[1]), xticks=[], yticks=[])
        panel.set_title(f"frame {frame}", fontsize=9)
    return figure


def _draw_bones(panel: Axes, pixels: np.ndarray, colour: str) -> None:
    for ends in pixels[skeleton.BONE_ROWS]:
        panel.plot(ends[:, 0], ends[:, 1], color=colour, lw=1.6)


def _table(source: SourceRun, rounds: Sequence[Round]) -> str:
    head = (
        "round",
        "limb",
        "from (s)",
        "to (s)",
        "hidden frames",
        "taken",
        "moved (mm)",
        "distance before, after (mm)",
    )
    times = source.track.timestamps
    rows = []
    for number, found in enumerate(rounds, start=1):
        for gap in found.gaps:
            taken = ", ".join(f"{name} {count}" for name, count in gap.sources.items() if name != KEPT) or "nothing"
            rows.append((
                str(number), gap.limb.replace("_", " "), f"{times[gap.start]:.2f}", f"{times[gap.stop - 1]:.2f}",
                str(gap.hidden.sum()), escape(taken), f"{1000 * gap.changed:.0f}",
                f"{1000 * gap.before:.1f}, {1000 * gap.after:.1f}",
            ))  # fmt: skip
    return table(head, rows)
