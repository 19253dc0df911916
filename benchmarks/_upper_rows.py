"""Rows of the benchmark of upper bodies: shipped settings and overrides."""

from __future__ import annotations

from typing import Any

ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "hybrid": ("hybrid", {}),
    "hybrid alone": ("hybrid", {"hypotheses": ["local", "extrema", "joints", "arms"]}),
    "lopez2011": ("lopez2011", {}),
    "lopez2011 64": ("lopez2011", {"particles.count": 64}),
    "particles": ("particles", {}),
    "particles 192": ("particles", {"particles.count": 192}),
}
"""Name of the row, settings that it starts from, and overrides. `hybrid alone` is the hybrid tracker without the
filter's first poses, `particles` lets local optimisation compete, numbers are particles in each layer."""
