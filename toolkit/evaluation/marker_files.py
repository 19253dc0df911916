"""Recordings of optical markers, joint centres or joint angles: TRC, C3D, CSV, BVH and OpenSim motion files."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from toolkit.io.errors import RecordingError, optional_package
from toolkit.io.yaml_reader import as_numbers, read_text

UNITS = {"m": 1.0, "meters": 1.0, "cm": 0.01, "centimeters": 0.01, "mm": 0.001, "millimeters": 0.001}
"""Metres per unit, by the name that TRC and C3D files give it."""


@dataclass(frozen=True, eq=False)
class MarkerRecording:
    """Trajectories of markers, and joint angles.

    Attributes
    ----------
    name : stem of the file
    times : float64 (T,), seconds of the recording's own clock, increasing
    labels : names of the M markers without the subject's prefix
    subjects : subject of each marker, "" where the file names none
    points : float64 (T, M, 3), metres, the file's own axes, NaN where a marker was not seen
    angles : name -> float64 (T,), degrees
    notes : corrections made while reading, one sentence each
    """

    name: str
    times: np.ndarray
    labels: tuple[str, ...] = ()
    subjects: tuple[str, ...] = ()
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 3)))
    angles: dict[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def of_subject(self, subject: str) -> MarkerRecording:
        """Return the recording with the markers of one subject only."""
        chosen = [i for i, own in enumerate(self.subjects) if own == subject]
        labels = tuple(self.labels[i] for i in chosen)
        return replace(self, labels=labels, subjects=(subject,) * len(chosen), points=self.points[:, chosen])


def is_marker_file(path: str | Path) -> bool:
    """Return True for a suffix out of `READERS`."""
    return Path(path).suffix.lower() in READERS


def read_markers(path: str | Path) -> MarkerRecording:
    """Read a marker or angle file.

    Markers that exchange their labels for some frames are exchanged back (`untangled`), which a note reports.

    Raises
    ------
    RecordingError
        The file is missing, is not understood, has fewer than two frames, or its times do not increase.
    UsageError
        The package `ezc3d`, which C3D files need, is not installed.
    """
    file = Path(path)
    if not is_marker_file(file):
        raise RecordingError(f"{file} is no marker file; give one of {', '.join(sorted(READERS))}")
    found = READERS[file.suffix.lower()](file)
    if len(found.times) < 2 or not (np.diff(found.times) > 0).all():
        raise RecordingError(f"{file} has {len(found.times)} frames, or times that do not increase; export it again")
    points, exchanged = untangled(found.points)
    notes = found.notes
    if exchanged:
        notes += (f"labels of two markers were exchanged in {exchanged} places; they were exchanged back",)
    return replace(found, points=points, notes=notes)


def untangled(points: np.ndarray) -> tuple[np.ndarray, int]:
    """Exchange back the labels of marker pairs that swap between two frames.

    A pair is swapped where exchanging the two makes the sum of their steps less than half as large.

    Parameters
    ----------
    points : float64 (T, M, 3), metres

    Returns
    -------
    The points, and the number of exchanges.
    """
    points, count = points.copy(), 0
    least_jump = 0.1  # metres, sum of both steps below which nothing is exchanged
    for t in range(1, len(points)):
        step = np.linalg.norm(points[t, :, None] - points[t - 1, None], axis=2)  # [i, j]: from marker j to marker i
        own = np.diag(step)
        straight = own[:, None] + own[None, :]
        crossed = step + step.T
        with np.errstate(invalid="ignore"):
            swapped = np.argwhere(np.triu((straight > least_jump) & (crossed < 0.5 * straight), 1))
        for i, j in swapped.tolist():
            points[t:, [i, j]] = points[t:, [j, i]]
            count += 1
    return points, count


def _split(names: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return labels and subjects of names such as `subject:LKNE`."""
    parts = [name.strip().rpartition(":") for name in names]
    return tuple(label for _, _, label in parts), tuple(subject for subject, _, _ in parts)


def _read_trc(file: Path) -> MarkerRecording:
    hint = "export it as TRC again"
    lines = read_text(file, RecordingError, hint, errors="replace").splitlines()
    if len(lines) < 6 or not lines[0].startswith("PathFileType"):
        raise RecordingError(f"{file} has no TRC header; {hint}")
    fields = dict(zip(lines[1].split(), lines[2].split(), strict=False))
    unit = UNITS.get(fields.get("Units", "").lower())
    if unit is None:
        raise RecordingError(f"{file} has the unit {fields.get('Units', '')!r}; use one of {', '.join(UNITS)}")
    names = [name for name in lines[3].split("\t")[2:] if name.strip()]
    labels, subjects = _split(names)
    table = as_numbers([line.split("\t") for line in lines[5:] if line.strip()], 2 + 3 * len(names))
    points = table[:, 2:].reshape(len(table), len(names), 3) * unit
    points[(points == 0).all(axis=2)] = np.nan  # a marker that was not seen, as some programs write it
    return MarkerRecording(file.stem, table[:, 1], labels, subjects, points)


