"""UTD-MHAD depth recordings: MATLAB files of a mirrored Kinect v1, with an optional reference skeleton.

`d_depth` (240, 320, T) holds millimetres; `d_skel` (20, 3, T) metres, x right, y up, z forward, projected by u = 160 +
f x / z, v = 120 - f y / z, f = 285.63 pixels. The source is mirrored; u' = 319 - u and x' = -x correct it.

The files contain no times. By the clock of the wearable sensors of the same clips their frames are 53 ms apart (47 to
59 ms for 5 to 95 % of the clips), not the 33 ms of a Kinect.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import RecordingError
from toolkit.io.matlab import read_matlab
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import array_frames, chosen_camera, frame_times, recording_of_source
from toolkit.sensing.recording import Recording

SUFFIX = "_depth"

_OURS_FROM_KINECT = {3: 0, **{4 + i: 4 + i for i in range(16)}}


def joints_from_kinect(found: np.ndarray) -> np.ndarray:
    """Return our 20 joints, camera frame of the raw image, of a Kinect skeleton (20, 3, T): float32 (T, 20, 3), metres.

    Head, shoulders to hands and hips to feet are copied; pelvis, neck and spine are derived as for each skeleton.
    """
    kinect = np.transpose(found, (2, 0, 1)) * (1.0, -1.0, 1.0)
    joints = np.empty(kinect.shape, dtype=np.float32)
    for ours, theirs in _OURS_FROM_KINECT.items():
        joints[:, ours] = kinect[:, theirs]
    shoulders, hips = (4, 8), (12, 16)
    joints[:, 0], joints[:, 1], joints[:, 2] = skeleton.trunk_of(kinect[:, hips], kinect[:, shoulders])
    return joints


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a UTD-MHAD recording with the skeleton of the option `skeleton`, by default beside it."""
    depth = np.moveaxis(_load(path, "d_depth"), 2, 0)
    beside = _skeleton_path(path, options)
    reference = None
    if beside is not None:
        kinect = _load(beside, "d_skel")
        if kinect.shape != (20, 3, len(depth)):
            raise RecordingError(f"d_skel in {beside} has shape {kinect.shape}; expected (20, 3, {len(depth)})")
        reference = joints_from_kinect(kinect)
    intrinsics = (285.63, 285.63, 160.0, 120.0)  # of the raw, mirrored image, pixels
    frame_rate = 18.8  # frame rate in Hz by the clock of the wearable sensors: median over the 108 shared clips
    return recording_of_source(
        path,
        array_frames(depth),
        chosen_camera(options, depth.shape[1:], path, np.array(intrinsics)),
        options,
        mirrored=True,
        timestamps=frame_times(len(depth), options, frame_rate),
        reference_joints=reference,
    )


def _skeleton_path(path: Path, options: ReaderOptions) -> Path | None:
    file = f"{path.stem.removesuffix(SUFFIX)}_skeleton.mat"
    if options.skeleton is None:
        beside = path.parent / file
        return beside if beside.exists() else None
    chosen = Path(options.skeleton)
    chosen = chosen / file if chosen.is_dir() else chosen
    if not chosen.exists():
        raise RecordingError(f"there is no skeleton at {chosen}; correct the path or leave it out")
    return chosen


def _load(path: Path, key: str) -> np.ndarray:
    stored = read_matlab(path, RecordingError)
    if key not in stored:
        raise RecordingError(
            f"{path} has no {key!r}, so it is no file of UTD-MHAD; it has {', '.join(sorted(stored)) or 'nothing'}: "
            "save its depth as .npy (frames, height, width) and give --intrinsics"
        )
    array = stored[key]
    if array.ndim != 3:
        raise RecordingError(f"{key} in {path} has shape {array.shape}; expected 3 dimensions")
    return array
