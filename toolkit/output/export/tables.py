"""Export of joints and angles as tables: CSV for spreadsheets, TRC and MOT for OpenSim, C3D for motion laboratories."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import UsageError, optional_package
from toolkit.io.files import atomic_path, save_text
from toolkit.motion.angles import COLUMNS, JOINTS, coordinates, joint_angles
from toolkit.tracks import STATE_NAMES
from toolkit.tracks.runs import Person

MARKERS: dict[str, tuple[str, tuple[float, float, float]]] = {
    "pelvis": ("pelvis", (-0.0563, -0.0786, 0.0)),
    "spine": ("torso", (0.0, 0.09, 0.0)),
    "neck": ("torso", (0.0032, 0.3715, 0.0)),
    "head": ("torso", (0.02, 0.60, 0.0)),
    "hip": ("pelvis", (-0.0563, -0.0786, 0.0773)),
    "knee": ("tibia", (0.0, 0.0, 0.0)),
    "ankle": ("talus", (0.0, 0.0, 0.0)),
    "foot": ("toes", (0.0, 0.0, 0.0)),
    "shoulder": ("torso", (0.0032, 0.3715, 0.17)),
    "elbow": ("humerus", (0.0131, -0.2863, -0.0096)),
    "wrist": ("hand", (0.0, 0.0, 0.0)),
    "hand": ("hand", (0.0, -0.085, 0.0)),
}
"""Our joints of the right side as markers: body of OpenSim's generic model (Rajagopal 2016) and position in it."""


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
    columns = joint_columns(person, level=level)
    del columns["state"]
    _write_csv(path, person, columns)


def export_angles(path: str | Path, person: Person) -> None:
    """Write the ISB angles as CSV: `time_s`, `state`, a column `<joint>_<motion>_<sequence>_deg` for each angle, then
    `<joint>_locked`, 1 in gimbal lock, where only the sum of the first and the third angle is known.

    Angles are blank in frames without the person.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    found = joint_angles(person.body, person.track.pose, person.there)
    columns = dict(zip(COLUMNS, found.degrees.T, strict=True))
    columns |= {f"{joint.joint}_locked": found.locked[:, k] for k, joint in enumerate(JOINTS)}
    _write_csv(path, person, columns)


def _write_csv(path: str | Path, person: Person, columns: dict[str, np.ndarray]) -> None:
    """Write time, state and columns (T,): flags as 1 and 0, metres with six decimals, other numbers with four."""
    there = person.there.tolist()
    cells = [[f"{time:.6f}" for time in person.track.timestamps.tolist()]]
    cells.append([STATE_NAMES[state] for state in person.track.state])
    for name, values in columns.items():
        form = "d" if values.dtype == np.bool_ else ".6f" if name.endswith("_m") else ".4f"
        cells.append([format(value, form) if here else "" for value, here in zip(values.tolist(), there, strict=True)])
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
        cells = ["" if np.isnan(value) else f"{value:.6f}" for value in row.tolist()]
        lines.append("\t".join([str(i + 1), f"{time:.6f}", *cells]))
    save_text(path, "\n".join(lines) + "\n")


def export_mot(path: str | Path, person: Person) -> None:
    """Write OpenSim coordinates (`.mot`), and `<stem>_markers.xml` with the markers of an exported `.trc`.

    Names and signs are those of the generic full-body model (Rajagopal 2016): ground X forwards for a person who faces
    the camera, Y up, Z to their right; degrees and metres. Frames without the person are left out.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    rows = np.flatnonzero(person.there)
    columns = {"time": person.times[rows]} | coordinates(person, rows)
    head = [
        "Coordinates", "version=1", f"nRows={len(rows)}", f"nColumns={len(columns)}", "inDegrees=yes", "",
        "Units are S.I. units (second, meters, Newtons, ...)", "Angles are in degrees.", "", "endheader",
        "\t".join(columns),
    ]  # fmt: skip
    body = ["\t".join(f"{value:.8f}" for value in row) for row in np.column_stack(list(columns.values())).tolist()]
    save_text(path, "\n".join([*head, *body]) + "\n")
    target = Path(path)
    save_text(target.with_name(f"{target.stem}_markers.xml"), marker_set())


def marker_set() -> str:
    """Return an OpenSim marker set with the names of our joints, as in an exported `.trc`."""
    lines = ['<?xml version="1.0" encoding="UTF-8" ?>', '<OpenSimDocument Version="40000">']
    lines += ['\t<MarkerSet name="depthmocap">', "\t\t<objects>"]
    for name in skeleton.REPORTED:
        side, _, part = name.rpartition("_")
        body, (x, y, z) = MARKERS[part]
        parent = f"{body}_{side[0]}" if side and body not in ("pelvis", "torso") else body
        place = f"{x:g} {y:g} {-z if side == 'left' else z:g}"
        lines += [
            f'\t\t\t<Marker name="{name}">',
            f"\t\t\t\t<socket_parent_frame>/bodyset/{parent}</socket_parent_frame>",
            f"\t\t\t\t<location>{place}</location>",
            "\t\t\t\t<fixed>false</fixed>",
            "\t\t\t</Marker>",
        ]
    return "\n".join([*lines, "\t\t</objects>", "\t\t<groups />", "\t</MarkerSet>", "</OpenSimDocument>"]) + "\n"


def export_c3d(path: str | Path, people: Sequence[Person]) -> None:
    """Write the reported joints as points of a C3D file: y up (level frame), millimetres.

    Several people are in one file; their points are named `<person>:<joint>` as in Vicon files. Points are marked as
    missing in frames without the person. The format has no field for confidences.

    Raises
    ------
    UsageError
        The package is not installed, the tracks have different lengths, or are too short for a frame rate.
    OutputError
        The file cannot be written.
    """
    ezc3d = optional_package("ezc3d", "c3d", "a C3D file")
    rate, lengths = people[0].frame_rate(), {len(person.track) for person in people}
    if len(lengths) > 1:
        raise UsageError(f"the tracks have {sorted(lengths)} frames; a C3D file holds people of one recording")
    millimetres = 1000.0  # units per metre (millimetres)
    points = np.concatenate([person.joints_level for person in people], axis=1) * millimetres
    prefixes = [f"{person.name}:" for person in people] if len(people) > 1 else [""]
    file = ezc3d.c3d()
    parameters = file["parameters"]["POINT"]
    parameters["RATE"]["value"] = [rate]
    parameters["UNITS"]["value"] = ["mm"]
    parameters["LABELS"]["value"] = [prefix + name for prefix in prefixes for name in skeleton.REPORTED]
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Y"])
    file["data"]["points"] = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2).transpose(2, 1, 0)
    with atomic_path(path) as temporary:
        try:
            file.write(str(temporary))
        except RuntimeError as error:  # the package's message for a full disk
            raise OSError(str(error)) from error
