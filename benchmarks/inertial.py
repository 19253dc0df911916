"""Tracks and inertial sensors: `depthmocap bench inertial PART`, which is one of

- `simulated [--split report] [--tracks 8]`: simulated sensors on real motions.

The latter has three parts. Calibration: true poses of the split's clips of HDM05, two sensors of 3 degrees of noise
each, with and without one stretch of 30 % wrong frames, by how far the vertical moves about in the limb. Clock: the
offset against true poses, one sensor by acceleration and all five by both signals. Errors: takes of the suite are
tracked, one stretch per arm and leg replaced by the angles of another pose, calibrated on that very take and checked;
so is the noise floor of the torso. Drawn are the thesis's figures 7.12 (precision and recall over thresholds, the two
kinds of truth in place of two annotators), 7.13 (rates of turn and accelerations) and 7.14 (wrong offsets). `tune` is
actor bk, `report` actor dg.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._inertial_figures import (
    add_frames,
    example_of_offsets,
    mean_told,
    nothing_swept,
    offset_figures,
    plot_offsets,
    plot_signals,
    plot_thresholds,
    signals_of,
    swept_figures,
    told_apart,
)
from benchmarks._record import RESULTS, run_part, save_figures
from benchmarks._rows import add_database_options, poses_of
from tests.support.scenes import people_of, shot_of
from tests.support.suite import MOCAP, RATE, takes
from toolkit.app.pipeline import track_recording
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.rotations import quaternions as quat
from toolkit.body.shape import subject_body
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.orientations import RunCheck, frame_scores
from toolkit.inertial.calibrate import CalibrationSequence, CalibrationSettings, calibrate
from toolkit.inertial.distance import distances, errors_of
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.synchronise import Clock, SyncSettings, synchronise
from toolkit.inertial.workflow import clock_of
from toolkit.io.errors import InertialError
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.recordings.opening import open_recording
from toolkit.retrieval.annotation.measures import Scores, Segment
from toolkit.simulation.inertial import SensorNoise, simulate_sensors
from toolkit.simulation.simulate import simulate_scene
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracks import Track


def levelled(poses: np.ndarray, yaw: float) -> np.ndarray:
    """Return poses (T, P) of a clip in the camera's level frame: first facing the camera, then rotated by yaw."""
    facing = quat.rotate(quat.exponential(poses[0, skeleton.ROOT_ROTATION]), np.array([0.0, 0.0, 1.0]))
    turn = quat.exponential([0.0, np.radians(yaw) - np.arctan2(facing[0], facing[2]), 0.0])
    out = poses.copy()
    out[:, :3] = quat.rotate(turn, poses[:, :3])
    out[:, skeleton.ROOT_ROTATION] = quat.logarithm(
        quat.multiply(turn, quat.exponential(poses[:, skeleton.ROOT_ROTATION]))
    )
    return out


ACTORS = {"tune": "bk", "report": "dg"}
NOISE = SensorNoise(tilt=1.0, white=0.3, heading_walk=1.0, soft_tissue=2.5, gyro=0.01, acceleration=0.05, offset=1.5)
THREE_DEGREES = SensorNoise(white=3.0)
PAIR = ("left_forearm", "right_shin")
FIVE = ("left_shin", "right_shin", "left_forearm", "right_forearm", "pelvis")
LIMBS = (*FIVE[:4], "left_hand", "right_hand", "chest")
GROUPS = {"shins": "shin", "forearms": "forearm", "hands": "hand"}
CHAINS = {
    f"{side}_{limb}": [i for i, n in enumerate(skeleton.POSE_NAMES) if any(n.startswith(f"{side}_{j}") for j in joints)]
    for side in ("left", "right")
    for limb, joints in (("arm", ("clavicle", "shoulder", "elbow", "wrist")), ("leg", ("hip", "knee", "ankle")))
}  # fmt: skip
DRAWN = "left_shin"
"""Limb whose signals are plotted, of the first take that its sensor nearly covers; a wrong clock does not."""
TURNED = np.radians(45.0)
"""Minimum error of a wrong orientation."""


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
    rotations[start : start + length] = quat.multiply(rotations[start : start + length], quat.exponential(turn))
    return replace(motion, rotations=rotations)


