"""Tracks and inertial sensors: `depthmocap bench inertial simulated [--split report]`.

Simulated sensors on real motions, in three parts. Calibration: true poses of the split's clips of HDM05, two sensors of
3 degrees of noise each, with and without one stretch of 30 % wrong frames, by the spread of the vertical in the limb.
Clock: the offset against true poses and tracks, of five sensors. Errors: takes of the suite are tracked, one or two
stretches per arm and leg replaced by the angles of another pose, calibrated on that very take and checked; so is the
noise floor of the torso. With them are the thesis's figures 7.12 (precision and recall over thresholds, true errors in
place of annotators), 7.13 (rates of turn and accelerations) and 7.14 (wrong offsets). `tune` is actor bk, `report`
actor dg.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from sklearn.metrics import roc_auc_score

from benchmarks._movement import Tracked, tracked_shot
from benchmarks._record import RESULTS, benchmark, drawn, script
from benchmarks._rows import DATABASE, SPLIT, poses_of
from tests.support.scenes import people_of, shot_of
from tests.support.suite import MOCAP, RATE, takes
from tests.support.worn_sensors import SensorNoise, simulate_sensors
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.evaluation.orientations import ERROR_DEGREES, THRESHOLDS, Distances, distances, frame_scores
from toolkit.inertial.calibrate import CalibrationSequence, CalibrationSettings, calibrate
from toolkit.inertial.calibration import Calibration
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.stream import GRAVITY
from toolkit.inertial.synchronise import Clock, angular_velocity, synchronise
from toolkit.io.errors import InertialError
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.retrieval.annotation.measures import Scores, Segment
from toolkit.tracks import TRACKED

SIGNALS = ("orientation", "rate of turn", "acceleration")
CLIPS, TRACKS = 40, 8
"""Clips of the calibration, and tracked takes of the other parts."""
ACTORS = {"tune": "bk", "report": "dg"}
NOISE = SensorNoise(tilt=1.0, white=0.3, heading_walk=1.0, soft_tissue=2.5, gyro=0.01, acceleration=0.05, offset=1.5)
THREE_DEGREES = SensorNoise(white=3.0)
PAIR = ("left_forearm", "right_shin")
FIVE = ("left_shin", "right_shin", "left_forearm", "right_forearm", "pelvis")
LIMBS = (*FIVE[:4], "left_hand", "right_hand", "chest")
GROUPS = {"shins": "shin", "forearms": "forearm", "hands": "hand"}
NOTHING = Scores(0, 0, 0, 0)
CHAINS = {
    f"{side}_{limb}": [i for i, n in enumerate(skeleton.POSE_NAMES) if any(n.startswith(f"{side}_{j}") for j in joints)]
    for side in ("left", "right")
    for limb, joints in (("arm", ("clavicle", "shoulder", "elbow", "wrist")), ("leg", ("hip", "knee", "ankle")))
}  # fmt: skip
DRAWN = "left_shin"
"""Limb whose signals are plotted, of the first take that its sensor nearly covers; a wrong clock does not."""
EASED = 5 / RATE
"""Duration of the change to and from an injected pose, seconds."""


def clips_of(split: str, body: Body, count: int) -> list[np.ndarray]:
    """Return poses (T, P) at 30 Hz of clips of the split's actor, at least two seconds each, evenly chosen."""
    paths = sorted(MOCAP.glob(f"hdm05/HDM_{ACTORS[split]}_*.amc"))
    found = []
    for path in paths[:: max(1, len(paths) // count)]:
        poses = retarget(read_clip(path).resampled(RATE), body).poses
        while len(poses) < 60:
            poses = np.concatenate([poses, poses[-2:0:-1]])
        found.append(poses[:300])
    return found[:count]


def wrong_stretch(motion: TrackedMotion, rng: np.random.Generator) -> TrackedMotion:
    """Return the motion with a stretch of 30 % of the frames rotated by 40 to 120 degrees."""
    count = len(motion.times)
    length = round(0.3 * count)
    start = int(rng.integers(0, count - length))
    axes = rng.normal(size=(18, 3))
    turn = np.radians(rng.uniform(40, 120, (18, 1))) * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    rotations = motion.rotations.copy()
    rotations[start : start + length] = rotations[start : start + length] @ Rotation.from_rotvec(turn).as_matrix()
    return replace(motion, rotations=rotations)


def calibration_figures(clips: Sequence[np.ndarray], body: Body) -> dict[str, Any]:
    """Return errors of psi and q_L in degrees, median and 90 %, by method and wrong frames, of spreads over 15."""
    rows: dict[str, list[list[float]]] = {}
    for seed, poses in enumerate(clips):
        simulated = simulate_sensors(body, poses, RATE, PAIR, THREE_DEGREES, seed)
        right = TrackedMotion.of_poses(body, poses, np.arange(len(poses)) / RATE, name="clip")
        motions = {"all right": right, "30 % wrong": wrong_stretch(right, np.random.default_rng(seed))}
        for (kind, motion), method in product(motions.items(), ("robust", "thesis")):
            take = CalibrationSequence(motion, simulated.sensors, Clock(0.0))
            found = calibrate([take], CalibrationSettings(method=method, refine_clock=False, refuse=False))
            if max(s.spread for s in found.sensors.values()) < 15.0:
                continue
            for limb in PAIR:
                psi = (found.takes["clip"].world(limb).inv() * simulated.world).magnitude()
                grip = (found.mounting(limb).inv() * simulated.mounting[limb]).magnitude()
                rows.setdefault(f"{method}, {kind}, spread 15 and more", []).append(np.degrees([psi, grip]).tolist())
    table = {}
    for key, errors in rows.items():
        middle, most = np.median(errors, axis=0), np.quantile(errors, 0.9, axis=0)
        table[key] = {"psi": [middle[0], most[0]], "q_L": [middle[1], most[1]]}
    return table


def clock_errors(motions: Sequence[tuple[TrackedMotion, Any]]) -> dict[str, Any]:
    """Return errors of the offset of all sensors together after refinement, milliseconds."""
    found = []
    for motion, simulated in motions:
        truth = simulated.offset + 0.5 * motion.times[-1] * (simulated.rate - 1.0)
        try:
            clock = synchronise(motion, simulated.sensors)
            take = CalibrationSequence(motion, simulated.sensors, clock)
            found.append(1000 * abs(calibrate([take]).takes[motion.name].offset - truth))
        except InertialError as error:
            print(f"{motion.name}: {error}")
    return {
        "takes": len(motions),
        "refused": len(motions) - len(found),
        "all five, refined: median, worst ms": [float(np.median(found)), float(max(found))],
    }


def injected(poses: np.ndarray, pool: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, list[Segment]]:
    """Return a track with one or two wrong stretches per arm and leg, eased over 5 frames, and their frames."""
    poses, segments = poses.copy(), []
    for chain, entries in CHAINS.items():
        for _ in range(int(rng.integers(1, 3))):
            length = int(rng.integers(15, min(60, len(poses) // 3)))
            start = int(rng.integers(0, len(poses) - length))
            middle = poses[start + length // 2, entries]
            for _ in range(200):
                other = pool[rng.integers(len(pool)), entries]
                if np.abs(other - middle).max() > 0.8:
                    break
            ease = np.clip(np.minimum(np.arange(1, length + 1), np.arange(length, 0, -1)) / 5.0, 0, 1)[:, None]
            rows = slice(start, start + length)
            poses[rows, entries] = (1 - ease) * poses[rows, entries] + ease * other
            segments.append(Segment(start / RATE + EASED, (start + length) / RATE - EASED, chain))
    return poses, segments


class TrackedTake(NamedTuple):
    """Tracked take of the suite with simulated sensors."""

    found: Tracked
    simulated: Any

    def motion(self, poses: np.ndarray, name: str) -> TrackedMotion:
        """Return the motion of some poses (T, P) at the tracked frames."""
        track = self.found.person.track
        return TrackedMotion.of_poses(self.found.body, poses, track.timestamps, track.state == TRACKED, name)


class Checked(NamedTuple):
    """Curve of one limb with wrong frames, bool (T,), injected segments, and magnitudes of its raw signals."""

    curve: Distances
    wrong: np.ndarray
    injected: list[Segment]
    signals: dict[str, tuple[np.ndarray, np.ndarray]]

    @property
    def kind(self) -> str:
        """Name of the group of the limb."""
        return next(kind for kind, part in GROUPS.items() if self.curve.limb.endswith(part))

    def without_ramps(self) -> Distances:
        """Return the curve without the frames that change to and from an injected pose."""
        times = self.curve.times
        ramps = np.zeros(len(times), dtype=bool)
        for s in self.injected:
            ramps |= (times >= s.start - EASED) & (times < s.start) | (times >= s.end) & (times < s.end + EASED)
        return replace(self.curve, full=np.where(ramps, np.nan, self.curve.full))


def checked(tracks: Sequence[TrackedTake], pool: np.ndarray, method: str) -> Iterator[Checked]:
    """Inject wrong stretches into each take, calibrate on it, and yield the check of each limb."""
    for seed, own in enumerate(tracks):
        poses, segments = injected(own.found.person.track.pose, pool, np.random.default_rng(seed))
        motion, true = own.motion(poses, "take"), own.motion(own.found.poses, "truth")
        clock = synchronise(motion, own.simulated.sensors, check=False)
        take = CalibrationSequence(motion, own.simulated.sensors, clock)
        found = calibrate([take], CalibrationSettings(method=method, refuse=False))
        take = replace(take, clock=replace(clock, offset=found.takes["take"].offset))
        for curve in distances(found, take):
            apart = motion.orientation(curve.limb).inv() * true.orientation(curve.limb)
            wrong = np.degrees(apart.magnitude()) > ERROR_DEGREES
            chain = curve.limb.split("_")[0] + ("_leg" if curve.limb.endswith("shin") else "_arm")
            stretches = [Segment(s.start, s.end, curve.limb) for s in segments if s.label == chain]
            yield Checked(curve, wrong, stretches, signals_of(take, found, curve.limb))


def error_figures(tracks: Sequence[TrackedTake], pool: np.ndarray, method: str) -> dict[str, Any]:
    """Return precision and recall of orientations off by over 45 degrees and of injected stretches, per kind of limb;
    the same over thresholds (Fig. 7.12), and the separation of wrong frames by orientations and raw signals (Fig.
    7.13).
    """
    swept: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {name: [] for name in GROUPS}
    off, stretches = dict.fromkeys(GROUPS, NOTHING), dict.fromkeys(GROUPS, NOTHING)
    told, torso, pending = [], [], method == "robust"
    for own in checked(tracks, pool, method):
        curve, known = own.curve, np.isfinite(own.curve.full)
        if curve.limb == "chest":
            torso.append(curve.full[known])
            continue
        off[own.kind] += frame_counts(curve.full, own.wrong, ERROR_DEGREES)
        kept = own.without_ramps()
        stretches[own.kind] += frame_scores(kept, own.injected, np.nan_to_num(kept.full) > 30.0)
        swept[own.kind].append((kept.full, own.wrong))
        apart = {name: np.linalg.norm(sensor - track, axis=1) for name, (sensor, track) in own.signals.items()}
        told.append({name: told_apart(v, own.wrong) for name, v in {"orientation": curve.full, **apart}.items()})
        if pending and curve.limb == DRAWN and known.mean() > 0.9:
            pending = False
            rows = {
                f"{signal}, {axis}": {"tab:red": sensor[:, k], "black": track[:, k]}
                for signal, (sensor, track) in own.signals.items()
                for k, axis in enumerate("xyz")
            }
            plot_curves(rows, curve.times, own.wrong, RESULTS / "inertial_signals.jpg")
    floor = np.concatenate(torso)
    joined = {name: [np.concatenate(part) for part in zip(*own, strict=True)] for name, own in swept.items()}
    return {
        "off by 45 degrees, P, R": {name: [s.precision, s.recall] for name, s in off.items()},
        "injected frames, tau 30, P, R": {name: [s.precision, s.recall] for name, s in stretches.items()},
        "torso, mean and deviation": [float(floor.mean()), float(floor.std())],
        "tau": THRESHOLDS,
        "over thresholds": {name: over_thresholds(*parts) for name, parts in joined.items()},
        "wrong frames told apart": {
            name: float(np.mean([row[name] for row in told if row[name] is not None])) for name in SIGNALS
        },
    }


def tracked(options: argparse.Namespace) -> list[TrackedTake]:
    """Simulate and track takes of the suite, and return them with simulated sensors."""
    found, database = [], poses_of(options)
    chosen = [take for take in takes(options.split) if take.actor.clip.startswith(ACTORS[options.split])]
    for seed, take in enumerate(chosen[:TRACKS]):
        (person,) = people_of(take, take.frames)
        shot = replace(shot_of(take, [person]), furnished=False)
        own = tracked_shot(person, shot, options.work / "inertial" / take.name, database)
        found.append(TrackedTake(own, simulate_sensors(own.body, own.poses, RATE, LIMBS, NOISE, seed)))
    return found


def frame_counts(full: np.ndarray, wrong: np.ndarray, threshold: float) -> Scores:
    """Return the scores of frames of a curve (T,) above a threshold, degrees, against the wrong ones, bool (T,)."""
    known, found = np.isfinite(full), np.nan_to_num(full) > threshold
    both = int((wrong & found & known).sum())
    return Scores(both, int((found & known).sum()), both, int((wrong & known).sum()))


def over_thresholds(full: np.ndarray, wrong: np.ndarray) -> dict[str, list[float]]:
    """Return precision, recall and F of a curve (T,), degrees, against wrong frames, bool (T,), at each threshold."""
    scores = [frame_counts(full, wrong, float(threshold)) for threshold in THRESHOLDS]
    return {key: [getattr(score, key) for score in scores] for key in ("precision", "recall", "f")}


def signals_of(
    take: CalibrationSequence, calibration: Calibration, limb: str
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return rates of turn, rad/s, and accelerations, m/s2, in the limb's frame: of sensor and track, (T, 3) each.

    The track's are differences of its frames; the sensor's, NaN where it measured nothing, are brought into the limb's
    frame by its mounting `q_L`.
    """
    stream = take.sensors.named(limb)
    assert stream.gyro is not None and stream.acceleration is not None  # simulated
    moments = take.clock.sensor_times(take.motion.times)

    def measured(values: np.ndarray) -> np.ndarray:
        own = stream.times[stream.valid]
        columns = [np.interp(moments, own, column, np.nan, np.nan) for column in values[stream.valid].T]
        return calibration.mounting(limb).apply(np.stack(columns, axis=1))

    times, orientation = take.motion.times, take.motion.orientation(limb)
    turned = angular_velocity(orientation, times)
    path = take.motion.middle(limb)
    pulled = np.gradient(np.gradient(path, times, axis=0), times, axis=0) + [0.0, GRAVITY, 0.0]
    return {
        "rate of turn": (measured(stream.gyro), np.concatenate([turned, turned[-1:]])),
        "acceleration": (measured(stream.acceleration), orientation.inv().apply(pulled)),
    }


def told_apart(values: np.ndarray, wrong: np.ndarray) -> float | None:
    """Return the probability that a wrong frame has a larger value than a correct one (ties count half), or None."""
    values, wrong = values[np.isfinite(values)], wrong[np.isfinite(values)]
    return float(roc_auc_score(wrong, values)) if wrong.any() and not wrong.all() else None


def plot_curves(rows: Mapping[str, Mapping[str, np.ndarray]], times: np.ndarray, wrong: np.ndarray, path: Path) -> None:
    """Plot curves (T,) by colour in a panel for each row, wrong frames, bool (T,), shaded."""
    with drawn(path, (11, len(rows) + 1.0), len(rows), sharex=True) as panels:
        for panel, (name, curves) in zip(panels, rows.items(), strict=True):
            for colour, values in curves.items():
                panel.plot(times, values, color=colour, lw=0.9)
            panel.fill_between(times, *panel.get_ylim(), where=wrong, color="0.85", lw=0, zorder=0)
            panel.set_title(name, fontsize=8, loc="left")


def example_of_offsets() -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return Fig. 7.14: distances (640,), degrees, with correct, one wrong and two wrong offsets; and correct frames.

    640 orientations, of which those of frames 50 to 200 and 400 to 600 are tracked wrongly.
    """
    frames = np.arange(640)
    steps = np.stack([np.sin(0.013 * frames), 0.8 * np.sin(0.021 * frames + 1), np.cos(0.017 * frames)], axis=1)
    inertial = Rotation.from_rotvec(1.2 * steps)
    error = np.zeros((640, 3))
    error[50:201, 0] = np.radians(70.0) * np.linspace(0, 1, 151)
    error[400:601, 1] = np.radians(110.0) * np.sin(np.linspace(0, np.pi, 201))
    tracked = inertial * Rotation.from_rotvec(error)

    def distance(a: Rotation, b: Rotation) -> np.ndarray:
        """Return the distance of Eq. 7.17."""
        return np.degrees((inertial.inv() * b * tracked * a).magnitude())

    still, a, b = Rotation.identity(), Rotation.from_rotvec([1.1, -0.9, 0.7]), Rotation.from_rotvec([-0.8, 1.3, 0.5])
    curves = {
        "both offsets right": distance(still, still),
        "one wrong": distance(still, b),
        "both wrong": distance(a, b),
    }
    return curves, (error == 0.0).all(axis=1)


def offset_figures() -> dict[str, Any]:
    """Return the separation of wrong frames by a threshold in the example of Fig. 7.14, and plot its curves."""
    curves, right = example_of_offsets()
    rows = {name: {"black": values} for name, values in curves.items()}
    plot_curves(rows, np.arange(len(right)), ~right, RESULTS / "inertial_offsets.jpg")
    return {name: {"told apart": told_apart(np.round(values, 6), ~right)} for name, values in curves.items()}


@benchmark(SPLIT, DATABASE)
def simulated(options: argparse.Namespace) -> tuple[str, Any]:
    """Simulate, calibrate and compare."""
    body = subject_body("neutral")
    clips = clips_of(options.split, body, CLIPS)
    motions = []
    for seed, poses in enumerate(clips):
        motion = TrackedMotion.of_poses(body, poses, np.arange(len(poses)) / RATE, name=f"clip {seed}")
        motions.append((motion, simulate_sensors(body, poses, RATE, FIVE, NOISE, seed)))
    tracks = tracked(options)
    tracked_motions = [(own.motion(own.found.person.track.pose, "t"), own.simulated) for own in tracks]
    pool = np.concatenate(clips_of(options.split, body, 20))
    figures: dict[str, Any] = {
        "calibration": calibration_figures(clips, body),
        "clock against true poses": clock_errors(motions),
        "clock against own tracks": clock_errors(tracked_motions),
        "errors, robust": error_figures(tracks, pool, "robust"),
        "errors, thesis": error_figures(tracks, pool, "thesis"),
        "wrong offsets": offset_figures(),
    }
    return f"inertial{'' if options.split == 'report' else '_tune'}", figures


main = script(__name__, __doc__, {"simulated": simulated})