def _read_c3d(file: Path) -> MarkerRecording:
    ezc3d = optional_package("ezc3d", "c3d", "a C3D file")
    try:
        content = ezc3d.c3d(str(file))
        parameters = content["parameters"]["POINT"]
        names, rate = list(parameters["LABELS"]["value"]), float(parameters["RATE"]["value"][0])
        unit = UNITS[str(parameters["UNITS"]["value"][0]).strip().lower()]
        points = content["data"]["points"][:3].transpose(2, 1, 0) * unit
        missing = (content["data"]["meta_points"]["residuals"][0].T < 0) | (points == 0).all(axis=2)
    except (OSError, KeyError, IndexError, ValueError, RuntimeError) as error:
        raise RecordingError(f"{file} cannot be read as C3D ({error}); export it again") from error
    points[missing] = np.nan
    labels, subjects = _split(names)
    return MarkerRecording(file.stem, np.arange(len(points)) / rate, labels, subjects, points[:, : len(names)])


def _read_csv(file: Path) -> MarkerRecording:
    hint = "write a header `time, NAME_x, NAME_y, NAME_z, ...` and one row a frame"
    lines = [line for line in read_text(file, RecordingError, hint).splitlines() if line.strip()]
    head = [cell.strip().strip('"') for cell in lines[0].split(",")] if lines else []
    times_at = next((i for i, name in enumerate(head) if name.lower() in ("time", "time_s", "t")), None)
    names = [name[:-2] for name in head if name[-2:].lower() == "_x"]
    columns = {name.lower(): i for i, name in enumerate(head)}
    try:
        order = [columns[f"{name}_{axis}".lower()] for name in names for axis in "xyz"]
    except KeyError as error:
        raise RecordingError(f"{file} has no column {error.args[0]}; {hint}") from error
    if times_at is None or not names:
        raise RecordingError(f"{file} has no column `time` or no marker; {hint}")
    table = as_numbers([line.split(",") for line in lines[1:] if line.count(",") == len(head) - 1], len(head))
    points = table[:, order].reshape(len(table), len(names), 3)
    notes: tuple[str, ...] = ()
    # Metres from the origin that a capture volume can reach; larger coordinates of a file without unit are
    # millimetres.
    largest_in_metres = 30.0
    if np.nanmax(np.abs(points), initial=0.0) > largest_in_metres:
        points, notes = points * 0.001, ("the coordinates have no unit and were taken as millimetres",)
    labels, subjects = _split(names)
    return MarkerRecording(file.stem, table[:, times_at], labels, subjects, points, notes=notes)


def _read_bvh(file: Path) -> MarkerRecording:
    from toolkit.mocap.read import read_clip
    from toolkit.mocap.rig import load_rig

    clip = read_clip(file)
    rig = load_rig(clip)
    positions, _ = clip.world()
    named = [(key, clip.index(joint)) for key, joint in rig.joints.items()]
    labels = tuple(key for key, _ in named)
    points = positions[:, [index for _, index in named]]
    return MarkerRecording(file.stem, np.arange(len(clip)) / clip.frame_rate, labels, ("",) * len(labels), points)


def _read_mot(file: Path) -> MarkerRecording:
    hint = "export it from OpenSim again"
    lines = read_text(file, RecordingError, hint, errors="replace").splitlines()
    start = next((i for i, line in enumerate(lines) if line.strip().lower() == "endheader"), None)
    if start is None or len(lines) < start + 3:
        raise RecordingError(f"{file} has no line `endheader` with rows behind it; {hint}")
    names = lines[start + 1].split()
    rows = [line.split() for line in lines[start + 2 :]]
    table = as_numbers([row for row in rows if len(row) == len(names)], len(names))
    if not len(table) or names[0].lower() != "time":
        raise RecordingError(f"the columns of {file} do not fit its names; {hint}")
    degrees = any(line.strip().lower().replace(" ", "") == "indegrees=yes" for line in lines[:start])
    factor = 1.0 if degrees else 180.0 / np.pi
    angles = {
        name: factor * table[:, i] for i, name in enumerate(names) if i and not name.endswith(("_tx", "_ty", "_tz"))
    }
    return MarkerRecording(file.stem, table[:, 0], angles=angles)


READERS = {".trc": _read_trc, ".c3d": _read_c3d, ".csv": _read_csv, ".bvh": _read_bvh, ".mot": _read_mot}
"""Readers by suffix."""
