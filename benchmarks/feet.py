"""Foot contact: `depthmocap bench feet [--real]`.

Recordings are the synthetic motions of `benchmarks/_movement.py`, and the takes of the suite's report split with a
fixed floor (no treadmill, no turn on the spot). Foot contacts are the true ones.

sliding
    Root mean square distance along the floor of the sole in contact (of heel and ball the one that moves less) from its
    mean place, step by step.
jitter
    The same of the ankles of a person who stands still on both feet, about their course (a Gaussian of 0.15 s).

Feet of mocap on a body of another size slide in truth too, so both figures are also given of the truth, and of the
tracked place minus the true one. Tracks are measured unfiltered and filtered (`motion.resting`), filtered ones with the
errors of all joints. `--real` adds every fifth recording of UTD-MHAD without truth; its contacts are the detected ones.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._movement import OPTIONS, TAKES, Tracked, tracked, tracked_run, tracked_shot
from benchmarks._record import benchmark, script
from tests.support import suite
from tests.support.casting import Scene
from tests.support.scenes import people_of, shot_of
from toolkit.body import skeleton
from toolkit.body.shape import subject_body
from toolkit.body.sole import soles
from toolkit.io.spans import spans
from toolkit.motion.contact import smoothed
from toolkit.motion.resting import at_rest
from toolkit.tracks import TRACKED
from toolkit.tracks.runs import Person

SHORTEST = 5
"""Minimum number of frames of a measured step."""
COURSE = 0.15
"""Standard deviation of the course filter, seconds."""
STILL = 0.05
"""Maximum speed of a standing person, m/s: the faster ankle along its course."""
ANKLES = [skeleton.REPORTED.index(f"{side}_ankle") for side in ("left", "right")]
MEANS = ("sliding_mm", "sliding_beside_truth_mm", "jitter_mm", "jitter_beside_truth_mm", "error_mm", "contacts_right")


class Feet(NamedTuple):
    """Positions of the feet: heel and ball of both (T, 2, 2, 3), level frame, and the ankles (T, 2, 3), metres."""

    soles: np.ndarray
    ankles: np.ndarray

    @classmethod
    def of(cls, person: Person) -> Feet:
        """Return the feet of a track."""
        ankles = person.track.joints[:, ANKLES].astype(np.float64) @ person.R_level_camera.T
        return cls(soles(person.body, person.track.pose), ankles)

    def minus(self, other: Feet) -> Feet:
        """Return differences in position."""
        return Feet(self.soles - other.soles, self.ankles - other.ankles)


def sliding_mm(placed: np.ndarray, contact: np.ndarray) -> list[float]:
    """Return the root mean square sliding of each step of soles (T, 2, 2, 3), without its first and last frame."""
    rows = []
    for side in range(2):
        for span in spans(contact[:, side]):
            inner = slice(span.start + 1, span.stop - 1)
            if inner.stop - inner.start < SHORTEST:
                continue
            flat = placed[inner, side][..., [0, 2]]
            off = np.linalg.norm(flat - flat.mean(axis=0), axis=2)
            rows.append(1000.0 * float(np.sqrt((off**2).mean(axis=0)).min()))
    return rows


def jitter_mm(ankles: np.ndarray, still: np.ndarray, times: np.ndarray) -> float | None:
    """Return the RMS distance of ankles (T, 2, 3) from their course while the person stands `still` (T,)."""
    parts = []
    for span in spans(still):
        if span.stop - span.start >= 2 * SHORTEST:
            rows = ankles[span]
            parts.append(np.linalg.norm(rows - smoothed(rows, times[span], COURSE), axis=2).ravel())
    return 1000.0 * float(np.sqrt((np.concatenate(parts) ** 2).mean())) if parts else None


def stands_still(feet: Feet, contact: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return frames with both feet in contact and both ankles at rest: bool (T,)."""
    if len(times) < 2:
        return np.asarray(contact.all(axis=1))
    speeds = np.linalg.norm(np.gradient(smoothed(feet.ankles, times, COURSE), times, axis=0), axis=2)
    return np.asarray(contact.all(axis=1) & (speeds < STILL).all(axis=1))


