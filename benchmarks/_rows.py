"""The trackers that benchmarks compare: the hybrid one, its parts alone, each improvement switched off, the swarm."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from database_builder.build import THRESHOLD
from database_builder.regressor import RegressorSettings
from toolkit import skeleton
from toolkit.body.body import Body
from toolkit.config import load_settings
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.scores import RunScores
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.hybrid.baak2013 import Baak2013Tracker
from toolkit.hybrid.settings import HybridSettings
from toolkit.hybrid.tracker import HybridTracker
from toolkit.kernels import linear
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.qammaz.discrepancy import Discrepancy
from toolkit.qammaz.search import ANGLES, SwarmSearch
from toolkit.qammaz.swarm import minimise
from toolkit.qammaz.tracker import SwarmTracker, SwarmTrackerSettings
from toolkit.sensing.camera import Camera
from toolkit.testing.suite import LONGEST, WORK, database
from toolkit.track import FrameResult
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower
from toolkit.tracking.observation import Observation, Observer
from toolkit.tracking.search.local import LocalSearch
from toolkit.tracking.search.lookup import DatabaseLookup
from toolkit.tracking.search.protocol import NOTHING, Proposal, ScoredHypothesis, Search
from toolkit.tracking.state import PersonState

ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "hybrid": ("hybrid", {}),
    "one pass": ("hybrid", {"passes": 1}),
    "local": ("hybrid", {"passes": 1, "patience": 1_000_000, "hypotheses": ["local", "extrema", "joints"]}),
    "baak2013": ("baak2013", {}),
    "baak2013 delete": ("baak2013", {"sensing.contour": "delete"}),
    "baak2013 local": ("baak2013", {}),
    "baak2013 lookup": ("baak2013", {"hypotheses": ["extrema"]}),
    "no unobserved": ("hybrid", {}),
    "no sharing": ("hybrid", {}),
    "no seated": ("hybrid", {}),
}
"""Name of the row, shipped settings that it starts from, and overrides; what one setting says, `--set` says.

`local` takes its first pose from the lookup and never asks it again. `baak2013` and its two halves are the paper's own
tracker (Fig. 5.12); `baak2013 delete` loses every pixel at a depth edge (5.3.1). `no unobserved` takes all that was not
measured as the person's for free space, but for what is outside the image; in `no sharing` no body says whose pixels
are whose; `no seated` leaves the bundled seated poses out of the database."""


NO_IMAGE = {"discrepancy.depth": 0.0}
NO_JOINTS = {"discrepancy.joints_2d": 0.0, "discrepancy.joints_3d": 0.0, "search.pulled": 0, "search.disagreement": 0.0}
PLAIN = {"swarm.perturbed_every": 0}
WEIGHTS = (0.5, 1.5, 3.0, 6.0, 18.0)
"""w_D of the paper's Table 3; 3 is its own, ours is 1."""
SWARM_ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "swarm": ("swarm", {}),
    "qammaz": ("qammaz", {}),
    "qammaz two phases": ("qammaz", {}),
    "qammaz depth": ("qammaz", NO_JOINTS),
    "qammaz joints": ("qammaz", NO_IMAGE),
    **{f"w_D {w:g}": ("qammaz", {"discrepancy.depth": w / 3.0}) for w in WEIGHTS},
    **{f"plain w_D {w:g}": ("qammaz", {"discrepancy.depth": w / 3.0, **PLAIN}) for w in WEIGHTS},
}
"""Name of the row, shipped settings that it starts from, and overrides. `qammaz two phases` goes on from each solution
with a second swarm on the depth alone (3.3), see `TwoPhaseTracker`."""

NOWHERE = 1e6
"""Metres from the camera: beyond every gate."""


class WatchedSearch(LocalSearch):
    """The local search, which also keeps what it said.

    Attributes
    ----------
    said : pose (P,) of the last frame, or None where there was none to go on from
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
    """A follower that keeps what the local hypothesis of each frame said.

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
    """The hybrid tracker, whose last follower can be looked into.

    Attributes
    ----------
    local_joints : what the last follower's local hypotheses said, see `WatchedFollower`
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
    """A search that is asked only where there is no previous pose."""

    def __init__(self, search: Search) -> None:
        self.name, self._search = search.name, search

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """See `Search.propose`."""
        return NOTHING if state.previous is not None else self._search.propose(observation, state, rng, best)


class LocalTracker(HybridTracker):
    """Local optimisation alone, after a first pose from the lookup."""

    def searches(self, objective: Objective, refiner: Refiner) -> tuple[Search, ...]:
        """See `HybridTracker.searches`."""
        members = super().searches(objective, refiner)
        return tuple(FirstFrames(member) if isinstance(member, DatabaseLookup) else member for member in members)


class LocalBaak2013Tracker(LocalTracker, Baak2013Tracker):
    """The paper's local optimisation alone, after a first pose from its lookup."""


class BlindObservation(Observation):
    """An observation that does not know which pixels say nothing."""

    def __init__(self, *parts: Any) -> None:
        observer, cloud, timestamp, state, _, joints = parts
        super().__init__(observer, cloud, timestamp, state, None, joints)


class BlindObserver(Observer):
    """Does not know which pixels say nothing."""

    kind = BlindObservation


