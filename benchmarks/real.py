"""Real Kinect recordings: `depthmocap bench real PART`, which is one of

- `tracked [--stride 4] [--rows hybrid,local]`: all recordings of UTD-MHAD (27 actions by 4 people), tracked with the
  database of `depthmocap bench accuracy`. The Kinect SDK's skeleton beside each is a reference and no truth, so figures
  are how well the fitted body explains the depth image, whether its bones keep their lengths, and agreement within 100
  mm without hands and feet: plain, and with an offset per joint that was fitted on the other people. Results of a part
  of it go to a file ending in `_part`.
- `offsets`: how our joints differ from the SDK's, joint by joint. Every `--stride`-th recording of
  UTD-MHAD and MSR Action3D is tracked. For each joint the mean offset from the SDK's place to ours in the frame of the
  torso (left, up, forwards), the mean distance, what is left of it once the offset is taken away, and the share within
  100 mm.
- `lag`: how many frames the SDK's skeleton is ahead of the depth. For each shift, the share of its wrists and hands in
  front of which the depth within 120 mm was measured; no tracker is involved. `SHIFTS` are the best ones.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._movement import tracked_run
from benchmarks._record import run_part, save_figures
from benchmarks._rows import (
    ROWS,
    add_database_options,
    figures_of,
    make_tracker,
    poses_of,
    settings_of,
    swarm_settings,
    track_each,
)
from tests.support.suite import WORK
from toolkit.app.config import parse_overrides
from toolkit.body import skeleton
from toolkit.body.skeleton import END_EFFECTORS
from toolkit.database.database import PoseDatabase
from toolkit.database.default import DEFAULT_DATABASE
from toolkit.datasets.folder import data_folder
from toolkit.evaluation.agreement import agreement, shifted, torso_frames
from toolkit.evaluation.evaluate import evaluate_runs
from toolkit.evaluation.extrema_scores import BONES, OWNERS
from toolkit.evaluation.scores import EvaluationTable
from toolkit.recordings.opening import open_recording
from toolkit.retrieval.features.motion import from_track
from toolkit.retrieval.features.relational import FEATURES, relational_features
from toolkit.sensing.recording import Recording
from toolkit.trackers.qammaz.tracker import SwarmTracker
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import TRACKED, RunInfo, Track

RECORDINGS = data_folder() / "depth" / "utd_mhad"
LIMB_BONES = BONES[(OWNERS >= 0) & (OWNERS < END_EFFECTORS.index("head"))]
"""Bones of arms and legs; neck and head have no bone between them, because the neck is derived from the shoulders."""

COLUMNS = (
    ("overlap", "IoU %", 100.0),
    ("residual_mm", "residual mm", 1.0),
    ("agreement", "agreement %", 100.0),
    ("agreement_offsets", "with offsets %", 100.0),
    ("agreement_hands_feet", "hands, feet %", 100.0),
    ("extrema", "five extrema %", 100.0),
    ("tracked", "tracked %", 100.0),
    ("frame_ms", "ms/frame", 1.0),
)
SIDES = ("left", "right")
WORST = 10
MOVING = {"moving", "approaching", "fast", "rotates"}
"""Words in the names of velocity features."""
SWARMS = ("swarm", "qammaz")
"""Rows without a database; their joints are detected in the shaded depth images."""


def bone_variation(joints: np.ndarray) -> float:
    """Return the largest relative standard deviation over time of a bone length, of joints (T, 20, 3)."""
    lengths = np.linalg.norm(joints[:, LIMB_BONES[:, 0]] - joints[:, LIMB_BONES[:, 1]], axis=2)
    return float((np.nanstd(lengths, axis=0) / np.nanmean(lengths, axis=0)).max())


def anatomy(runs: Sequence[Path], paths: Sequence[Path]) -> dict[str, dict[str, float]]:
    """Return per recording the variation of bone lengths, that of the Kinect SDK's skeleton, and the stature in
    metres.
    """
    found = {}
    for run, path in zip(runs, paths, strict=True):
        found[path.stem] = {
            "bone_variation": bone_variation(Track.load(run).joints),
            "bone_variation_of_reference": bone_variation(open_recording(path).reference_joints),
            "stature_m": RunInfo.load(run).body().height,
        }
    return found


def fast_share(runs: Sequence[Path]) -> float:
    """Return the fraction of ones among the velocity features of all recordings, which depend on the frames' times."""
    fast = [row for row, feature in enumerate(FEATURES) if set(feature.meaning.split()) & MOVING]
    values = []
    for run in runs:
        motion = from_track(Track.load(run), RunInfo.load(run).body(), run.name)
        values.append(relational_features(motion).values[fast])
    return float(np.concatenate(values, axis=1).mean())


