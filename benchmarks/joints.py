"""Joints in the image, found by the network: `depthmocap bench joints PART`, which is one of

- `detected [--split tune|report] [--takes 2] [--frames 30] [--real]`: simulated takes of the suite in colour. The
  network's joints, in the colour and in the shaded depth, against the true ones, as millimetres in the image at each
  joint's depth; their place in space after lifting with the depth; and the share of frames in which left and right are
  swapped (the joints fit the truth twice as well with the names exchanged). With `--real` also the shaded depth of
  UTD-MHAD against the Kinect SDK's joints, which are no truth, and the colour frame of a RealSense camera against the
  joints of OpenPose.
- `followed [--rows swarm,hybrid,not told] [--database POSES]`: the RealSense clip, 40
  frames of two people in a room, one seated. Joints are found in the colour, of all people, once; the swarm tracker,
  and the hybrid one beside it, follow with them, `not told` is the hybrid one without. There is no truth: printed is
  how far the fitted joints lie from the detected ones in the image, at the joint's distance.

Both need the pose model (`depthmocap joints --fetch`).
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import run_part, save_figures
from benchmarks._rows import add_database_options, add_take_options, poses_of
from tests.support.casting import Scene
from tests.support.scenes import people_of, shot_of
from tests.support.suite import GROUPS, RATE, WORK, chosen_takes, digest_of
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline import TrackerRecipe, track_recording
from toolkit.app.pipeline.joint_choice import JointChoice
from toolkit.app.pipeline.store_joints import store_joints
from toolkit.body import skeleton
from toolkit.datasets.folder import data_folder
from toolkit.mocap.clip import PoseClip
from toolkit.people.image_joints.detected_joints import DetectedJoints
from toolkit.people.image_joints.joint_formats import COCO_18, POSE_MODEL, reported_rows
from toolkit.people.image_joints.pose_model import PoseModel
from toolkit.people.joint_masks import on_cut_out
from toolkit.people.sighting import Sighting
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.people.survey import find_people
from toolkit.recordings.opening import open_recording, open_upright
from toolkit.sensing.joints2d import Joints2D, lift, mirrored_rows
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.simulation.simulate import simulate_scene
from toolkit.tracks import TRACKED, Track
from toolkit.tracks.runs import load_people

DEPTH = data_folder() / "depth"
FOUND = [skeleton.REPORTED.index(name) for name in POSE_MODEL]
"""The joints that the network knows."""
SOURCES = ("colour", "depth")
STRIDE = 3
"""Every so many frames of a take are looked at: motion between them is as at 10 frames a second."""


def colored(take: Scene, work: Path, frames: int) -> Path:
    """The take in colour, made if it is not there yet."""
    digest = digest_of((people_of, shot_of), ["toolkit/simulation", "toolkit/mocap", "toolkit/body"], take)
    path = work / "recordings" / f"{take.name}_color_{frames}_{digest}.npz"
    if not path.exists():
        (person,) = people_of(take, frames * STRIDE)
        assert isinstance(person.clip, PoseClip)
        shot = replace(shot_of(take, [person]), color=True, frame_rate=RATE / STRIDE)
        simulate_scene([replace(person, clip=person.clip.every(RATE / STRIDE))], path, shot)
    return path


def detections(
    recording: Recording, model: PoseModel, source: str, truth: np.ndarray
) -> Iterator[tuple[Sighting, np.ndarray]]:
    """Sightings in which joints were detected, and the true joints (20, 3) of that frame."""
    finder = SinglePersonSegmenter.of(recording)
    detect = DetectedJoints(model, recording.camera, in_color=source == "colour")
    for i, frame in enumerate(recording.stream(color=detect.needs_color)):
        (seen,) = detect.add(frame, finder.find(frame.depth_mm, frame.timestamp, {}))
        yield seen, truth[i]


def errors_mm(pixels: np.ndarray, truth: np.ndarray, sighting: Sighting) -> np.ndarray:
    """Distances (17,) in the image, at the depth of each joint, millimetres."""
    off = (pixels - sighting.camera.project(truth))[FOUND] / (sighting.camera.fx, sighting.camera.fy)
    return 1000.0 * np.hypot(*off.T) * truth[FOUND, 2]


def score(found: Iterable[tuple[Sighting, np.ndarray]]) -> dict[str, list[np.ndarray]]:
    """Per frame: errors, confidences, errors in space and along z, and whether the sides are swapped."""
    rows: dict[str, list[np.ndarray]] = {"mm": [], "confidence": [], "space_mm": [], "z_mm": [], "swapped": []}
    for sighting, truth in found:
        joints = sighting.joints
        if joints is None:
            joints = Joints2D.of_rows(np.full((20, 3), np.nan))
        errors = errors_mm(joints.pixels, truth, sighting)
        exchanged = mirrored_rows(joints.rows, 0)[:, :2] * (-1.0, 1.0) - (1.0, 0.0)
        other = errors_mm(exchanged, truth, sighting)
        lifted = 1000.0 * (lift(joints, sighting.depth, sighting.camera).points - truth)[FOUND]
        rows["mm"].append(errors)
        rows["confidence"].append(joints.confidence[FOUND])
        rows["space_mm"].append(np.linalg.norm(lifted, axis=1))
        rows["z_mm"].append(lifted[:, 2])
        seen = np.isfinite(errors).any() and np.isfinite(other).any()
        rows["swapped"].append(np.array([seen and np.nanmedian(other) < 0.5 * np.nanmedian(errors)]))
    return rows


def figures_of(rows: dict[str, list[np.ndarray]]) -> dict[str, float]:
    """What is reported of the frames; a joint that was not found counts as far off."""
    mm, confidence, space = (np.concatenate(rows[name]) for name in ("mm", "confidence", "space_mm"))
    known, lifted, sure = np.isfinite(mm), space[np.isfinite(space)], confidence > 0.95
    return {
        "frames": len(rows["mm"]),
        "median_mm": float(np.median(mm[known])),
        "within_50": float(np.mean(known & (mm < 50))),
        "within_100": float(np.mean(known & (mm < 100))),
        "sure_within_100": float(np.mean(mm[sure] < 100)) if sure.any() else float("nan"),
        "swapped": float(np.mean(np.concatenate(rows["swapped"]))),
        "space_median_mm": float(np.median(lifted)),
        "space_within_100": float(np.mean(lifted < 100)),
        "z_bias_mm": float(np.nanmedian(np.concatenate(rows["z_mm"]))),
    }


def joined(parts: Iterable[dict[str, list[np.ndarray]]]) -> dict[str, list[np.ndarray]]:
    """The frames of several recordings."""
    whole: dict[str, list[np.ndarray]] = {}
    for part in parts:
        for name, rows in part.items():
            whole.setdefault(name, []).extend(rows)
    return whole


def simulated(options: argparse.Namespace, model: PoseModel) -> dict[str, dict[str, dict[str, float]]]:
    """Figures by source and group."""
    by_source: dict[str, dict[str, list[dict[str, list[np.ndarray]]]]] = {source: {} for source in SOURCES}
    for take in chosen_takes(options.split, count=options.takes):
        recording = open_recording(colored(take, options.work, options.frames))
        assert recording.joints is not None
        for source in SOURCES:
            rows = score(detections(recording, model, source, recording.joints))
            by_source[source].setdefault(take.group, []).append(rows)
            print(f"{take.name:48} {source:7} {_line(figures_of(rows))}", flush=True)
    figures = {}
    for source, groups in by_source.items():
        everything = joined(part for parts in groups.values() for part in parts)
        figures[source] = {"all": figures_of(everything)}
        figures[source] |= {group: figures_of(joined(groups[group])) for group in GROUPS if group in groups}
    return figures


def kinect(model: PoseModel, count: int) -> dict[str, float]:
    """Every fourth frame of some recordings of UTD-MHAD, in shaded depth, against the SDK's joints."""
    rows = []
    for path in islice(sorted((DEPTH / "utd_mhad").glob("*_depth.mat")), 0, None, max(108 // count, 1)):
        recording = open_recording(path)
        if recording.reference_joints is not None:
            rows.append(score(islice(detections(recording, model, "depth", recording.reference_joints), 0, None, 4)))
    return figures_of(joined(rows))


def realsense(model: PoseModel) -> dict[str, Any]:
    """Pixels between the network's joints and OpenPose's in the one frame that has them, by person and joint."""
    folder = DEPTH / "realsense" / "image_i1"
    recording = open_recording(folder)
    openpose = [Joints2D.of_rows(reported_rows(rows, COCO_18)) for rows in np.load(folder / "body_joints.npy")]
    detect = DetectedJoints(model, recording.camera, in_color=True)
    frame, found = next(iter(recording.stream(color=True))), {}
    finder = find_people(recording, SensingSettings())
    for sighting in detect.add(frame, finder.find(frame.depth_mm, frame.timestamp, {})):
        if sighting.joints is None:
            continue
        theirs = max(openpose, key=lambda joints: on_cut_out(joints, sighting.depth))  # noqa: B023
        off = np.hypot(*(sighting.joints.pixels - theirs.pixels).T)
        names = zip(skeleton.REPORTED, off, strict=True)
        found[f"person_{sighting.id}"] = {name: float(pixels) for name, pixels in names if np.isfinite(pixels)}
    return found


def _line(figures: dict[str, float]) -> str:
    return (
        f"median {figures['median_mm']:5.0f} mm, within 50 / 100 mm {100 * figures['within_50']:3.0f} / "
        f"{100 * figures['within_100']:3.0f} %, sides swapped {100 * figures['swapped']:3.0f} %, in space "
        f"{figures['space_median_mm']:4.0f} mm, {100 * figures['space_within_100']:3.0f} %"
    )


def detected(parser: argparse.ArgumentParser) -> None:
    add_take_options(parser)
    parser.set_defaults(takes=2, frames=20)
    parser.add_argument("--real", action="store_true", help="real frames too, where they are")
    parser.add_argument("--recordings", type=int, default=18, help="so many of UTD-MHAD's")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    model = PoseModel.load()
    figures: dict[str, Any] = simulated(options, model)
    for source in SOURCES:
        for group, row in figures[source].items():
            print(f"{options.split} {source:7} {group:6} {_line(row)}")
    if options.real and DEPTH.is_dir():
        figures["kinect_against_sdk"] = kinect(model, options.recordings)
        print(f"Kinect, depth, against the SDK     {_line(figures['kinect_against_sdk'])}")
        figures["realsense_pixels_from_openpose"] = realsense(model)
        for person, pixels in figures["realsense_pixels_from_openpose"].items():
            print(
                person, "median", f"{np.median(list(pixels.values())):.1f} px", {k: round(v) for k, v in pixels.items()}
            )
    print(save_figures(f"joints_{options.split}", figures, vars(options)))


CLIP = DEPTH / "realsense" / "images_n40"


def apart_mm(track: Track, recording: Recording) -> np.ndarray:
    """Distances (N,) of tracked joints from detected ones of the nearest person, millimetres in the image."""
    found = []
    camera = recording.camera
    frames = np.searchsorted(recording.timestamps, track.timestamps - 1e-6)
    for i, joints, state in zip(frames, track.joints, track.state, strict=True):
        if state != TRACKED:
            continue
        pixels = camera.project(joints)
        each = [_off(seen, pixels, (camera.fx, camera.fy), joints[:, 2]) for seen in recording.joints_2d(int(i))]
        if each := [off for off in each if len(off)]:
            found.append(min(each, key=lambda off: float(np.median(off))))
    return np.concatenate(found) if found else np.empty(0)


def _off(seen: Joints2D, pixels: np.ndarray, focal: tuple[float, float], z: np.ndarray) -> np.ndarray:
    sure = seen.sure
    return 1000.0 * np.hypot(*((seen.pixels - pixels)[sure] / focal).T) * z[sure]


def followed(parser: argparse.ArgumentParser) -> None:
    """Track, compare, print, write JSON."""
    parser.add_argument("--clip", type=Path, default=CLIP)
    parser.add_argument("--rows", default="swarm", help="names of settings files, or `not told`, with commas")
    add_database_options(parser)
    options = parser.parse_args()
    stored = options.work / "joints" / "realsense.npz"
    stored.unlink(missing_ok=True)
    recording = store_joints(open_recording(options.clip), stored, JointChoice("colour"), people=None)
    figures: dict[str, Any] = {}
    for row in options.rows.split(","):
        run = options.work / "runs" / "realsense" / row
        shutil.rmtree(run, ignore_errors=True)
        config, joints = ("hybrid", JointChoice("none")) if row == "not told" else (row, JointChoice())
        database = None if row in ("swarm", "qammaz") else poses_of(options)
        tracker = TrackerRecipe(config, parse_overrides(options.set), database=database).build()
        track_recording(open_upright(stored), tracker, run, people=None, joints=joints)
        for person in load_people(run).people:
            track = Track.load(run / person.folder)
            off = apart_mm(track, recording)
            figures[f"{row}, {person.folder}"] = {
                "tracked_frames": int((track.state == TRACKED).sum()),
                "stature_m": person.stature,
                "apart_median_mm": float(np.median(off)) if len(off) else None,
            }
            print(f"{row}, {person.folder}:", figures[f"{row}, {person.folder}"], flush=True)
    print("written:", save_figures("realsense", figures, {"rows": options.rows, "set": options.set}))


def main() -> None:
    """Run the part that is asked for."""
    run_part(__doc__, {"detected": detected, "followed": followed})


if __name__ == "__main__":
    main()
