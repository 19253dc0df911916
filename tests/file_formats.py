"""Formats that the project reads: a writer of a small file and a reader of its content for each."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tests.container_files import mkv_recording
from tests.mocap_helpers import AMC_ARM, ASF_ARM
from tests.sample_files import (
    amass_file,
    body_file,
    bvh_file,
    calibration_file,
    classes_file,
    cloud_file,
    database_file,
    index_file,
    inertial_matlab_file,
    intrinsics_file,
    joints_file,
    mat_file,
    metadata_file,
    model_file,
    npz_file,
    people_file,
    person_state_file,
    png_file,
    r3d_file,
    raw_file,
    realsense_file,
    ros_file,
    run_file,
    sensors_file,
    skeletons_file,
    state_file,
    stored_npz_file,
    stray_file,
    text_file,
    track_file,
    tum_file,
)
from tests.sensing_scenes import TOF
from toolkit.app.config import load_settings
from toolkit.body.personal import load_body_file
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.k4abt import read_k4abt
from toolkit.evaluation.orientations import read_truth
from toolkit.inertial.calibration import Calibration
from toolkit.inertial.placement import load_placement
from toolkit.inertial.sensor_files import read_file
from toolkit.io.checkpoint import load_checkpoint, plain, read_state
from toolkit.mocap.read import read_clip
from toolkit.recordings.joint_files import read_joints
from toolkit.recordings.opening import open_recording
from toolkit.retrieval.annotation.annotation_report import read_segments
from toolkit.retrieval.annotation.classes import load_classes
from toolkit.retrieval.annotation.model import MotionModel
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import load_queries
from toolkit.retrieval.workflow.motions import tags_of
from toolkit.sensing.recording import Recording
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.tracking.state import PersonState
from toolkit.tracks import RunInfo, Track
from toolkit.tracks.runs import load_people


@dataclass(frozen=True)
class Format:
    """One file format.

    Attributes
    ----------
    make : writes a small whole file into an empty folder and returns its path
    read : returns the content of a file
    checked : the format has a checksum, so a damaged file never reads as another content
    """

    make: Callable[[Path], Path]
    read: Callable[[Path], Any]
    checked: bool = False


def digest(value: Any) -> str:
    """Return the SHA-256 of all content of a value."""
    total = hashlib.sha256()
    for piece in _pieces(value):
        total.update(piece)
    return total.hexdigest()


def _pieces(value: Any) -> Iterator[bytes]:
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, dict):
        for key in sorted(value, key=str):
            yield str(key).encode()
            yield from _pieces(value[key])
    elif isinstance(value, (list, tuple)):
        yield b"("
        for item in value:
            yield from _pieces(item)
    elif is_dataclass(value) and not isinstance(value, type):
        yield from _pieces({f.name: getattr(value, f.name) for f in fields(value)})
    else:
        yield repr(value).encode()


def _recording(path: Path) -> Any:
    part = path.suffix in (".png", ".json", ".csv", ".txt", ".yaml")
    recording: Recording = open_recording(path.parent if part else path)
    return _everything(recording)


def _raw_recording(path: Path) -> Any:
    return _everything(open_recording(path.parent, intrinsics=(220.0, 220.0, 87.5, 71.5), size=(176, 144)))


def _everything(recording: Recording) -> dict[str, Any]:
    known = {
        name: getattr(recording, name)
        for name in ("camera", "timestamps", "background", "joints", "reference_joints", "stored_up")
    }
    colors = [recording.color(i) for i in range(len(recording))]
    return {**known, "frames": [frame.copy() for frame in recording.frames()], "colors": colors}


def _read_index(path: Path) -> Any:
    index = KeyframeIndex.open(path)
    return index.names, index.document_starts, index.words, index.grades, index.places


def _person_state(path: Path) -> Any:
    """Return a person's state and the result of a step with it."""
    state = read_state(load_checkpoint(path, "person"), PersonState, "person")
    moved = None if state.pose is None else state.body.joint_positions(state.pose[None])
    return plain(state), moved, state.rng().random()


QUERIES = json.dumps(
    {"version": 1, "queries": [{"label": "a", "keyframes": [{"F1": 1}, {"F20": 0}], "distances": [[0, 30]], "lead": 3}]}
)

