"""Gait, rises and joint angles: `depthmocap bench gait --database suite.npz`.

Simulated people who walk, squat and rise (`benchmarks/_movement.py`), tracked. Each figure of a report is compared with
that of the true poses: mean absolute errors over the takes; of joint angles the root mean square over the frames and
the error of the range of motion, degrees.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks._movement import TAKES, Tracked, movement_options, tracked
from benchmarks._record import save_figures
from toolkit.biomechanics.angles import COLUMNS
from toolkit.biomechanics.summary import Summary, summary_of

FIGURES = (
    "strides", "stride_length_m", "cadence_steps_per_min", "speed_m_per_s", "step_width_m", "stance_share",
    "stride_time_s",
)  # fmt: skip


def compared(found: Tracked) -> dict[str, Any]:
    """Measured and true figures of one take."""
    measured, true = summary_of(found.person), summary_of(found.truth)
    return {
        "gait": {name: [s.gait.figures()[name] for s in (measured, true)] for name in FIGURES},
        "rises": [[len(s.rises), sum(r.seated for r in s.rises)] for s in (measured, true)],
        "rise_durations_s": [[r.duration for r in s.rises] for s in (measured, true)],
        "angles_rms_deg": angle_errors(measured, true),
        "ranges_deg": {
            f"{a.joint}_{a.motion}": [[*a.left, *a.right], [*b.left, *b.right]]
            for a, b in zip(measured.ranges, true.ranges, strict=True)
        },
    }


def angle_errors(measured: Summary, true: Summary) -> dict[str, float]:
    """Root mean square error of every angle, degrees."""
    off = measured.angles.degrees - true.angles.degrees
    off = (off + 180.0) % 360.0 - 180.0
    return dict(zip(COLUMNS, np.sqrt(np.nanmean(off**2, axis=0)).round(2).tolist(), strict=True))


def summed(takes: dict[str, dict[str, Any]]) -> dict[str, float]:
    """Mean absolute errors over the takes."""
    out: dict[str, list[float]] = {}
    for take in takes.values():
        for name, (a, b) in take["gait"].items():
            if np.isfinite([a, b]).all() and name != "strides":
                out.setdefault(name, []).append(abs(a - b))
        if take["rises"][0] == take["rises"][1]:
            for a, b in zip(*take["rise_durations_s"], strict=True):
                out.setdefault("rise_duration_s", []).append(abs(a - b))
        for name, (own, true) in take["ranges_deg"].items():
            widths = [np.array([r[1] - r[0], r[3] - r[2]]) for r in (own, true)]
            if np.isfinite(widths).all():
                out.setdefault(f"{name}_deg", []).extend(np.abs(widths[0] - widths[1]).tolist())
    return {name: float(np.mean(values)) for name, values in out.items()}


def main() -> None:
    options = movement_options(__doc__)
    takes = {}
    for take in TAKES:
        if take.name in options.takes.split(","):
            takes[take.name] = compared(tracked(take, options.work, options.database))
            print(take.name, {k: np.round(v, 3).tolist() for k, v in takes[take.name]["gait"].items()}, flush=True)
            print("   rises", takes[take.name]["rises"], takes[take.name]["rise_durations_s"], flush=True)
    rms = {c: float(np.mean([t["angles_rms_deg"][c] for t in takes.values()])) for c in COLUMNS}
    figures = {"mean_absolute_errors": summed(takes), "angles_rms_deg": rms, "takes": takes}
    for name in ("mean_absolute_errors", "angles_rms_deg"):
        print(name, {k: round(v, 3) for k, v in figures[name].items()})
    print(save_figures("gait", figures, vars(options)))


if __name__ == "__main__":
    main()
