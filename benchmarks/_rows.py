"""Trackers of the benchmarks by row name: hybrid, its parts, the published tracker, swarm."""

import argparse
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tests.support.suite import LONGEST, WORK, database
from toolkit.app.config import load_settings
from toolkit.app.pipeline import track_recording
from toolkit.app.pipeline.image_joints import JointChoice
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.scores import RunScores
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.io.errors import DepthMocapError
from toolkit.recordings.opening import open_upright
from toolkit.trackers.baak2013 import Baak2013Tracker
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.trackers.qammaz.tracker import SwarmTrackerSettings
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.database_lookup import DatabaseLookup
from toolkit.tracking.search.search_protocol import NOTHING, Proposal, ScoredHypothesis, Search
from toolkit.tracking.state import PersonState
from toolkit.tracking.tracker_protocol import Tracker

ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "hybrid": ("hybrid", {}),
    "one pass": ("hybrid", {"passes": 1}),
    "local": ("hybrid", {"passes": 1, "patience": 1_000_000, "hypotheses": ["local", "extrema", "joints", "arms"]}),
    "baak2013": ("baak2013", {}),
    "baak2013 mixed": ("baak2013", {"sensing.contour": "mixed"}),
    "baak2013 local": ("baak2013", {"lookup_period": 1_000_000}),
    "baak2013 lookup": ("baak2013", {"hypotheses": ["extrema"]}),
}
"""Row -> shipped settings and overrides; a single override equals one `--set`.

`local` and `baak2013 local` take only their first pose from the lookup. `baak2013` and its two halves are the paper's
own tracker (Fig. 5.12); `baak2013 mixed` keeps the contour as the hybrid tracker does (5.3.1).
"""


NO_IMAGE = {"discrepancy.depth": 0.0}
NO_JOINTS = {"discrepancy.joints_2d": 0.0, "discrepancy.joints_3d": 0.0, "search.pulled": 0, "search.disagreement": 0.0}
SWARM_ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "swarm": ("swarm", {}),
    "qammaz": ("qammaz", {}),
    "qammaz depth": ("qammaz", NO_JOINTS),
    "qammaz joints": ("qammaz", NO_IMAGE),
}
"""Row -> shipped settings that it starts from, and overrides."""


class FirstFrames:
    """Search that is used only without a previous pose."""

    def __init__(self, search: Search) -> None:
        self.name, self._search = search.name, search

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """See `Search.propose`."""
        return NOTHING if state.previous is not None else self._search.propose(observation, state, rng, best)


class LocalTracker(HybridTracker):
    """Local optimisation only, after a first pose from the lookup."""

    def searches(self, objective: Objective, refiner: Refiner) -> tuple[Search, ...]:
        """See `HybridTracker.searches`."""
        members = super().searches(objective, refiner)
        return tuple(FirstFrames(member) if isinstance(member, DatabaseLookup) else member for member in members)


def settings_of(row: str, overrides: Mapping[str, Any] | None = None) -> HybridSettings:
    """Return the settings of a row; the row takes precedence over the overrides."""
    config, own = ROWS[row]
    return load_settings(HybridSettings, config, {**(overrides or {}), **own})


def swarm_settings(row: str, overrides: Mapping[str, Any] | None = None) -> SwarmTrackerSettings:
    """Return the settings of a row of `SWARM_ROWS`; the row takes precedence over the overrides."""
    config, own = SWARM_ROWS[row]
    return load_settings(SwarmTrackerSettings, config, {**(overrides or {}), **own})


def make_tracker(row: str, poses: Path, overrides: Mapping[str, Any] | None = None) -> HybridTracker:
    """Return the tracker of a row with the pose database of a file."""
    kind = LocalTracker if row == "local" else Baak2013Tracker if row.startswith("baak2013") else HybridTracker
    return kind(PoseDatabase.load(poses), settings_of(row, overrides), database_path=str(poses))


def figures_of(scores: RunScores) -> dict[str, Any]:
    """Return scores for JSON, with NaN as None and without the run folder."""
    figures = scores.flat()
    del figures["run"]
    unknown = {name for name, value in figures.items() if isinstance(value, float) and not np.isfinite(value)}
    return {name: None if name in unknown else value for name, value in figures.items()}


SPLIT = {"split": ("tune", "report")}
"""Option that selects people: those of tuning, or those of published figures."""
TAKES: dict[str, Any] = {
    **SPLIT,
    "takes": {"type": int, "help": "maximum number of takes of each group"},
    "frames": LONGEST,
}
"""Options that select a part of the simulated suite."""
DATABASE: dict[str, Any] = {
    "database": {"type": Path, "help": "another database than the simulated suite's own"},
    "set": {"action": "append", "default": [], "metavar": "NAME=VALUE", "help": "setting of all trackers"},
    "work": WORK,
}
"""Options for database, tracker settings and work folder; see `poses_of`."""


def poses_of(options: argparse.Namespace) -> Path:
    """Return the requested database, or build that of the suite if it is missing."""
    return options.database or database(options.work)


def track_each(
    runs: Mapping[Path, tuple[Path, Mapping[str, Any]]],
    tracker: Tracker,
    *,
    people: int | None = 1,
    joints: JointChoice | None = None,
) -> dict[Path, str]:
    """Track recordings, each with options of its reader, into run folders; return the failures by run folder."""
    failed = {}
    for i, (run, (path, options)) in enumerate(runs.items()):
        shutil.rmtree(run, ignore_errors=True)
        try:
            recording = open_upright(path, **options)
            if track_recording(recording, tracker, run, people=people, joints=joints).interrupted:
                raise SystemExit(f"stopped in {path.name}")
        except DepthMocapError as error:
            failed[run] = str(error)
            print(f"\n{run.name} was not tracked: {error}")
        print(f"\r{i + 1} of {len(runs)} tracked", end="", flush=True)
    print()
    return failed