def run_row(row: str, paths: Sequence[Path], options: argparse.Namespace, overrides: dict[str, Any]) -> list[Path]:
    """Track all recordings with a tracker; return its run folders in the same order."""
    output = options.work / "runs" / "real" / row.replace(" ", "_")
    tracker: Tracker
    if row in SWARMS:
        tracker = SwarmTracker(swarm_settings(row, overrides))
    else:
        poses_path = poses_of(options)
        tracker = make_tracker(row, PoseDatabase.load(poses_path), overrides, str(poses_path))
    reader = {"frame_rate": options.frame_rate} if options.frame_rate else {}
    runs = {output / path.stem: (path, reader) for path in paths}
    failed = track_each(runs, tracker)
    for run, reason in failed.items():
        print(f"{run.name} failed: {reason}")
    return [run for run in runs if run not in failed]


def agreement_in_time(run: Path, recording: Path) -> float:
    """Return the agreement with the SDK's joints at the moment that the depth shows, see `SHIFTS`."""
    track, reference = Track.load(run), open_recording(recording).reference_joints
    return agreement(track.joints, shifted(reference, SHIFTS["utd_mhad"])[: len(track)])


def print_row(row: str, table: EvaluationTable, bones: dict[str, dict[str, float]]) -> None:
    """Print means over the recordings, and the worst recordings."""
    mean = table.mean()
    print(f"\n{row}: {len(table)} recordings, {mean.frames} frames")
    for name, heading, factor in COLUMNS:
        value = getattr(mean, name)
        print(f"  {heading:<16}", "-" if value is None else f"{factor * value:.1f}")
    variation = max(entry["bone_variation"] for entry in bones.values())
    reference = np.median([entry["bone_variation_of_reference"] for entry in bones.values()])
    statures = [entry["stature_m"] for entry in bones.values()]
    print(
        f"  bone lengths vary by {100 * variation:.3f} % at most; those of the SDK by {100 * reference:.1f} % (median)"
    )
    print(f"  fitted statures {min(statures):.2f} to {max(statures):.2f} m")
    print("  won by", ", ".join(f"{name} {100 * share:.1f} %" for name, share in mean.sources.items()))
    worst = sorted(table, key=lambda scores: scores.agreement if scores.agreement is not None else 1.0)[:WORST]
    print("  least agreement:", ", ".join(f"{s.recording} {100 * (s.agreement or 0):.0f}" for s in worst))


def tracked(parser: argparse.ArgumentParser) -> None:
    """Track, evaluate, print, write JSON."""
    parser.add_argument("--recordings", type=Path, default=RECORDINGS, help="folder of UTD-MHAD")
    parser.add_argument("--stride", type=int, default=1, help="every so many recordings")
    parser.add_argument("--frame-rate", type=float, help="another one than the reader's own")
    parser.add_argument("--rows", default="hybrid", help="comma-separated, out of: " + ", ".join((*ROWS, *SWARMS)))
    add_database_options(parser)
    options = parser.parse_args()
    paths = sorted(options.recordings.glob("*_depth.mat"))[:: options.stride]
    if not paths:
        parser.error(f"{options.recordings} holds no recording of UTD-MHAD; name its folder with --recordings")
    overrides = parse_overrides(options.set)
    figures, settings = {}, {}
    for row in options.rows.split(","):
        runs = run_row(row, paths, options, overrides)
        table = evaluate_runs(runs)
        sources = [Path(RunInfo.load(run).recording) for run in runs]
        bones = anatomy(runs, sources)
        in_time = float(np.mean([agreement_in_time(run, path) for run, path in zip(runs, sources, strict=True)]))
        print_row(row, table, bones)
        moving = fast_share(runs)
        print(f"  agreement with the skeleton {-SHIFTS['utd_mhad']:g} frames before: {100 * in_time:.1f} %")
        print(f"  velocity features that are 1: {100 * moving:.2f} %")
        recordings = {scores.recording: figures_of(scores) | bones[scores.recording] for scores in table}
        mean = figures_of(table.mean()) | {"agreement_in_time": in_time}
        figures[row] = {"mean": mean, "moving": moving, "recordings": recordings}
        settings[row] = asdict(swarm_settings(row, overrides) if row in SWARMS else settings_of(row, overrides))
    whole = options.stride == 1 and not options.set and not options.frame_rate and options.recordings == RECORDINGS
    part = "real_part" + (f"_{options.frame_rate:g}_hz" if options.frame_rate else "")
    print("written:", save_figures("real" if whole else part, figures, settings))


