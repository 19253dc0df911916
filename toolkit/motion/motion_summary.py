"""Clinical summary of a track: gait, sit-to-stand, and ranges of motion of both sides."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from toolkit.motion.angles import JOINTS, Angles, joint_angles
from toolkit.motion.gait import Gait, walk_of
from toolkit.motion.rising import Rise, rises_of
from toolkit.tracks.runs import Person

PAIRED = tuple(
    (joint.joint.removeprefix("left_"), motion)
    for joint in JOINTS
    if joint.joint.startswith("left_")
    for motion in joint.motions
    if motion
)
"""Joint and motion of the angles of both sides."""


class AngleRanges(NamedTuple):
    """Smallest and largest angle of the left and of the right side, degrees."""

    joint: str
    motion: str
    left: tuple[float, float]
    right: tuple[float, float]


class Summary(NamedTuple):
    """Figures of one person."""

    gait: Gait
    rises: tuple[Rise, ...]
    ranges: tuple[AngleRanges, ...]
    angles: Angles


def summary_of(person: Person) -> Summary:
    """Return the figures over all frames with the person."""
    track, known = person.track, person.there
    angles = joint_angles(person.body, track.pose, known)
    return Summary(
        walk_of(person.body, track.pose, track.timestamps, known),
        rises_of(person.body, track.pose, track.timestamps, known),
        _ranges_of(angles),
        angles,
    )


def _ranges_of(angles: Angles) -> tuple[AngleRanges, ...]:
    """Return the ranges of the angles of both sides; NaN for a person without a frame."""
    found = []
    extremes = (1.0, 99.0)  # percentiles that bound a range of motion, so that a single wrong frame does not widen it
    for joint, motion in PAIRED:
        sides = []
        for side in ("left", "right"):
            number = next(i for i, known in enumerate(JOINTS) if known.joint == f"{side}_{joint}")
            values = angles.of(f"{side}_{joint}_{motion}")[~angles.locked[:, number]]
            values = values[np.isfinite(values)]
            low, high = np.percentile(values, extremes) if len(values) else (np.nan, np.nan)
            sides.append((float(low), float(high)))
        found.append(AngleRanges(joint, motion, *sides))
    return tuple(found)


def as_plain(summary: Summary) -> dict[str, Any]:
    """Return the figures as JSON values; unknown numbers are None."""

    def plain(value: float) -> float | None:
        return round(value, 4) if np.isfinite(value) else None

    return {
        "gait": {name: plain(value) for name, value in summary.gait.figures().items()} | {"note": summary.gait.note},
        "strides": [
            {"side": s.side, "start_s": plain(s.start), "toe_off_s": plain(s.lift), "end_s": plain(s.end),
             "length_m": plain(s.length), "width_m": plain(s.width), "step_m": plain(s.step),
             "stance_share": plain(s.stance)}
            for s in summary.gait.strides
        ],
        "rises": [
            {"kind": "sit-to-stand" if rise.seated else "squat", "start_s": plain(rise.start),
             "duration_s": plain(rise.duration), "lowest_hips_m": plain(rise.lowest)}
            for rise in summary.rises
        ],
        "ranges_deg": [
            {"joint": r.joint, "motion": r.motion, "left": [plain(v) for v in r.left],
             "right": [plain(v) for v in r.right]}
            for r in summary.ranges
        ],
    }  # fmt: skip
