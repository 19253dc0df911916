"""Real Kinect recordings: `depthmocap bench real PART`, which is one of

- `tracked [--stride 4] [--rows hybrid,local]`: all recordings of UTD-MHAD (27 actions by 4 people). The Kinect SDK's
  skeleton beside each is a reference and no truth, so figures are how well the fitted body explains the depth image,
  agreement within 100 mm without hands and feet (plain, with an offset per joint fitted on the other people, with the
  skeleton in step with the depth), and the share of bodies with a shape coefficient at its bound.
- `offsets`: how our joints differ from the SDK's, joint by joint. Every `--stride`-th recording of UTD-MHAD and MSR
  Action3D is tracked. For each joint the mean offset from the SDK's place to ours in the frame of the torso (left, up,
  forwards), the mean distance, and what is left of it without the offset.
- `lag`: how many frames the SDK's skeleton is ahead of the depth. For each shift, the fraction of its wrists and hands
  in front of which the depth within 120 mm was measured; no tracker is involved. `SHIFTS` are the best ones.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from benchmarks._movement import OPTIONS, tracked_run
from benchmarks._record import benchmark, script
from benchmarks._rows import DATABASE, figures_of, make_tracker, poses_of, track_each
from toolkit.app.config import parse_overrides
from toolkit.body import skeleton
from toolkit.body.shape import ShapeSpace
from toolkit.datasets.folder import data_folder
from toolkit.evaluation.agreement import agreement, torso_frames
from toolkit.evaluation.evaluate import evaluate_runs
from toolkit.fitting.shape import ShapeSettings
from toolkit.recordings.opening import open_recording
from toolkit.sensing.recording import Recording
from toolkit.tracks import TRACKED, RunInfo, Track

DEPTH = data_folder() / "depth"
SHIFTS = {"utd_mhad": -1.5, "msr_action3d": 0.5}
"""Frames by which the skeleton of each data set is read later than its depth, so that both show the same moment."""
LAGS = np.arange(-4.0, 2.1, 0.5)
"""Shifts that `lag` compares, frames."""
ON_SURFACE = 0.12
"""Metres between a joint and the measured surface in front of it: the radius of a forearm and the sensor's noise."""


def shifted(joints: np.ndarray, frames: float) -> np.ndarray:
    """Return joints (T, J, 3) as they are `frames` later, interpolated linearly; those at the ends stay."""
    return np.asarray(ndimage.shift(joints.astype(np.float64), (-frames, 0.0, 0.0), order=1, mode="nearest"))


@benchmark(DATABASE, stride=1, rows="hybrid")
def tracked(options: argparse.Namespace) -> tuple[str, Any]:
    """Track and evaluate the recordings of UTD-MHAD by each row."""
    paths = sorted((DEPTH / "utd_mhad").glob("*_depth.mat"))[:: options.stride]
    figures, overrides = {}, parse_overrides(options.set)
    for row in options.rows.split(","):
        folder = options.work / "runs" / "real" / row.replace(" ", "_")
        runs: dict[Path, Any] = {folder / path.stem: (path, {}) for path in paths}
        failed = track_each(runs, make_tracker(row, poses_of(options), overrides))
        done = {run: path for run, (path, _) in runs.items() if run not in failed}
        table = evaluate_runs(list(done))
        own: dict[str, list[float]] = {"agreement_in_time": [], "at_bound": []}
        for run, path in done.items():
            track, reference = Track.load(run), shifted(open_recording(path).reference_joints, SHIFTS["utd_mhad"])
            own["agreement_in_time"].append(agreement(track.joints, reference[: len(track)]))
            shape = np.array(RunInfo.load(run).shape)
            away = np.abs(shape - ShapeSpace.load().childhood(shape[0])).max()
            own["at_bound"].append(away > ShapeSettings().limit - 1e-3)
        mean = figures_of(table.mean()) | {name: float(np.mean(values)) for name, values in own.items()}
        figures[row] = {"mean": mean, "recordings": {scores.recording: figures_of(scores) for scores in table}}
    return "real", figures


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
        }
        for j, name in enumerate(skeleton.REPORTED)
    }


@benchmark(OPTIONS, stride=5)
def offsets(options: argparse.Namespace) -> tuple[str, Any]:
    """Track every few recordings of both data sets and compare joint by joint."""
    figures: dict[str, Any] = {}
    for name in SHIFTS:
        files = sorted((DEPTH / name).glob("*_depth.mat"))[:: options.stride]
        rows = [offsets_of(file, options.work / name / file.stem, options.database) for file in files]
        joints = by_joint(np.concatenate(rows))
        figures[name] = {"recordings": len(rows), "frames": sum(map(len, rows)), "joints": joints}
    return "kinect_offsets", figures


def on_surface(recording: Recording) -> dict[float, float]:
    """Return the fraction of the reference's wrists and hands that lie on the measured surface, by shift in frames."""
    camera, sides = recording.camera, ("left", "right")
    rows = [skeleton.REPORTED.index(f"{side}_{joint}") for side in sides for joint in ("wrist", "hand")]
    depth = np.stack([recording.depth(i) for i in range(len(recording))]) / 1000.0
    frames, (height, width) = np.arange(len(depth))[:, None], depth.shape[1:]
    found = {}
    for shift in LAGS.tolist():
        joints = shifted(recording.reference_joints, shift)[:, rows]
        u, v = np.rint(np.moveaxis(np.stack([camera.project(frame) for frame in joints]), 2, 0)).astype(np.int64)
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        measured = depth[frames, np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)]
        found[shift] = float((inside & (np.abs(measured - joints[:, :, 2]) < ON_SURFACE)).mean())
    return found


@benchmark(stride=4)
def lag(options: argparse.Namespace) -> tuple[str, Any]:
    """Measure the fraction of wrists and hands on the surface by shift, for both data sets."""
    figures = {}
    for name in SHIFTS:
        files = sorted((DEPTH / name).glob("*_depth.mat"))[:: options.stride]
        recordings = [recording for recording in map(open_recording, files) if recording.reference_joints is not None]
        known = [each for each in recordings if np.isfinite(each.reference_joints).all()]
        shares = [on_surface(recording) for recording in known]
        figures[name] = {f"{shift:g}": float(np.mean([share[shift] for share in shares])) for shift in LAGS.tolist()}
    return "kinect_lag", figures


main = script(__name__, __doc__, {"tracked": tracked, "offsets": offsets, "lag": lag})