def calibration_figures(clips: Sequence[np.ndarray], body: Body) -> dict[str, Any]:
    """Return errors of psi and q_L in degrees, median and 90 %, by wrong frames and spread, and the number of
    refusals.
    """
    rows = []
    for seed, poses in enumerate(clips):
        rng = np.random.default_rng(seed)
        simulated = simulate_sensors(body, poses, RATE, PAIR, THREE_DEGREES, seed)
        motion = TrackedMotion.of_poses(body, poses, np.arange(len(poses)) / RATE, name="clip")
        for wrong in (False, True):
            take = CalibrationSequence(wrong_stretch(motion, rng) if wrong else motion, simulated.sensors, Clock(0.0))
            for method in ("robust", "thesis"):
                found = calibrate([take], CalibrationSettings(method=method, refine_clock=False, refuse=False))
                worlds = found.takes["clip"].worlds
                for limb in PAIR:
                    psi = float(np.degrees(quat.angle(np.array(worlds[limb]), simulated.world)))
                    grip = float(np.degrees(quat.angle(found.mounting(limb), simulated.mounting[limb])))
                    spread = max(s.spread for s in found.sensors.values())
                    rows.append((method, wrong, spread, psi, grip))
    table: dict[str, Any] = {}
    for method in ("robust", "thesis"):
        for wrong in (False, True):
            for name, low, high in (("15 and more", 15.0, 999.0), ("5 to 15", 5.0, 15.0), ("below 5", 0.0, 5.0)):
                own = np.array([r[3:] for r in rows if r[:2] == (method, wrong) and low <= r[2] < high])
                if len(own):
                    middle, most = np.median(own, axis=0), np.quantile(own, 0.9, axis=0)
                    key = f"{method}, {'30 % wrong' if wrong else 'all right'}, spread {name}"
                    table[key] = {"sensors": len(own), "psi": [middle[0], most[0]], "q_L": [middle[1], most[1]]}
    return table


