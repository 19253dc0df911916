"""Poses of our body as files for other programs: BVH for animation tools, CSV for tables."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.errors import BodyError, UsageError
from toolkit.files import save_text
from toolkit.track import RunInfo, Track

BVH_UNITS_PER_METRE = 100.0
"""Centimetres, as animation tools expect."""
EULER_ORDER = "ZXY"
"""Order in which a joint's channels turn it: Z, then X, then Y about the turned axes."""


def export_bvh(path: str | Path, body: Body, poses: np.ndarray, frame_rate: float) -> None:
    """Write poses as BVH: the body's T-pose as rest pose, constant bone lengths, three Euler channels per joint.

    World y up, centimetres, degrees. Head, hands and feet are end sites. The file is written whole or not at all.

    Parameters
    ----------
    path : the file
    body : the body whose bones are written
    poses : float64 (T, P), in a y-up frame (`track.pose` or `PoseClip.poses`), T at least 1
    frame_rate : frames a second

    Raises
    ------
    BodyError
        The poses have another length than the body's or a value is not finite.
    UsageError
        There are no poses or the frame rate is not positive.
    OutputError
        The file cannot be written.
    """
    poses = skeleton.check_pose(np.atleast_2d(poses))
    if len(poses) == 0 or not frame_rate > 0:
        raise UsageError(f"cannot export {len(poses)} poses at {frame_rate} frames a second; both must be positive")
    lines: list[str] = ["HIERARCHY"]
    order: list[int] = []
    _write_joint(body, 0, 0, lines, order)
    lines += ["MOTION", f"Frames: {len(poses)}", f"Frame Time: {1.0 / frame_rate:.9f}"]
    table = np.concatenate(
        [poses[:, skeleton.ROOT_POSITION] * BVH_UNITS_PER_METRE, _euler_degrees(poses, order)], axis=1
    )
    rows = io.StringIO()
    np.savetxt(rows, table, fmt="%.5f")
    save_text(path, "\n".join(lines) + "\n" + rows.getvalue())


def export_csv(path: str | Path, joints: np.ndarray, timestamps: np.ndarray) -> None:
    """Write the reported joints as CSV: `time_s`, then `<joint>_x_m, <joint>_y_m, <joint>_z_m` for each of the 20.

    Parameters
    ----------
    path : the file
    joints : (T, 20, 3), metres, in the frame that they have; NaN is written as an empty field
    timestamps : (T,), seconds

    Raises
    ------
    BodyError
        The shapes do not fit.
    OutputError
        The file cannot be written.
    """
    joints, times = np.asarray(joints, dtype=np.float64), np.asarray(timestamps, dtype=np.float64)
    expected = (len(times), len(skeleton.REPORTED), 3)
    if times.ndim != 1 or joints.shape != expected:
        raise BodyError(
            f"cannot export joints of shape {joints.shape} at {times.shape} timestamps; expected {expected}"
        )
    header = ["time_s", *(f"{name}_{axis}_m" for name in skeleton.REPORTED for axis in "xyz")]
    rows = np.concatenate([times[:, None], joints.reshape(len(times), -1)], axis=1)
    lines = [",".join("" if np.isnan(value) else f"{value:.6f}" for value in row) for row in rows.tolist()]
    save_text(path, "\n".join([",".join(header), *lines]) + "\n")


def export_track(run: str | Path, path: str | Path) -> None:
    """Write the track in a run folder as BVH (level frame) or CSV (camera frame), by the suffix of `path`.

    A BVH file has one frame rate: the median one of the track.

    Raises
    ------
    TrackError
        The folder holds no finished track.
    UsageError
        The suffix is neither `.bvh` nor `.csv`, or there are too few frames for a frame rate.
    OutputError
        The file cannot be written.
    """
    track, suffix = Track.load(run), Path(path).suffix.lower()
    if suffix == ".csv":
        export_csv(path, track.joints, track.timestamps)
    elif suffix == ".bvh":
        if len(track) < 2:
            raise UsageError(f"{run} has {len(track)} frames; a BVH file needs 2 for its frame rate, export it as .csv")
        frame_rate = 1.0 / float(np.median(np.diff(track.timestamps)))
        export_bvh(path, RunInfo.load(run).body(), track.pose, frame_rate)
    else:
        raise UsageError(f"{path} is neither .bvh nor .csv; choose one of the two suffixes")


def _write_joint(body: Body, joint: int, depth: int, lines: list[str], order: list[int]) -> None:
    """Append a joint and all below it to the HIERARCHY section, and the joints in file order to `order`."""
    pad = "\t" * depth
    parent = skeleton.PARENTS[joint]
    offset = np.zeros(3) if parent < 0 else body.joints[joint] - body.joints[parent]
    channels = [f"{axis}rotation" for axis in EULER_ORDER]
    if parent < 0:
        channels = ["Xposition", "Yposition", "Zposition", *channels]
    kind = "ROOT" if parent < 0 else "JOINT"
    lines += [
        f"{pad}{kind} {skeleton.JOINT_NAMES[joint]}",
        pad + "{",
        f"{pad}\tOFFSET {_centimetres(offset)}",
        f"{pad}\tCHANNELS {len(channels)} {' '.join(channels)}",
    ]
    order.append(joint)
    for child in np.flatnonzero(skeleton.PARENTS == joint):
        _write_joint(body, int(child), depth + 1, lines, order)
    for site in np.flatnonzero(skeleton.SITE_PARENTS == joint):
        tip = _centimetres(body.sites[site] - body.joints[joint])
        lines += [f"{pad}\tEnd Site", pad + "\t{", f"{pad}\t\tOFFSET {tip}", pad + "\t}"]
    lines.append(pad + "}")


def _centimetres(vector: np.ndarray) -> str:
    return " ".join(f"{value * BVH_UNITS_PER_METRE:.6f}" for value in vector)


def _euler_degrees(poses: np.ndarray, order: list[int]) -> np.ndarray:
    """Euler angles (T, 3 J) of the joints in file order, degrees."""
    from scipy.spatial.transform import Rotation

    vectors = np.zeros((len(poses), len(order), 3))
    vectors[:, skeleton.DOF_JOINT, skeleton.DOF_AXIS] = poses[:, 3:]
    angles = Rotation.from_rotvec(vectors[:, order].reshape(-1, 3)).as_euler(EULER_ORDER, degrees=True)
    return angles.reshape(len(poses), -1)
