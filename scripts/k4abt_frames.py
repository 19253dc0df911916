"""Draw the joint frames of the Azure Kinect SDK on our body in its T-pose: `docs/images/k4abt_frames.png`."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from toolkit.body import k4abt
from toolkit.body.shape import load_body

OUTPUT = Path(__file__).resolve().parents[1] / "docs" / "images" / "k4abt_frames.png"
COLORS = ("#d62728", "#2ca02c", "#1f5fd6")
LENGTH = 0.075
"""Length of a drawn axis, metres."""
OBLIQUE = np.array([[1.0, 0.0, -0.45], [0.0, 1.0, -0.35]])
"""Rotation from left, up, front to the picture, as seen by a camera in front, slightly from the side and above."""
FACE = ("NOSE", "EYE_LEFT", "EYE_RIGHT", "EAR_LEFT", "EAR_RIGHT")
TRUNK = {"PELVIS", "SPINE_NAVEL", "SPINE_CHEST", "NECK", "HEAD"}
BELOW = {"HAND_LEFT", "HAND_RIGHT", "THUMB_LEFT", "THUMB_RIGHT", "ELBOW_LEFT", "ELBOW_RIGHT"}


def main() -> None:
    """Write the picture."""
    points = k4abt.rest_points(load_body("neutral"))
    flat = points @ OBLIQUE.T
    figure, axes = plt.subplots(figsize=(13, 11.5))
    at = dict(zip(k4abt.NAMES, flat, strict=True))
    for a, b in k4abt.BONES:
        axes.plot(*np.array([at[a], at[b]]).T, color="#9aa0a8", lw=3, solid_capstyle="round", zorder=1)
    for name, place, frame in zip(k4abt.NAMES, flat, k4abt.REST_FRAMES, strict=True):
        axes.plot(*place, "o", color="#333", ms=4, zorder=3)
        if name in FACE:
            continue
        for k, color in enumerate(COLORS):
            step = LENGTH * OBLIQUE @ frame[:, k]
            axes.annotate(
                "", place + step, place, arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.8}, zorder=4
            )
        if name in TRUNK:
            axes.text(place[0] - 0.05, place[1] + 0.015, name, fontsize=7, ha="right", color="#444")
            continue
        down = name in BELOW
        axes.text(place[0], place[1] + (-0.085 if down else 0.09), name, fontsize=7, ha="center", color="#444")
    for k, (axis, color) in enumerate(zip("xyz", COLORS, strict=True)):
        axes.text(-0.88, 0.75 - 0.045 * k, f"{axis} axis", color=color, fontsize=13, weight="bold")
    axes.text(-0.88, 0.6, "face (NOSE, EYE, EAR): as HEAD", fontsize=10, color="#444")
    axes.text(-0.88, -0.95, "the person's right", fontsize=11)
    axes.text(0.88, -0.95, "the person's left", fontsize=11, ha="right")
    axes.set_aspect("equal")
    axes.axis("off")
    figure.tight_layout()
    figure.savefig(OUTPUT, dpi=90)
    print(OUTPUT)


if __name__ == "__main__":
    main()