STO = "DataRate=100.0\nDataType=Quaternion\nversion=3\nendheader\ntime\tpelvis_imu\n0.00\t1,0,0,0\n0.01\t0.8,0.6,0,0\n"


def _sensors(name: str, text: str) -> Format:
    """Write a text file of a sensor's software."""
    return Format(text_file(name, text), read_file)


FORMATS: dict[str, Format] = {
    "recording npz": Format(npz_file, _recording, checked=True),
    "recording npz, stored": Format(stored_npz_file, _recording, checked=True),
    "recording png": Format(png_file, _recording),
    "recording intrinsics json": Format(intrinsics_file, _recording),
    "recording tum list": Format(tum_file, _recording),
    "recording stray odometry": Format(stray_file, _recording),
    "recording mat": Format(mat_file, _recording),
    "recording pcd": Format(partial(cloud_file, ".pcd"), _recording),
    "recording ply": Format(partial(cloud_file, ".ply"), _recording),
    "recording mkv": Format(lambda folder: mkv_recording(folder / "take.mkv"), _recording),
    "recording bag": Format(partial(ros_file, "take.bag"), _recording),
    "recording db3": Format(partial(ros_file, "take_sqlite"), _recording),
    "recording mcap": Format(partial(ros_file, "take_mcap"), _recording),
    "recording r3d": Format(r3d_file, _recording),
    "pose database": Format(database_file, PoseDatabase.load, checked=True),
    "motion classes": Format(classes_file, load_classes, checked=True),
    "keyframe index": Format(index_file, _read_index, checked=True),
    "track npz": Format(track_file, Track.load, checked=True),
    "run json": Format(run_file, lambda path: replace(RunInfo.load(path.parent), folder="")),
    "people json": Format(people_file, lambda path: load_people(path.parent)),
    "tracker state": Format(state_file, lambda path: load_checkpoint(path, "hybrid"), checked=True),
    "person state": Format(person_state_file, _person_state, checked=True),
    "queries json": Format(text_file("q.json", QUERIES), load_queries),
    "labels csv": Format(
        text_file("l.csv", "clip,label\na,walk\nb,jump\n"), lambda path: tags_of([Path("a.bvh")], table=path)
    ),
    "segments csv": Format(text_file("s.csv", "start,end,label\n0,1.5,walk\n1.5,2,jump\n"), read_segments),
    "settings yaml": Format(
        text_file("s.yaml", "seed: 3\nsensing:\n  segment: person\n"), lambda path: load_settings(HybridSettings, path)
    ),
    "bvh": Format(bvh_file, read_clip),
    "amc": Format(text_file("arm_1.amc", AMC_ARM, {"arm.asf": ASF_ARM}), read_clip),
    "asf": Format(
        text_file("arm.asf", ASF_ARM, {"arm_1.amc": AMC_ARM}), lambda path: read_clip(path.with_name("arm_1.amc"))
    ),
    "amass npz": Format(amass_file, read_clip, checked=True),
    "recording realsense db3": Format(realsense_file, _recording),
    "recording raw": Format(raw_file, _raw_recording),
    "joints json": Format(joints_file, lambda path: read_joints(path.parent, 2, TOF)),
    "body npz": Format(body_file, load_body_file, checked=True),
    "sensors npz": Format(partial(sensors_file, ".npz"), read_file, checked=True),
    "sensors csv": Format(partial(sensors_file, ".csv"), read_file),
    "sensors sto": _sensors("take.sto", STO),
    "sensors mat": Format(inertial_matlab_file, read_file),
    "sensor placement yaml": Format(text_file("p.yaml", "00B421AF: left_shin\n7: pelvis\n"), load_placement),
    "sensor calibration json": Format(calibration_file, Calibration.load),
    "known errors csv": Format(text_file("truth.csv", "run,limb,start,end\na,left_shin,1.5,2\n"), read_truth),
    "motion model": Format(model_file, MotionModel.load, checked=True),
    "skeletons json": Format(skeletons_file, lambda path: read_k4abt(path).at(np.array([0.0, 0.0333]))),
    "recording db3 metadata": Format(metadata_file, _recording),
}
