"""The trackers that a benchmark compares: the hybrid one, its parts alone, and each improvement switched off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from toolkit.config import load_settings
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.scores import RunScores
from toolkit.sensing.recording import Recording
from toolkit.track import FrameResult
from toolkit.tracking.hybrid import HybridTracker
from toolkit.tracking.settings import HybridSettings
from toolkit.tracking.view import View

ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "hybrid": ("hybrid", {}),
    "local": ("hybrid", {"patience": 1_000_000, "hypotheses": ["local", "extrema", "joints"]}),
    "lookup": ("hybrid", {"hypotheses": ["extrema", "joints"]}),
    "baak2013": ("baak2013", {}),
    "no shape": ("hybrid", {"shape.frames": 0}),
    "no prior": ("hybrid", {"fitting.prior_weight": 0.0}),
    "no regressor": ("hybrid", {"hypotheses": ["local", "extrema", "arms"]}),
    "no cloud": ("hybrid", {"fitting.cloud_samples": 0}),
    "no arms": ("hybrid", {"hypotheses": ["local", "extrema", "joints"]}),
    "no contact": ("hybrid", {"fitting.contact_weight": 0.0}),
}
"""Name of the row, shipped settings that it starts from, and overrides.

`local` takes its first pose from the lookup and never asks it again. Without personal shape only the size is chosen,
out of five."""


class WatchedTracker(HybridTracker):
    """The hybrid tracker, which also keeps what the local hypothesis of each frame said.

    Attributes
    ----------
    local_joints : per frame since `start` float64 (20, 3), camera frame, or None where there was no local hypothesis
    """

    def start(self, recording: Recording) -> None:
        """See `Tracker.start`."""
        super().start(recording)
        self.local_joints: list[np.ndarray | None] = []

    def step(self, depth_mm: np.ndarray, timestamp: float) -> FrameResult:
        """See `Tracker.step`."""
        self._local: np.ndarray | None = None
        result = super().step(depth_mm, timestamp)
        self.local_joints.append(self._local)
        return result

    def _refined_locally(self, pose: np.ndarray, view: View) -> np.ndarray:
        local = super()._refined_locally(pose, view)
        self._local = self.memory.body.joint_positions(local) @ self.level_rotation
        return local


class LocalTracker(HybridTracker):
    """Local optimisation alone, after a first pose from the lookup."""

    def _retrieved(self, view: View, bound: float, asked: set[str]) -> dict[str, np.ndarray]:
        return {}


def settings_of(row: str, overrides: Mapping[str, Any] | None = None) -> HybridSettings:
    """Settings of a row with overrides on top."""
    config, own = ROWS[row]
    return load_settings(HybridSettings, config, {**(overrides or {}), **own})


def make_tracker(
    row: str, database: PoseDatabase, overrides: Mapping[str, Any] | None = None, path: str = ""
) -> HybridTracker:
    """The tracker of a row; the overrides apply to it unless the row itself says otherwise."""
    kind = {"hybrid": WatchedTracker, "local": LocalTracker}.get(row, HybridTracker)
    return kind(database, settings_of(row, overrides), database_path=path)


def figures_of(scores: RunScores) -> dict[str, Any]:
    """Figures by name for JSON, which does not know NaN; where the run lies on this machine is none of them."""
    figures = scores.flat()
    del figures["run"]
    unknown = {name for name, value in figures.items() if isinstance(value, float) and not np.isfinite(value)}
    return {name: None if name in unknown else value for name, value in figures.items()}
