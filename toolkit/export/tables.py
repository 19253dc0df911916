"""Joints as tables of text: CSV for spreadsheets, TRC for OpenSim and its like."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from toolkit import skeleton
from toolkit.errors import BodyError, UsageError
from toolkit.files import save_text
from toolkit.runs import Person
from toolkit.track import STATE_NAMES


def export_csv(path: str | Path, person: Person, *, level: bool = False) -> None:
    """Write the reported joints as CSV, one row per frame.

    `time_s`, `state` (tracked, lost, empty), then `<joint>_x_m, <joint>_y_m, <joint>_z_m` for each of the 20, then
    `<joint>_confidence` and `<joint>_observed` (1, or 0 for one that was guessed), then `left_foot_contact` and
    `right_foot_contact` (1 where the foot carries). Where no person is there all but time and state is blank.

    Parameters
    ----------
    path : the file
    person : whose track it is
    level : y up, as the person's poses; else the camera frame

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    track = person.track
    joints = person.joints_level if level else np.where(person.there[:, None, None], track.joints, np.nan)
    feet = [f"{side}_foot_contact" for side in ("left", "right")]
    header = [
        "time_s", "state", *(f"{name}_{axis}_m" for name in skeleton.REPORTED for axis in "xyz"),
        *(f"{name}_confidence" for name in skeleton.REPORTED), *(f"{name}_observed" for name in skeleton.REPORTED),
        *feet,
    ]  # fmt: skip
    lines = [",".join(header)]
    for i, (time, here) in enumerate(zip(track.timestamps.tolist(), person.there.tolist(), strict=True)):
        values = [*_fields(joints[i].ravel().tolist())]
        values += [f"{value:.4f}" for value in track.confidence[i].tolist()] if here else [""] * len(skeleton.REPORTED)
        flags = [*track.observed[i].tolist(), *track.contact[i].tolist()]
        values += [str(int(flag)) for flag in flags] if here else [""] * len(flags)
        lines.append(",".join([f"{time:.6f}", STATE_NAMES[track.state[i]], *values]))
    save_text(path, "\n".join(lines) + "\n")


def export_trc(path: str | Path, joints: np.ndarray, timestamps: np.ndarray, frame_rate: float) -> None:
    """Write the reported joints as markers in a TRC file (OpenSim, Pose2Sim): y up, metres, tabs.

    Parameters
    ----------
    path : the file
    joints : (T, 20, 3), metres, in a y-up frame; NaN is written as an empty field
    timestamps : (T,), seconds
    frame_rate : frames a second, as the header says

    Raises
    ------
    BodyError
        The shapes do not fit.
    UsageError
        There are no frames or the frame rate is not positive.
    OutputError
        The file cannot be written.
    """
    joints, times = _checked(joints, timestamps)
    if len(times) == 0 or not frame_rate > 0:
        raise UsageError(f"cannot export {len(times)} frames at {frame_rate} frames a second; both must be positive")
    names, rate = skeleton.REPORTED, f"{frame_rate:.6g}"
    settings = {
        "DataRate": rate, "CameraRate": rate, "NumFrames": len(times), "NumMarkers": len(names), "Units": "m",
        "OrigDataRate": rate, "OrigDataStartFrame": 1, "OrigNumFrames": len(times),
    }  # fmt: skip
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{Path(path).name}",
        "\t".join(settings),
        "\t".join(str(value) for value in settings.values()),
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(len(names)) for axis in "XYZ"),
        "",
    ]
    for i, (time, row) in enumerate(zip(times.tolist(), joints.reshape(len(times), -1).tolist(), strict=True)):
        lines.append("\t".join([str(i + 1), f"{time:.6f}", *_fields(row)]))
    save_text(path, "\n".join(lines) + "\n")


def _checked(joints: np.ndarray, timestamps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    joints, times = np.asarray(joints, dtype=np.float64), np.asarray(timestamps, dtype=np.float64)
    expected = (len(times), len(skeleton.REPORTED), 3)
    if times.ndim != 1 or joints.shape != expected:
        raise BodyError(
            f"cannot export joints of shape {joints.shape} at {times.shape} timestamps; expected {expected}"
        )
    return joints, times


def _fields(row: Iterable[float]) -> list[str]:
    return ["" if np.isnan(value) else f"{value:.6f}" for value in row]
