"""Figure of a track: some skeletons, and the heights of head, hands and feet over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.body.skeleton import BONE_ROWS, REPORTED
from toolkit.output.rendering.style import BONE_COLORS
from toolkit.tracks.runs import Person

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CURVES = {"head": "black", "left_hand": "tab:orange", "right_hand": "tab:blue"}
CURVES |= {"left_foot": "tab:orange", "right_foot": "tab:blue"}


def plot_person(person: Person) -> Figure:
    """Draw some skeletons as seen from the camera, above the heights of head, hands and feet; y is up, metres.

    Frames without the person are blank. Dashed lines are feet; orange is the person's left.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5.5), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=(3, 2))
    joints, times = person.joints_level, person.times
    frames = np.flatnonzero(person.there)
    skeletons = 6  # number of skeletons
    step = 1.1  # distance between two skeletons, metres
    for k, frame in enumerate(frames[np.linspace(0, len(frames) - 1, skeletons).astype(int)] if len(frames) else ()):
        points = joints[frame] - joints[frame, REPORTED.index("pelvis")] * (1.0, 0.0, 0.0)
        for (a, b), side in zip(points[BONE_ROWS], BONE_COLORS, strict=True):
            color = tuple(channel / 255 * 0.8 for channel in side)
            above.plot([k * step + a[0], k * step + b[0]], [a[1], b[1]], color=color, lw=2)
        above.text(k * step, np.nanmin(points[:, 1]) - 0.15, f"{times[frame]:.1f} s", ha="center", va="top", fontsize=8)
    above.set_aspect("equal")
    above.set_axis_off()
    above.set_title(f"{person.name}: {len(person.track)} frames", fontsize=10, loc="left")
    for name, curve in CURVES.items():
        style = "--" if name.endswith("foot") else "-"
        below.plot(times, joints[:, REPORTED.index(name), 1], style, color=curve, lw=1, label=name.replace("_", " "))
    below.set(xlabel="time, s", ylabel="height above the camera, m")
    below.legend(fontsize=7, ncols=5, loc="upper center", bbox_to_anchor=(0.5, 1.18), frameon=False)
    return figure
