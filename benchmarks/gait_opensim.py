"""Real gait through the whole chain: `depthmocap bench gait_opensim [--database POSES]`. Data: `opensim`.

A laboratory recorded a walk with markers, and OpenSim computed its joint angles (Gait 2392, `subject01_walk1`). The
simulated body walks with these angles on a treadmill before a simulated depth camera. The recording is tracked, its
export `--format opensim` is solved by OpenSim, and the angles are compared: bias and RMS of the difference, degrees.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import depthmocap
from benchmarks._record import benchmark, script
from tests.support import suite
from toolkit.body.body import Body
from toolkit.body.rotations.matrices import vectors_of
from toolkit.body.shape import subject_body
from toolkit.body.skeleton import POSE_NAMES, POSE_SIZE
from toolkit.datasets.folder import data_folder
from toolkit.evaluation.marker_files import MarkerRecording, read_markers
from toolkit.evaluation.marker_statistics import angle_agreement
from toolkit.mocap.clip import PoseClip
from toolkit.motion.angles import ISB_AXES, SAGITTAL
from toolkit.output.export.opensim import solve
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, simulate_scene

RATE = 30.0
NAMES = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "ankle_angle")
ANGLES = tuple(f"{name}_{side}" for name in NAMES for side in "rl")


def turned(z: np.ndarray, x: np.ndarray, y: np.ndarray, *, left: bool = False) -> np.ndarray:
    """Return exponential coordinates (T, 3), body frame, of the sequence Z, X, Y, degrees, in axes of the ISB."""
    from scipy.spatial.transform import Rotation

    rotations = Rotation.from_euler("ZXY", np.column_stack([z, x, y]), degrees=True).as_matrix()
    if left:
        rotations = SAGITTAL @ rotations @ SAGITTAL
    return vectors_of(np.ascontiguousarray(ISB_AXES @ rotations @ ISB_AXES.T))


def poses_of(recording: MarkerRecording, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (T, P) of a body that moves with the angles of the recording, and their times, at `RATE`."""
    times = np.arange(recording.times[0], recording.times[-1], 1.0 / RATE)
    angle = {name: np.interp(times, recording.times, values) for name, values in recording.angles.items()}
    poses = np.zeros((len(times), POSE_SIZE))

    def put(joint: str, vectors: np.ndarray) -> None:
        for k, axis in enumerate("xyz"):
            if f"{joint}_r{axis}" in POSE_NAMES:
                poses[:, POSE_NAMES.index(f"{joint}_r{axis}")] = vectors[:, k]

    nothing = np.zeros(len(times))
    put("root", turned(angle["pelvis_tilt"], angle["pelvis_list"], angle["pelvis_rotation"]))
    put("lumbar", turned(angle["lumbar_extension"], angle["lumbar_bending"], angle["lumbar_rotation"]))
    for side in ("right", "left"):
        s, left = side[0], side == "left"
        hip = turned(angle[f"hip_flexion_{s}"], angle[f"hip_adduction_{s}"], angle[f"hip_rotation_{s}"], left=left)
        put(f"{side}_hip", hip)
        put(f"{side}_knee", turned(angle[f"knee_angle_{s}"], nothing, nothing))
        put(f"{side}_ankle", turned(angle[f"ankle_angle_{s}"], angle[f"subtalar_angle_{s}"], nothing, left=left))
        poses[:, POSE_NAMES.index(f"{side}_shoulder_rz")] = -1.35 if left else 1.35
    lowest = np.array([body.vertex_positions(pose)[:, 1].min() for pose in poses])
    poses[:, 1] = -lowest
    return poses, times


@benchmark(database={"type": Path}, work=suite.WORK / "gait_opensim")
def gait_opensim(options: argparse.Namespace) -> tuple[str, Any]:
    """Simulate, track, solve and compare the walk."""
    folder = data_folder() / "opensim" / "gait2392"
    model, body = folder / "gait2392_thelen2003muscle.osim", subject_body("slim_male", seed=7)
    recording = read_markers(folder / "subject01_walk1_ik.mot")
    poses, times = poses_of(recording, body)
    options.work.mkdir(parents=True, exist_ok=True)
    path = options.work / "walk.npz"
    simulate_scene([SimulatedPerson(PoseClip("walk", poses, RATE, ""), body)], path, CaptureSettings(furnished=False))
    track = depthmocap.track(path, database=options.database)
    truth = {name: np.interp(times, recording.times, recording.angles[name]) for name in ANGLES}
    figures: dict[str, Any] = {}
    solve(track.person, model, options.work / "solved")
    found = read_markers(options.work / "solved" / "motion.mot")
    angles = {name: np.interp(track.person.times, found.times, found.angles[name]) for name in ANGLES}
    for row in angle_agreement(angles, truth):
        figures[row.angle] = {"bias": row.bias, "rms": row.rms, "r": row.correlation, "range": row.range_reference}
    return "gait_opensim", figures


main = script(__name__, __doc__, gait_opensim)