DEPTH = data_folder() / "depth"
SHIFTS = {"utd_mhad": -1.5, "msr_action3d": 0.5}
"""Frames by which the skeleton of each data set is read later than its depth, so that both show the same moment."""
LAGS = np.arange(-4.0, 2.1, 0.5)
"""Shifts that `lag` compares, frames."""
ON_SURFACE = 0.12
"""Metres between a joint and the measured surface in front of it: the radius of a forearm and the sensor's noise."""


def offsets_of(recording: Path, run: Path, database: Path) -> np.ndarray:
    """Return offsets from the SDK's joints to ours in the torso's frame: float64 (F, 20, 3), metres, of common
    frames.
    """
    track, reference = tracked_run(recording, run, database).track, open_recording(recording).reference_joints
    known = (track.state == TRACKED) & np.isfinite(reference).all(axis=(1, 2))
    ours = track.joints[known].astype(np.float64)
    return np.einsum("tca,tjc->tja", torso_frames(ours), ours - reference[known])


def by_joint(differences: np.ndarray) -> dict[str, dict[str, Any]]:
    """Return figures by joint of differences (F, 20, 3)."""
    mean = differences.mean(axis=0)
    distance = np.linalg.norm(differences, axis=2)
    rest = np.linalg.norm(differences - mean, axis=2)
    return {
        name: {
            "left_up_forwards_mm": (1000.0 * mean[j]).round(0).tolist(),
            "distance_mm": round(1000.0 * float(distance[:, j].mean()), 1),
            "without_offset_mm": round(1000.0 * float(rest[:, j].mean()), 1),
            "within_100_mm": round(float((distance[:, j] < 0.1).mean()), 3),
        }
        for j, name in enumerate(skeleton.REPORTED)
    }


def offsets(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--database", type=Path, default=DEFAULT_DATABASE)
    parser.add_argument("--stride", type=int, default=5)
    parser.add_argument("--work", type=Path, default=WORK / "movement")
    options = parser.parse_args()
    figures: dict[str, Any] = {}
    for name in SHIFTS:
        files = sorted((DEPTH / name).glob("*_depth.mat"))[:: options.stride]
        rows = [offsets_of(file, options.work / name / file.stem, options.database) for file in files]
        joints = by_joint(np.concatenate(rows))
        figures[name] = {"recordings": len(rows), "frames": sum(map(len, rows)), "joints": joints}
        for joint, values in figures[name]["joints"].items():
            print(f"{name:13} {joint:15}", values, flush=True)
    print(save_figures("kinect_offsets", figures, vars(options)))


def on_surface(recording: Recording) -> dict[float, float]:
    """Return the share of the reference's wrists and hands that lie on the measured surface, by shift in frames."""
    camera, rows = recording.camera, [skeleton.REPORTED.index(f"{a}_{b}") for a in SIDES for b in ("wrist", "hand")]
    depth = np.stack([recording.depth(i) for i in range(len(recording))]) / 1000.0
    frames, (height, width) = np.arange(len(depth))[:, None], depth.shape[1:]
    found = {}
    for shift in LAGS.tolist():
        joints = shifted(recording.reference_joints, shift)[:, rows].astype(np.float64)
        u, v = np.rint(np.moveaxis(np.stack([camera.project(frame) for frame in joints]), 2, 0)).astype(np.int64)
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        measured = depth[frames, np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)]
        found[shift] = float((inside & (np.abs(measured - joints[:, :, 2]) < ON_SURFACE)).mean())
    return found


def lag(parser: argparse.ArgumentParser) -> None:
    """Print the share of wrists and hands on the surface by shift, for both data sets, and write JSON."""
    parser.add_argument("--stride", type=int, default=4)
    options = parser.parse_args()
    figures = {}
    for name in SHIFTS:
        files = sorted((DEPTH / name).glob("*_depth.mat"))[:: options.stride]
        recordings = [recording for recording in map(open_recording, files) if recording.reference_joints is not None]
        known = [each for each in recordings if np.isfinite(each.reference_joints).all()]
        shares = [on_surface(recording) for recording in known]
        figures[name] = {f"{shift:g}": float(np.mean([share[shift] for share in shares])) for shift in LAGS.tolist()}
        print(name, len(known), "recordings:", ", ".join(f"{k}: {100 * v:.1f} %" for k, v in figures[name].items()))
    print(save_figures("kinect_lag", figures, vars(options)))


def main() -> None:
    """Run the part that is asked for."""
    run_part(__doc__, {"tracked": tracked, "offsets": offsets, "lag": lag})


if __name__ == "__main__":
    main()
