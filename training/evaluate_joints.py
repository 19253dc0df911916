"""Score the joints of single frames: held-out crops and recordings with reference joints.

    python -m training.evaluate_joints [HELD.npz] [--network JOINTS.onnx] [--recordings FOLDER...]

Frames at a third and two thirds of each recording (`*_depth.mat`) are compared with the reference joints beside it
(`*_skeleton.mat`), which are another system's estimate. The default is UTD-MHAD in the data folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.datasets.folder import data_folder
from toolkit.landmarks.joint_network import ASSET, OPPOSITE, PAIRS, JointNetwork
from toolkit.recordings.opening import open_upright
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.cloud import Cloud
from training.joint_crops import OUTSIDE, PIXEL, SELF_OCCLUDED, SIZE, UNOBSERVED, VISIBLE

SHARES = (1 / 3, 2 / 3)
MIN_POINTS = 300
SCORED = ("head", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")
"""Joints that are scored on recordings: without hands, feet and the derived ones."""


def score_crops(network: JointNetwork, path: Path) -> str:
    """Return the mean errors on the crops of `training.joint_crops` by visibility, one line."""
    stored, errors = np.load(path), []
    level = np.diag([1.0, -1.0, -1.0])
    for depth, (reference, *middle), joints in zip(stored["depth"], stored["crop"], stored["joints"], strict=True):
        focal = float(reference) / PIXEL
        centre = 0.5 * (SIZE - 1) - focal * np.array(middle, dtype=np.float64)
        # `Camera` refuses a principal point outside the image, where that of a crop may lie.
        camera: Any = SimpleNamespace(intrinsics=np.array([focal, focal, *centre]))
        unobserved = depth == UNOBSERVED
        metres = np.where(unobserved, 0, depth).astype(np.float32) * np.float32(0.001)
        found = network.estimate(Cloud.from_depth(metres, camera, level), unobserved)
        errors.append(np.linalg.norm(found.points * [1, -1, -1] - joints, axis=1))
    error, seen = np.array(errors), stored["seen"]
    parts = [f"{1000 * error[seen == kind].mean():.0f} mm" for kind in (VISIBLE, SELF_OCCLUDED, OUTSIDE)]
    return f"{path.name}: {len(error)} crops; visible, self-occluded, outside: {', '.join(parts)}"


def score_recordings(network: JointNetwork, folder: Path) -> str:
    """Return the agreement with the reference joints of the recordings in a folder, one line."""
    rows = [row for row, name in enumerate(skeleton.REPORTED) if name.split("_")[-1] in SCORED]
    errors, exchanged = [], []
    for path in sorted(folder.glob("*_depth.mat")):
        recording = open_upright(path)
        reference = recording.reference_joints
        if reference is None:
            continue
        rotation = level_rotation(recording.up_camera)
        for share in SHARES:
            frame = int(share * len(recording) + 1e-6)
            metres = recording.depth(frame).astype(np.float32) * np.float32(0.001)
            if (metres > 0).sum() < MIN_POINTS:
                continue
            points = network.estimate(Cloud.from_depth(metres, recording.camera, rotation)).points
            camera = np.stack([(points * column).sum(axis=1) for column in rotation.T], axis=1)
            error = np.linalg.norm(camera - reference[frame], axis=1)
            other = np.linalg.norm(camera[OPPOSITE] - reference[frame], axis=1)
            errors.append(error[rows])
            exchanged += [float(np.nanmean(other[limb]) < np.nanmean(error[limb])) for limb in PAIRS]
    found = np.array(errors)
    known = 1000 * found[np.isfinite(found)]
    figures = (
        f"mean {known.mean():.0f} mm", f"median {np.median(known):.0f} mm",
        f"within 150 mm {100 * (known < 150).mean():.0f} %",
        f"sides exchanged {100 * np.mean(exchanged):.1f} %",
    )  # fmt: skip
    return f"{folder.name}: {len(found)} frames; {', '.join(figures)}"


def main() -> None:
    """Score and print a line for each set."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("held", type=Path, nargs="?", help="crops of training.joint_crops")
    parser.add_argument("--network", type=Path, default=ASSET)
    parser.add_argument("--recordings", type=Path, nargs="*", default=[data_folder() / "depth" / "utd_mhad"])
    options = parser.parse_args()
    network = JointNetwork(options.network)
    if options.held is not None:
        print(score_crops(network, options.held))
    for folder in options.recordings:
        if any(folder.glob("*_depth.mat")):
            print(score_recordings(network, folder))


if __name__ == "__main__":
    main()