def clock_errors(motions: Sequence[tuple[TrackedMotion, Any]]) -> dict[str, Any]:
    """Return errors of the offset in milliseconds: one sensor by acceleration only, and all sensors by both signals."""
    both, one = [], []
    for motion, simulated in motions:
        truth = simulated.offset + 0.5 * motion.times[-1] * (simulated.rate - 1.0)
        try:
            clock = synchronise(motion, simulated.sensors, SyncSettings())
            take = CalibrationSequence(motion, simulated.sensors, clock)
            refined = calibrate([take]).takes[motion.name].offset
            both.append((1000 * abs(clock.offset - truth), 1000 * abs(refined - truth)))
        except InertialError as error:
            print(f"{motion.name}: {error}")
        single = replace(simulated.sensors, streams=simulated.sensors.streams[:1])
        by_acceleration = synchronise(motion, single, SyncSettings(), check=False)
        one.append(1000 * abs(by_acceleration.offset - truth))
    found = np.array(both)
    return {
        "takes": len(motions),
        "refused": len(motions) - len(both),
        "all five, signals: median, worst ms": [float(np.median(found[:, 0])), float(found[:, 0].max())],
        "all five, refined: median, worst ms": [float(np.median(found[:, 1])), float(found[:, 1].max())],
        "one sensor: median, worst ms": [float(np.median(one)), float(np.max(one))],
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
            poses[np.arange(start, start + length)[:, None], entries] = (1 - ease) * poses[rows][
                :, entries
            ] + ease * other
            segments.append(Segment((start + 5) / RATE, (start + length - 5) / RATE, chain))
    return poses, segments


def error_figures(
    tracks: Sequence[tuple[str, Track, Body, np.ndarray, Any]], pool: np.ndarray, method: str
) -> dict[str, Any]:
    """Return precision and recall of orientations off by over 45 degrees and of injected stretches, per kind of limb;
    the same over thresholds (Fig. 7.12), and the separation of wrong frames by orientations and raw signals (Fig.
    7.13).
    """
    swept = {name: nothing_swept() for name in GROUPS}
    told: list[dict[str, float | None]] = []
    drawn = False
    off = {name: Scores(0, 0, 0, 0) for name in GROUPS}
    stretches = {name: Scores(0, 0, 0, 0) for name in GROUPS}
    torso: list[np.ndarray] = []
    takes: dict[str, dict[str, list[float]]] = {}
    for seed, (name, track, body, truth, simulated) in enumerate(tracks):
        own_off = dict.fromkeys(GROUPS, Scores(0, 0, 0, 0))
        poses, segments = injected(track.pose, pool, np.random.default_rng(seed))
        motion = TrackedMotion.of_poses(body, poses, track.timestamps, track.state == 0, "take")
        true = TrackedMotion.of_poses(body, truth, track.timestamps, name="truth")
        clock = synchronise(motion, simulated.sensors, SyncSettings(), check=False)
        take = CalibrationSequence(motion, simulated.sensors, clock)
        found = calibrate([take], CalibrationSettings(method=method, refuse=False))
        take = replace(take, clock=clock_of(found.takes["take"], clock))
        for curve in distances(found, take):
            if curve.limb == "chest":
                torso.append(curve.full[np.isfinite(curve.full)])
                continue
            kind = next(kind for kind, part in GROUPS.items() if curve.limb.endswith(part))
            wrong = quat.angle(motion.orientation(curve.limb), true.orientation(curve.limb)) > TURNED
            above = np.nan_to_num(curve.full) > 45.0
            known = np.isfinite(curve.full)
            both = int((wrong & above & known).sum())
            own_off[kind] += Scores(both, int((above & known).sum()), both, int((wrong & known).sum()))
            chain = curve.limb.split("_")[0] + ("_leg" if kind == "shins" else "_arm")
            own = [Segment(s.start, s.end, curve.limb) for s in segments if s.label == chain]
            check = RunCheck("take", found, (curve,), tuple(errors_of(curve, 30.0)), tuple(own))
            ramps = np.zeros(len(curve.times), dtype=bool)
            for s in own:
                ramps |= (curve.times >= s.start - 5 / RATE) & (curve.times < s.start)
                ramps |= (curve.times >= s.end) & (curve.times < s.end + 5 / RATE)
            kept = replace(curve, full=np.where(ramps, np.nan, curve.full))
            inside = np.any([(curve.times >= s.start) & (curve.times < s.end) for s in own], axis=0)
            add_frames(swept[kind], kept.full, {"off by 45 degrees": wrong, "injected": inside})
            signals = signals_of(take, found, curve.limb)
            apart = {name: np.linalg.norm(sensor - track, axis=1) for name, (sensor, track) in signals.items()}
            told.append({name: told_apart(v, wrong) for name, v in {"orientation": curve.full, **apart}.items()})
            if method == "robust" and curve.limb == DRAWN and not drawn and known.mean() > 0.9:
                drawn = True
                plot_signals(curve.times, signals, wrong, RESULTS / "inertial_signals.jpg")
            stretches[kind] += frame_scores(kept, check.truth or (), np.nan_to_num(kept.full) > 30.0)
        off = {kind: scores + own_off[kind] for kind, scores in off.items()}
        takes[name] = {kind: [scores.precision, scores.recall] for kind, scores in own_off.items()}
        takes[name]["torso, mean and deviation"] = [float(torso[-1].mean()), float(torso[-1].std())]
    floor = np.concatenate(torso)
    return {
        "off by 45 degrees, P, R": {name: [s.precision, s.recall] for name, s in off.items()},
        "injected frames, tau 30, P, R": {name: [s.precision, s.recall] for name, s in stretches.items()},
        "torso, mean and deviation": [float(floor.mean()), float(floor.std())],
        "over thresholds": {name: swept_figures(own) for name, own in swept.items()},
        "wrong frames told apart": mean_told(told),
        "takes": takes,
    }


def tracked(split: str, count: int, work: Path, poses: PoseDatabase) -> list[Any]:
    """Yield tracked takes of the suite: name, run folder and simulated person."""
    actor = ACTORS[split]
    chosen = [take for take in takes(split) if take.actor.clip.startswith(actor)][:count]
    found = []
    for take in chosen:
        (person,) = people_of(take, take.frames)
        run, path = work / "inertial" / take.name, work / "inertial" / f"{take.name}.npz"
        simulate_scene([person], path, replace(shot_of(take, [person]), furnished=False))
        track_recording(open_recording(path), HybridTracker(poses), run, warm_up=False)
        found.append((take.name, run, person))
    return found


def simulated(parser: argparse.ArgumentParser) -> None:
    """Simulate, calibrate, compare, print, write JSON."""
    parser.add_argument("--split", choices=tuple(ACTORS), default="tune", help="report is not for tuning")
    parser.add_argument("--clips", type=int, default=40, help="of the calibration part")
    parser.add_argument("--tracks", type=int, default=8, help="takes that are tracked for the other parts; 0 for none")
    add_database_options(parser)
    options = parser.parse_args()
    body = subject_body("neutral")
    clips = clips_of(options.split, body, options.clips)
    figures: dict[str, Any] = {"calibration": calibration_figures(clips, body)}
    motions = []
    for seed, poses in enumerate(clips):
        motion = TrackedMotion.of_poses(body, poses, np.arange(len(poses)) / RATE, name=f"clip {seed}")
        motions.append((motion, simulate_sensors(body, poses, RATE, FIVE, NOISE, seed)))
    figures["clock against true poses"] = clock_errors(motions)
    if options.tracks:
        figures |= _tracked_figures(options)
    for name, part in figures.items():
        print(name)
        for key, value in part.items():
            print("  ", key, value)
    offsets = example_of_offsets()
    plot_offsets(*offsets, RESULTS / "inertial_offsets.jpg")
    figures["wrong offsets"] = offset_figures(*offsets)
    if options.tracks:
        plot_thresholds(figures["errors, robust"]["over thresholds"], RESULTS / "inertial_thresholds.jpg")
    name = "inertial" if options.split == "report" else f"inertial_{options.split}"
    print("written:", save_figures(name, figures, asdict(NOISE)))


def _tracked_figures(options: argparse.Namespace) -> dict[str, Any]:
    database = PoseDatabase.load(poses_of(options))
    found = tracked(options.split, options.tracks, options.work, database)
    rows, motions = [], []
    for seed, (name, run, person) in enumerate(found):
        track, body, poses = Track.load(run), person.body, levelled(person.clip.poses, person.yaw)
        simulated = simulate_sensors(body, poses, RATE, LIMBS, NOISE, seed)
        rows.append((name, track, body, poses, simulated))
        motion = TrackedMotion.of_poses(body, track.pose, track.timestamps, track.state == 0, name)
        motions.append((motion, simulated))
    pool = np.concatenate(clips_of(options.split, subject_body("neutral"), 20))
    return {
        "clock against own tracks": clock_errors(motions),
        "errors, robust": error_figures(rows, pool, "robust"),
        "errors, thesis": error_figures(rows, pool, "thesis"),
    }


def main() -> None:
    """Run the named part."""
    run_part(__doc__, {"simulated": simulated})


if __name__ == "__main__":
    main()
