"""Steady times: one processor, percentiles."""

from __future__ import annotations

import os

import numpy as np


def pin_to_one_processor() -> None:
    """Keep this process on one processor, so that the scheduler does not move it between samples (Linux only)."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def percentiles(milliseconds: list[float] | np.ndarray) -> dict[str, float]:
    """Median, 99th and 99.9th percentile of times in milliseconds, three digits behind the point."""
    values = np.percentile(milliseconds, [50, 99, 99.9])
    return dict(zip(("median_ms", "p99_ms", "p999_ms"), np.round(values, 3).tolist(), strict=True))
