"""Export of joint angles as a table, and of motion and markers for OpenSim."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.io.files import save_text
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


def export_angles(path: str | Path, person: Person) -> None:
    """Write the ISB angles as CSV: `time_s`, `state`, a column `<joint>_<motion>_<sequence>_deg` for each angle, then
    `<joint>_locked`, 1 in gimbal lock, where only the sum of the first and the third angle is known.

    Angles are blank in frames without the person.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    track = person.track
    found = joint_angles(person.body, track.pose, person.there)
    lines = [",".join(["time_s", "state", *COLUMNS, *(f"{joint.joint}_locked" for joint in JOINTS)])]
    for i, (time, here) in enumerate(zip(track.timestamps.tolist(), person.there.tolist(), strict=True)):
        values = [f"{value:.4f}" if here else "" for value in found.degrees[i].tolist()]
        flags = [str(int(flag)) if here else "" for flag in found.locked[i].tolist()]
        lines.append(",".join([f"{time:.6f}", STATE_NAMES[track.state[i]], *values, *flags]))
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