def row(feet: Feet, contact: np.ndarray, still: np.ndarray, times: np.ndarray) -> dict[str, Any]:
    """Return figures of feet during `contact` (T, 2)."""
    steps = sliding_mm(feet.soles, contact)
    return {"sliding_mm": float(np.mean(steps)) if steps else None, "jitter_mm": jitter_mm(feet.ankles, still, times)}


def simulated(found: Tracked) -> dict[str, Any]:
    """Return figures of a person with true poses, by the placement of the feet."""
    times, truth = found.person.track.timestamps, found.truth
    known, true = found.person.track.state == TRACKED, Feet.of(truth)
    contact = truth.track.contact & known[:, None]
    still = stands_still(true, contact, times)
    figures: dict[str, Any] = {"true": row(true, contact, still, times)}
    for way, person in {"tracked": found.person, "resting": at_rest(found.person)}.items():
        own, errors = Feet.of(person), 1000.0 * np.linalg.norm(person.track.joints - truth.track.joints, axis=2)
        beside = row(own.minus(true), contact, still, times)
        figures[way] = row(own, contact, still, times) | {
            "sliding_beside_truth_mm": beside["sliding_mm"],
            "jitter_beside_truth_mm": beside["jitter_mm"],
            "error_mm": float(errors.mean()),
            "contacts_right": float((person.track.contact == truth.track.contact).mean()),
        }
    return figures


def on_floor(take: Scene) -> bool:
    """Return whether the floor of a recording is fixed (no treadmill, no turn on the spot)."""
    actor = take.actor
    body = subject_body(actor.body, seed=take.seed)
    poses = suite.motion_of(actor.clip, body, seed=take.seed, fast=take.group == "fast").poses
    way = suite.cut(poses, actor.start, take.frames)[:, [0, 2]]
    return actor.spin == 0.0 and float(np.ptp(way, axis=0).max()) <= suite.TREADMILL


def real(person: Person) -> dict[str, Any]:
    """Return figures of a person without true poses, by the placement of the feet."""
    contact, times = person.track.contact & (person.track.state == TRACKED)[:, None], person.track.timestamps
    ways = {"tracked": Feet.of(person), "resting": Feet.of(at_rest(person))}
    still = stands_still(ways["tracked"], contact, times)
    return {way: row(own, contact, still, times) for way, own in ways.items()}


def measured(options: argparse.Namespace) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield kind, name and figures of each take."""
    work, database = options.work, options.database
    for made in TAKES:
        yield "made", made.name, simulated(tracked(made, work, database))
    for take in filter(on_floor, suite.takes("report")):
        (person,) = people_of(take, take.frames)
        found = tracked_shot(person, shot_of(take, [person]), work / "suite" / take.name, database)
        yield "suite", take.name, simulated(found)
    for file in sorted(options.real.glob("*_depth.mat"))[::5] if options.real else []:
        yield "utd_mhad", file.stem, real(tracked_run(file, work / "utd_mhad" / file.stem, database))


def means(takes: dict[str, dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Return mean figures over the takes that have them, by the placement of the feet."""
    found: dict[str, dict[str, float]] = {}
    for way in next(iter(takes.values())):
        for name in MEANS:
            values = [own[way][name] for own in takes.values() if own[way].get(name) is not None]
            if values:
                found.setdefault(way, {})[name] = float(np.mean(values))
    return found


@benchmark(OPTIONS, real={"type": Path, "metavar": "FOLDER", "help": "with the recordings of UTD-MHAD"})
def feet(options: argparse.Namespace) -> tuple[str, Any]:
    """Track, filter and compare all recordings."""
    takes: dict[str, dict[str, Any]] = {}
    for kind, name, figures in measured(options):
        takes.setdefault(kind, {})[name] = figures
    return "feet", {kind: {"means": means(own), "takes": own} for kind, own in takes.items()}


main = script(__name__, __doc__, feet)
