"""Trackers of the benchmarks by row name: hybrid, its parts, ablations, swarm."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from database_builder.build import THRESHOLD
from tests.support.suite import LONGEST, WORK, database
from toolkit.app.config import load_settings
from toolkit.app.pipeline import track_recording
from toolkit.app.pipeline.joint_choice import JointChoice
from toolkit.body.body import Body
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.scores import RunScores
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.io.errors import DepthMocapError
from toolkit.kernels import linear
from toolkit.people.sighting import Sighting
from toolkit.recordings.opening import open_upright
from toolkit.sensing.camera import Camera
from toolkit.trackers.baak2013 import Baak2013Tracker
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.trackers.qammaz.tracker import SwarmTrackerSettings
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.database_lookup import DatabaseLookup
from toolkit.tracking.search.local_search import LocalSearch
from toolkit.tracking.search.search_protocol import NOTHING, Proposal, ScoredHypothesis, Search
from toolkit.tracking.state import PersonState
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import FrameResult

ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "hybrid": ("hybrid", {}),
    "one pass": ("hybrid", {"passes": 1}),
    "local": ("hybrid", {"passes": 1, "patience": 1_000_000, "hypotheses": ["local", "extrema", "joints"]}),
    "baak2013": ("baak2013", {}),
    "baak2013 mixed": ("baak2013", {"sensing.contour": "mixed"}),
    "baak2013 local": ("baak2013", {}),
    "baak2013 lookup": ("baak2013", {"hypotheses": ["extrema"]}),
}
"""Row -> shipped settings and overrides; a single override equals one `--set`.

`local` takes only its first pose from the lookup. `baak2013` and its two halves are the paper's own
tracker (Fig. 5.12); `baak2013 mixed` keeps the contour as the hybrid tracker does (5.3.1).
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


class WatchedSearch(LocalSearch):
    """Local search that stores its last pose.

    Attributes
    ----------
    said : pose (P,) of the last frame, None without a previous pose
    """

    said: np.ndarray | None = None

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """See `Search.propose`."""
        proposal = super().propose(observation, state, rng, best)
        self.said = proposal.hypotheses[0].pose if proposal.hypotheses else None
        return proposal


class WatchedFollower(Follower):
    """Follower that stores the joints of each frame's local hypothesis.

    Attributes
    ----------
    local_joints : per step float64 (20, 3), camera frame, or None where there was no local hypothesis
    """

    def __init__(self, *parts: Any) -> None:
        super().__init__(*parts)
        self.local_joints: list[np.ndarray | None] = []

    def step(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> FrameResult:
        """See `Follower.step`."""
        watched = next(search for search in self.searches if isinstance(search, WatchedSearch))
        watched.said = None
        result = super().step(sighting, timestamp, clock)
        pose = watched.said
        self.local_joints.append(
            None if pose is None else linear.rotated(self.body.joint_positions(pose), self.level_rotation)
        )
        return result


class WatchedTracker(HybridTracker):
    """Hybrid tracker that exposes the local joints of its last follower.

    Attributes
    ----------
    local_joints : local hypotheses of the last follower, see `WatchedFollower`
    """

    kind = WatchedFollower

    def searches(self, objective: Objective, refiner: Refiner) -> tuple[Search, ...]:
        """See `HybridTracker.searches`."""
        local = WatchedSearch(refiner, self.settings.momentum)
        members = super().searches(objective, refiner)
        return tuple(local if isinstance(member, LocalSearch) else member for member in members)

    def follower(self, camera: Camera, level_rotation: np.ndarray, body: Body | None = None) -> Follower:
        """See `Tracker.follower`."""
        follower = super().follower(camera, level_rotation, body)
        assert isinstance(follower, WatchedFollower)
        self.local_joints = follower.local_joints
        return follower


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


class LocalBaak2013Tracker(LocalTracker, Baak2013Tracker):
    """Local optimisation of Baak 2013 only, after a first pose from its lookup."""


def settings_of(row: str, overrides: Mapping[str, Any] | None = None) -> HybridSettings:
    """Return the settings of a row with overrides."""
    config, own = ROWS[row]
    return load_settings(HybridSettings, config, {**(overrides or {}), **own})


def swarm_settings(row: str, overrides: Mapping[str, Any] | None = None) -> SwarmTrackerSettings:
    """Return the settings of a row; the row takes precedence over the overrides."""
    config, own = SWARM_ROWS[row]
    return load_settings(SwarmTrackerSettings, config, {**(overrides or {}), **own})


def make_tracker(
    row: str, database: PoseDatabase, overrides: Mapping[str, Any] | None = None, path: str = ""
) -> HybridTracker:
    """Return the tracker of a row; the row takes precedence over the overrides."""
    kind = KINDS.get(row, HybridTracker)
    return kind(database, settings_of(row, overrides), database_path=path)


KINDS: dict[str, type[HybridTracker]] = {
    "one pass": WatchedTracker,
    "local": LocalTracker,
    "baak2013": Baak2013Tracker,
    "baak2013 mixed": Baak2013Tracker,
    "baak2013 local": LocalBaak2013Tracker,
    "baak2013 lookup": Baak2013Tracker,
}
"""Tracker class of each row that is not a plain hybrid tracker."""


def figures_of(scores: RunScores) -> dict[str, Any]:
    """Return scores for JSON, with NaN as None and without the run folder."""
    figures = scores.flat()
    del figures["run"]
    unknown = {name for name, value in figures.items() if isinstance(value, float) and not np.isfinite(value)}
    return {name: None if name in unknown else value for name, value in figures.items()}


def add_take_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that select a part of the simulated suite."""
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--takes", type=int, help="at most so many takes of each group")
    parser.add_argument("--frames", type=int, default=LONGEST, help="at most so many frames of each take")


def add_database_options(parser: argparse.ArgumentParser) -> None:
    """Add the options for database, tracker settings and work folder; see `poses_of`."""
    parser.add_argument("--database", type=Path, help="another database than the simulated suite's own")
    parser.add_argument("--threshold", type=float, default=THRESHOLD, help="of the suite's own database, Eq. 5.1")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="setting of all trackers")
    parser.add_argument("--work", type=Path, default=WORK)


def poses_of(options: argparse.Namespace) -> Path:
    """Return the requested database, or build that of the suite if it is missing."""
    return options.database or database(options.work, options.threshold)


def track_each(
    runs: Mapping[Path, tuple[Path, Mapping[str, Any]]],
    tracker: Tracker,
    *,
    people: int | None = 1,
    joints: JointChoice | None = None,
) -> dict[Path, str]:
    """Track recordings into new run folders; return the failures by run folder.

    Parameters
    ----------
    runs : run folder -> the recording, and options of its reader
    tracker, people, joints : as of `track_recording`
    """
    failed = {}
    for i, (run, (path, options)) in enumerate(runs.items()):
        shutil.rmtree(run, ignore_errors=True)
        try:
            recording = open_upright(path, **options)
            if track_recording(recording, tracker, run, people=people, joints=joints, warm_up=i == 0).interrupted:
                raise SystemExit(f"stopped in {path.name}")
        except DepthMocapError as error:
            failed[run] = str(error)
        print(f"\r{i + 1} of {len(runs)} tracked", end="", flush=True)
    print()
    return failed
