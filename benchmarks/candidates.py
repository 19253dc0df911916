"""Do the lookup's queries name all five end effectors rightly? `depthmocap bench candidates [--split report]`.

The hybrid tracker runs over the simulated suite and over every so many real recordings. In the frames in which extrema
query the database, three things are asked: whether the first five geodesic extrema are the five end effectors (within
0.2 m); whether they are among all extrema; and whether one of the queries holds all five under their names. Of
simulated frames those count in which all five are visible and free of the body by 0.25 m of geodesic distance; of real
frames all, against the skeleton of the Kinect SDK.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._options import add_database_options, add_take_options, poses_of
from benchmarks._record import save_figures
from benchmarks._rows import settings_of
from benchmarks.real import RECORDINGS
from toolkit.config import parse_overrides
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.extrema import FOUND, TIPS, all_found, all_free
from toolkit.evaluation.joints import visible_joints
from toolkit.hybrid.settings import HybridSettings
from toolkit.hybrid.tracker import HybridTracker
from toolkit.recordings.opening import open_recording
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.testing.suite import GROUPS, LONGEST, chosen_takes, record
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.extrema import ExtremaQuery
from toolkit.tracking.search.lookup import Query
from toolkit.tracking.solo import Solo
from toolkit.tracking.state import Previous


class WatchedQuery(ExtremaQuery):
    """Keeps the frame that it was asked about, and its queries.

    Attributes
    ----------
    observation : the last frame, if it was asked about
    asked : its labelled end effectors (M, 5, 3), level frame, NaN where absent
    """

    observation: Observation | None = None

    def queries(self, observation: Observation, previous: Previous | None) -> tuple[np.ndarray, np.ndarray]:
        """See `ExtremaQuery.queries`."""
        points, present = super().queries(observation, previous)
        self.observation, self.asked = observation, np.where(present[:, :, None], points, np.nan)
        return points, present


class WatchedLookupTracker(HybridTracker):
    """The hybrid tracker with a query that can be looked into."""

    def __init__(self, poses: PoseDatabase, settings: HybridSettings) -> None:
        super().__init__(poses, settings)
        self.watched = WatchedQuery(poses, settings.lookup)

    def queries(self) -> list[Query]:
        """See `HybridTracker.queries`."""
        return [self.watched if isinstance(query, ExtremaQuery) else query for query in super().queries()]


def hits_of(
    tracker: WatchedLookupTracker, recording: Recording, reference: np.ndarray, every_frame: bool
) -> list[list[bool]]:
    """Per frame that counts: first five, all extrema, a query. `reference` (T, 20, 3), camera frame."""
    solo = Solo(tracker, recording)
    hits = []
    for i, frame in enumerate(recording.stream()):
        tracker.watched.observation = None
        solo.step(frame.depth_mm, frame.timestamp)
        seen = tracker.watched.observation
        truth = reference[i].astype(np.float64) @ solo.level_rotation.T
        ends = truth[TIPS]
        if seen is None or not np.isfinite(ends).all():
            continue
        if not every_frame and not counts(seen.cloud, truth, reference[i], tracker):
            continue
        extrema = seen.extrema.points.astype(np.float64)
        gaps = np.linalg.norm(tracker.watched.asked - ends, axis=2)
        hits.append([all_found(extrema[:5], ends), all_found(extrema, ends), bool((gaps < FOUND).all(axis=1).any())])
    return hits


def counts(cloud: Cloud, truth: np.ndarray, joints: np.ndarray, tracker: HybridTracker) -> bool:
    """Whether all five end effectors are visible and free; truth (20, 3) level frame, joints the same, camera frame."""
    seen = visible_joints(joints, cloud.depth, cloud.camera)[TIPS].all()
    return bool(seen) and all_free(cloud, truth, tracker.settings.landmarks)


def shares(hits: Sequence[Sequence[bool]]) -> dict[str, Any]:
    """As JSON."""
    means = np.mean(np.array(hits, dtype=float), axis=0) if hits else [None] * 3
    return {
        "frames": len(hits),
        **dict(zip(("first_five", "all_extrema", "queries"), map(_number, means), strict=True)),
    }


def _number(value: Any) -> float | None:
    return None if value is None else float(value)


def main() -> None:
    """Track, count, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_take_options(parser)
    parser.add_argument("--stride", type=int, default=4, help="every so many real recordings")
    parser.add_argument("--recordings", type=Path, default=RECORDINGS, help="folder of UTD-MHAD")
    add_database_options(parser)
    options = parser.parse_args()
    poses = PoseDatabase.load(poses_of(options))
    settings = settings_of("hybrid", parse_overrides(options.set))
    tracker = WatchedLookupTracker(poses, settings)
    figures: dict[str, Any] = {}
    for group in GROUPS:
        takes = [
            record(take, options.work, options.frames) for take in chosen_takes(options.split, [group], options.takes)
        ]
        recordings = [open_recording(path) for path in takes]
        hits = [hit for recording in recordings for hit in hits_of(tracker, recording, recording.joints, False)]
        figures[group] = hits
    figures["simulated"] = [hit for hits in figures.values() for hit in hits]
    real = [open_recording(path) for path in sorted(options.recordings.glob("*_depth.mat"))[:: options.stride]]
    figures["real"] = [hit for r in real for hit in hits_of(tracker, r, r.reference_joints, True)]
    rows = {name: shares(hits) for name, hits in figures.items()}
    print(f"{'':<10}{'frames':>7}{'first five %':>14}{'all extrema %':>14}{'a query %':>11}")
    for name, row in rows.items():
        cells = (
            "-" if row[key] is None else f"{100 * row[key]:.1f}" for key in ("first_five", "all_extrema", "queries")
        )
        print(f"{name:<10}{row['frames']:7d}", "{:>13}{:>14}{:>11}".format(*cells))
    whole = options.takes is None and options.frames >= LONGEST and not options.set
    described = {"split": options.split, "stride": options.stride, "tracker": asdict(settings)}
    print("written:", save_figures(f"candidates_{options.split}{'' if whole else '_part'}", rows, described))


if __name__ == "__main__":
    main()
