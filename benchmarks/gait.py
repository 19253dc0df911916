"""Gait, rises and joint angles: `depthmocap bench gait`.

Simulated people walk, squat and rise (`benchmarks/_movement.py`); tracks are filtered as in a report. Figures of gait
and rises are compared with a reference without the project's analysis (`tests/support/plain_gait.py`). The analysis of
the true poses is a lower bound of the error of any tracker. Joint angles and ranges of motion are compared with
those of the true poses, degrees.
"""

import argparse
from typing import Any

import numpy as np

from benchmarks._movement import OPTIONS, RATE, TAKES, Take, Tracked, tracked
from benchmarks._record import benchmark, script
from tests.support.plain_gait import planned_rises, planned_walk, walk_on_ground
from tests.support.walking import Rising, Walk
from toolkit.motion.angles import COLUMNS
from toolkit.motion.motion_summary import Summary, summary_of
from toolkit.motion.resting import at_rest

WAYS = ("tracked", "true poses")


def compared(take: Take, found: Tracked) -> dict[str, Any]:
    """Return figures of one take, tracked and of the true poses, beside the reference."""
    known: dict[str, float] = {}
    if isinstance(take.motion, Walk):
        known = planned_walk(take.motion)
    elif not isinstance(take.motion, Rising):
        known = walk_on_ground(found.body, found.poses, RATE)
    summaries = [summary_of(person) for person in (at_rest(found.person), found.truth)]
    return {
        "strides": [len(summary.gait.strides) for summary in summaries],
        "known": known,
        "gait": [summary.gait.figures() for summary in summaries],
        "known_rises": planned_rises(take.motion) if isinstance(take.motion, Rising) else [],
        "rises": [[(rise.start, rise.duration, rise.seated) for rise in summary.rises] for summary in summaries],
        "angles_rms_deg": angle_errors(*summaries),
        "ranges_deg": {
            f"{a.joint}_{a.motion}": [[*a.left, *a.right], [*b.left, *b.right]]
            for a, b in zip(summaries[0].ranges, summaries[1].ranges, strict=True)
        },
    }


def angle_errors(measured: Summary, true: Summary) -> dict[str, float]:
    """Return the root mean square error of each angle, degrees."""
    off = measured.angles.degrees - true.angles.degrees
    off = (off + 180.0) % 360.0 - 180.0
    return dict(zip(COLUMNS, np.sqrt(np.nanmean(off**2, axis=0)).round(2).tolist(), strict=True))


def known_errors(takes: dict[str, dict[str, Any]], way: int) -> dict[str, float]:
    """Return mean absolute errors of one of `WAYS` against the reference, over the takes."""
    out: dict[str, list[float]] = {}
    for take in takes.values():
        for name, known in take["known"].items():
            if np.isfinite(take["gait"][way][name]):
                out.setdefault(name, []).append(abs(take["gait"][way][name] - known))
        if len(take["rises"][way]) == len(take["known_rises"]):
            for (start, duration, _), (begin, lasts) in zip(take["rises"][way], take["known_rises"], strict=True):
                out.setdefault("rise_start_s", []).append(abs(start - begin))
                out.setdefault("rise_duration_s", []).append(abs(duration - lasts))
    return {name: float(np.mean(values)) for name, values in out.items()}


def range_errors(takes: dict[str, dict[str, Any]]) -> dict[str, float]:
    """Return mean absolute errors of the ranges of motion, degrees, over the takes and both sides."""
    out: dict[str, list[float]] = {}
    for take in takes.values():
        for name, (own, true) in take["ranges_deg"].items():
            widths = [np.array([r[1] - r[0], r[3] - r[2]]) for r in (own, true)]
            if np.isfinite(widths).all():
                out.setdefault(f"{name}_deg", []).extend(np.abs(widths[0] - widths[1]).tolist())
    return {name: float(np.mean(values)) for name, values in out.items()}


@benchmark(OPTIONS)
def gait(options: argparse.Namespace) -> tuple[str, Any]:
    """Track, filter and compare all recordings."""
    takes = {take.name: compared(take, tracked(take, options.work, options.database)) for take in TAKES}
    return "gait", {
        "mean_absolute_errors": {way: known_errors(takes, k) for k, way in enumerate(WAYS)},
        "ranges": range_errors(takes),
        "angles_rms_deg": {c: float(np.mean([t["angles_rms_deg"][c] for t in takes.values()])) for c in COLUMNS},
        "takes": takes,
    }


main = script(__name__, __doc__, gait)
