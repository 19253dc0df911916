"""Reference joints of a comparison."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.evaluation.k4abt import is_k4abt, read_k4abt
from toolkit.io.errors import RecordingError
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import rotated_points
from toolkit.sensing.recording import Recording


@dataclass(frozen=True, eq=False)
class Reference:
    """Joints (T, 20, 3), metres, camera frame, NaN = unknown, or (N, T, 20, 3) of N people; `is_truth` is False for an
    estimate of another system."""

    joints: np.ndarray
    is_truth: bool

    @property
    def people(self) -> np.ndarray:
        """Return the joints of all people, (N, T, 20, 3)."""
        return self.joints if self.joints.ndim == 4 else self.joints[None]


def find_reference(recording: Recording, paths: list[Path], frames: int) -> Reference | None:
    """Return the joints for the first `frames` frames of a recording, or None if no person has any.

    A path is a recording with joints, a skeleton for the recording's reader, a JSON file of the Azure Kinect body
    tracking SDK, or a folder with one of them under the recording's stem. The default is the recording itself.

    Raises
    ------
    RecordingError
        A given path is missing, contains no joints of this recording, or joints for another number of frames.
    """
    candidates = [_joints_of(recording)] if not paths else [_from_path(recording, path) for path in paths]
    reference = next((found for found in candidates if found is not None), None)
    if reference is None:
        if paths:
            named = ", ".join(map(str, paths))
            raise RecordingError(
                f"{named} holds no joints for {recording.name}; name a file, or a folder matched by stem"
            )
        return None
    length = reference.joints.shape[-3]
    if length != len(recording):
        raise RecordingError(
            f"the reference of {recording.name} has {length} frames, the recording {len(recording)}; name the right one"
        )
    return Reference(reference.joints[..., :frames, :, :], reference.is_truth)


def _joints_of(recording: Recording) -> Reference | None:
    if recording.joints is not None:
        return Reference(recording.joints, True)
    if recording.reference_joints is not None:
        return Reference(recording.reference_joints, False)
    return None


def _from_path(recording: Recording, path: Path) -> Reference | None:
    if not path.exists():
        raise RecordingError(f"there is no reference at {path}; check the path")
    if path.is_dir():
        own = [p for p in sorted(path.iterdir()) if p.stem == recording.name]
        skeleton = f"{recording.name.removesuffix('_depth')}_skeleton"  # names of UTD-MHAD
        skeletons = [p for p in sorted(path.iterdir()) if p.stem == skeleton]
    else:
        own, skeletons = ([], [path]) if path.stem.endswith("_skeleton") else ([path], [])
    for file in own:
        if is_k4abt(file):
            return _kinect_bodies(recording, file)
        if (found := _joints_of(open_recording(file))) is not None:
            return found
    for file in skeletons:
        with_skeleton = open_recording(recording.path, **{**recording.options, "skeleton": str(file)})
        if (found := _joints_of(with_skeleton)) is not None:
            return found
    return None


def _kinect_bodies(recording: Recording, file: Path) -> Reference:
    """Return skeletons of the Azure Kinect SDK, rotated if the reader turned the camera upright."""
    joints = read_k4abt(file).at(recording.timestamps)
    if not len(joints):
        raise RecordingError(f"no person is in {file}; there is nothing to compare with")
    joints = rotated_points(joints, int(recording.options.get("rotate", 0)) // 90).astype(np.float32)
    return Reference(joints[0] if len(joints) == 1 else joints, False)