class BlindTracker(HybridTracker):
    """The hybrid tracker, for which what was not measured is free."""

    @property
    def observer(self) -> Observer:
        """See `SearchingTracker.observer`."""
        known = super().observer
        return BlindObserver(**{entry.name: getattr(known, entry.name) for entry in fields(known)})


class UnsharingFollower(Follower):
    """A follower whose body is nowhere, so that it claims no pixels."""

    def predicted(self) -> PredictedBody:
        """See `PersonFollower.predicted`."""
        body = super().predicted()
        return PredictedBody(np.full_like(body.vertices, NOWHERE), body.faces, body.stature)


class UnsharingTracker(HybridTracker):
    """The hybrid tracker, whose bodies do not say whose pixels are whose."""

    kind = UnsharingFollower


class TwoPhaseSearch(SwarmSearch):
    """A swarm, and around its solution a second one, whose objective is the depth term alone (Qammaz, 3.3)."""

    def _finished(self, frame: Any, body: Body, costs: Discrepancy, position: np.ndarray) -> Any:
        """The solution of the second phase as a pose."""
        pose, s = costs.pose_of(position), self._settings
        settings = replace(self._discrepancy, joints_2d=0.0, joints_3d=0.0)
        depth = frame.discrepancy(body, pose, settings, previous=True)
        starts, half = depth.position_of(pose[None]), np.full(len(pose), s.window)
        half[skeleton.ROOT_POSITION] = s.reach
        limits = self._window(starts[0], half)
        # Of its own randomness, so that the first phase is that of the row beside it.
        rng = np.random.default_rng(0)
        second = minimise(depth, starts, limits, self._swarm, rng, perturbed=ANGLES).position
        return super()._finished(frame, body, depth, second)


class TwoPhaseTracker(SwarmTracker):
    """The paper's tracker with a second phase."""

    def searches(self, objective: Objective, refiner: Refiner) -> tuple[Search, ...]:
        """See `SwarmTracker.searches`."""
        s = self.settings
        return (TwoPhaseSearch(s.search, s.swarm, s.discrepancy, objective, refiner),)


def settings_of(row: str, overrides: Mapping[str, Any] | None = None) -> HybridSettings:
    """Settings of a row with overrides on top."""
    config, own = ROWS[row]
    return load_settings(HybridSettings, config, {**(overrides or {}), **own})


def swarm_settings(row: str, overrides: Mapping[str, Any] | None = None) -> SwarmTrackerSettings:
    """Settings of a row; the overrides apply unless the row itself says otherwise."""
    config, own = SWARM_ROWS[row]
    return load_settings(SwarmTrackerSettings, config, {**(overrides or {}), **own})


def make_tracker(
    row: str, database: PoseDatabase, overrides: Mapping[str, Any] | None = None, path: str = ""
) -> HybridTracker:
    """The tracker of a row; the overrides apply to it unless the row itself says otherwise."""
    kind = KINDS.get(row, HybridTracker)
    if row == "no seated":
        database = without_sources(database, "seated_")
    return kind(database, settings_of(row, overrides), database_path=path)


def without_sources(database: PoseDatabase, prefix: str) -> PoseDatabase:
    """A database without the poses whose source's name begins so; its regressor and prior stay as they are."""
    kept = np.array([not name.startswith(prefix) for name in database.sources])[database.pose_source]
    names = ("poses", "joints", "features", "offsets", "pose_source", "pose_frame", "mirrored")
    return replace(database, **{name: getattr(database, name)[kept] for name in names})


KINDS: dict[str, type[HybridTracker]] = {
    "one pass": WatchedTracker,
    "local": LocalTracker,
    "baak2013": Baak2013Tracker,
    "baak2013 delete": Baak2013Tracker,
    "baak2013 local": LocalBaak2013Tracker,
    "baak2013 lookup": Baak2013Tracker,
    "no unobserved": BlindTracker,
    "no sharing": UnsharingTracker,
}
"""What is built for a row, where it is no plain hybrid tracker."""
SWARM_KINDS: dict[str, type[SwarmTracker]] = {"qammaz two phases": TwoPhaseTracker}
"""The same of `SWARM_ROWS`."""


def figures_of(scores: RunScores) -> dict[str, Any]:
    """Figures by name for JSON, which does not know NaN; where the run lies on this machine is none of them."""
    figures = scores.flat()
    del figures["run"]
    unknown = {name for name, value in figures.items() if isinstance(value, float) and not np.isfinite(value)}
    return {name: None if name in unknown else value for name, value in figures.items()}


def add_take_options(parser: argparse.ArgumentParser) -> None:
    """Which part of the simulated suite."""
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--takes", type=int, help="at most so many takes of each group")
    parser.add_argument("--frames", type=int, default=LONGEST, help="at most so many frames of each take")


def add_database_options(parser: argparse.ArgumentParser) -> None:
    """With which database, settings of the trackers and work folder; see `poses_of`."""
    parser.add_argument("--database", type=Path, help="another database than the simulated suite's own")
    parser.add_argument("--threshold", type=float, default=THRESHOLD, help="of the suite's own database, Eq. 5.1")
    parser.add_argument("--images", type=int, default=RegressorSettings.images, help="that train its joint regressor")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="setting of all trackers")
    parser.add_argument("--work", type=Path, default=WORK)


def poses_of(options: argparse.Namespace) -> Path:
    """The database that was asked for; the suite's own is made if it is not there yet."""
    return options.database or database(options.work, options.threshold, RegressorSettings(images=options.images))
