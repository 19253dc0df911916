"""Rows of the benchmark of upper bodies: shipped settings and overrides."""

from __future__ import annotations

from typing import Any

ROWS: dict[str, tuple[str | None, dict[str, Any]]] = {
    "hybrid": ("hybrid", {}),
    "hybrid alone": ("hybrid", {"hypotheses": ["local", "extrema", "joints", "arms"]}),
    "lopez2011": ("lopez2011", {}),
    "plain": ("lopez2011", {"particles.alpha": 1.0}),
    "tree": ("lopez2011", {"effectors.tree": True}),
    "six": ("lopez2011", {"effectors.count": 6}),
    "unlabelled": ("lopez2011", {"effectors.count": 6, "initial.unlabelled": True}),
    "particles": (None, {"tracker": "particles"}),
    "lopez2011 192": ("lopez2011", {"particles.count": 192}),
    "lopez2011 256": ("lopez2011", {"particles.count": 256}),
    "particles 192": (None, {"tracker": "particles", "particles.count": 192}),
}
"""Name of the row, settings that it starts from, and overrides. `plain` is blind to the candidates, `tree` takes them
from the component tree, `six` takes six extrema, `unlabelled` does not wait for a fork, and `particles`, the tracker's
own defaults, lets local optimisation compete as well; `hybrid alone` is the
hybrid tracker without the filter's first poses."""
