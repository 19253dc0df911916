"""Export of joints as text tables: CSV for spreadsheets, TRC for OpenSim."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.io.files import save_text
from toolkit.tracks import STATE_NAMES
from toolkit.tracks.runs import Person


def joint_columns(person: Person, *, level: bool) -> dict[str, np.ndarray]:
    """Return a track as columns (T,) by name, in order.

    `state` (tracked, lost, empty), then `<joint>_x_m, <joint>_y_m, <joint>_z_m` for each of the 20, then
    `<joint>_confidence` and `<joint>_observed` (False for an inferred joint), then `left_foot_contact` and
    `right_foot_contact`. In frames without the person numbers are NaN and flags False.

    Parameters
    ----------
    person : person with the track
    level : use the level frame (y up); else the camera frame
    """
    track, there, names = person.track, person.there[:, None], skeleton.REPORTED
    joints = person.joints_level if level else np.where(there[..., None], track.joints, np.float32(np.nan))
    sure, seen, carries = np.where(there, track.confidence, np.float32(np.nan)), track.observed & there, track.contact
    columns: dict[str, np.ndarray] = {"state": np.array(STATE_NAMES)[track.state]}
    columns |= {f"{name}_{axis}_m": joints[:, j, k] for j, name in enumerate(names) for k, axis in enumerate("xyz")}
    columns |= {f"{name}_confidence": sure[:, j] for j, name in enumerate(names)}
    columns |= {f"{name}_observed": seen[:, j] for j, name in enumerate(names)}
    return columns | {f"{side}_foot_contact": (carries & there)[:, k] for k, side in enumerate(("left", "right"))}


def export_csv(path: str | Path, person: Person, *, level: bool = False) -> None:
    """Write the reported joints as CSV, one row per frame: `time_s`, and the columns of `joint_columns`.

    Flags are 1 and 0; in frames without the person all columns but time and state are blank.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    columns, here = joint_columns(person, level=level), person.there.tolist()
    cells = [[f"{time:.6f}" for time in person.track.timestamps.tolist()], columns.pop("state").tolist()]
    for name, values in columns.items():
        if values.dtype == np.bool_:
            cells.append([str(int(flag)) if there else "" for flag, there in zip(values, here, strict=True)])
        else:
            cells.append(_fields(values.tolist(), 4 if name.endswith("_confidence") else 6))
    lines = [",".join(["time_s", "state", *columns]), *map(",".join, zip(*cells, strict=True))]
    save_text(path, "\n".join(lines) + "\n")


def export_trc(path: str | Path, person: Person) -> None:
    """Write the reported joints as markers in a TRC file (OpenSim, Pose2Sim): y up, metres, tabs.

    The fields are blank in frames without the person.

    Raises
    ------
    UsageError
        The track has too few frames for a frame rate.
    OutputError
        The file cannot be written.
    """
    write_trc(path, skeleton.REPORTED, person.joints_level, person.times, person.frame_rate())


def write_trc(path: str | Path, names: Sequence[str], points: np.ndarray, times: np.ndarray, frame_rate: float) -> None:
    """Write points (T, M, 3), metres, as a TRC file, blank where they are NaN; raises OutputError."""
    rate, count = f"{frame_rate:.6g}", len(times)
    settings = {
        "DataRate": rate, "CameraRate": rate, "NumFrames": count, "NumMarkers": len(names), "Units": "m",
        "OrigDataRate": rate, "OrigDataStartFrame": 1, "OrigNumFrames": count,
    }  # fmt: skip
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{Path(path).name}",
        "\t".join(settings),
        "\t".join(str(value) for value in settings.values()),
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(len(names)) for axis in "XYZ"),
        "",
    ]
    for i, (time, row) in enumerate(zip(times, points.reshape(count, -1), strict=True)):
        lines.append("\t".join([str(i + 1), f"{time:.6f}", *_fields(row.tolist(), 6)]))
    save_text(path, "\n".join(lines) + "\n")


def _fields(values: list[float], digits: int) -> list[str]:
    return ["" if np.isnan(value) else f"{value:.{digits}f}" for value in values]
