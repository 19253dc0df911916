"""Marker sets: the joint centres that a laboratory's markers define."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.body.rotations.matrices import unit
from toolkit.body.skeleton import REPORTED
from toolkit.evaluation.marker_files import MarkerRecording
from toolkit.io.errors import RecordingError, UsageError
from toolkit.io.files import shipped
from toolkit.io.yaml_reader import read_yaml

PELVIS_KEYS = ("left_asis", "right_asis", "left_psis", "right_psis")


@dataclass(frozen=True)
class MarkerSet:
    """Definition of joint centres by markers.

    Attributes
    ----------
    name : stem of its file
    joints : reported joint -> alternatives; the first whose markers are all in the file counts, its mean is the centre
    pelvis : `PELVIS_KEYS` -> names of the marker on that spine, the first in the file counts
    """

    name: str
    joints: dict[str, tuple[tuple[str, ...], ...]]
    pelvis: dict[str, tuple[str, ...]]

    @property
    def markers(self) -> frozenset[str]:
        """All marker names that the set mentions."""
        named = {name for options in self.joints.values() for option in options for name in option}
        return frozenset(named | {name for names in self.pelvis.values() for name in names})


@dataclass(frozen=True, eq=False)
class JointCentres:
    """Joint centres of a marker recording.

    Attributes
    ----------
    set_name : marker set
    points : float64 (T, 20, 3), metres, axes of the file; NaN where a joint is not defined or a marker is missing
    on_skin : bool (20,), True where a single marker on the skin stands for the joint centre
    """

    set_name: str
    points: np.ndarray
    on_skin: np.ndarray


def marker_set_names() -> list[str]:
    """Return the names of the shipped sets."""
    return sorted(path.stem for path in shipped("markers").glob("*.yaml"))


def load_marker_set(name: str | Path) -> MarkerSet:
    """Load a shipped set by name, or one from a YAML file like those in `configs/markers`.

    Raises
    ------
    UsageError
        There is no such set, or the file is not understood.
    """
    path = Path(name)
    if path.suffix not in (".yaml", ".yml"):
        if str(name) not in marker_set_names():
            raise UsageError(
                f"there is no marker set {str(name)!r}; there are {', '.join(marker_set_names())}, or give a YAML file"
            )
        path = shipped("markers", f"{name}.yaml")
    hint = "write `joints:` with a list of lists of marker names per joint, as in configs/markers"
    table = read_yaml(path, f"the marker set {path.name}", UsageError, hint)
    try:
        joints = {key: tuple(tuple(map(str, option)) for option in options) for key, options in table["joints"].items()}
        pelvis = {key: tuple(map(str, names)) for key, names in table.get("pelvis", {}).items()}
    except (KeyError, TypeError, AttributeError) as error:
        raise UsageError(f"the marker set {path.name} is not understood; {hint}") from error
    unknown = sorted((set(joints) - set(REPORTED)) | (set(pelvis) - set(PELVIS_KEYS)))
    if unknown:
        known = ", ".join((*REPORTED, *PELVIS_KEYS))
        raise UsageError(f"the marker set {path.name} has the unknown joint {unknown[0]!r}; known are {known}")
    return MarkerSet(path.stem, joints, pelvis)


def joint_centres(recording: MarkerRecording, name: str | Path | None = None) -> JointCentres:
    """Compute joint centres of the markers of one subject.

    Hip centres come from the pelvis markers by regression (`hip_centres`), `pelvis` is the midpoint of the hips.

    Parameters
    ----------
    name : marker set or YAML file; without it the shipped set that defines most joints

    Raises
    ------
    UsageError
        There is no such set.
    RecordingError
        No set, or not the named one, defines at least 4 joints; the message names the nearest markers.
    """
    sets = [load_marker_set(each) for each in (marker_set_names() if name is None else [name])]
    found = [_centres(recording, each) for each in sets]
    counts = [int(np.isfinite(each.points).all(axis=2).any(axis=0).sum()) for each in found]
    best = int(np.argmax(counts))
    fewest_joints = 4  # joint centres of a rigid alignment
    if counts[best] >= fewest_joints:
        return found[best]
    known = sorted({marker for each in sets for marker in each.markers})
    near = [
        f"{label} ({', '.join(difflib.get_close_matches(label, known, 2, 0.4)) or 'none'})"
        for label in recording.labels
    ]
    raise RecordingError(
        f"the markers of {recording.name} define {counts[best]} joints of the set {found[best].set_name}; give a set "
        f"with --markers FILE.yaml; its markers, with the nearest known ones: {', '.join(near[:12])}"
    )


def _plain(name: str) -> str:
    return re.sub(r"[\s._-]", "", name.lower())


def _centres(recording: MarkerRecording, marker_set: MarkerSet) -> JointCentres:
    seen = np.isfinite(recording.points).all(axis=2).any(axis=0)
    column = {_plain(label): i for i, label in enumerate(recording.labels) if seen[i]}
    points = np.full((len(recording.times), len(REPORTED), 3), np.nan)
    on_skin = np.zeros(len(REPORTED), dtype=bool)
    for joint, options in marker_set.joints.items():
        chosen = next((option for option in options if all(_plain(name) in column for name in option)), None)
        if chosen is not None:
            row = REPORTED.index(joint)
            points[:, row] = recording.points[:, [column[_plain(name)] for name in chosen]].mean(axis=1)
            on_skin[row] = len(chosen) == 1 and marker_set.name != "joint_centres"
    spines = {
        key: next((column[_plain(n)] for n in names if _plain(n) in column), None)
        for key, names in marker_set.pelvis.items()
    }
    if len(spines) == len(PELVIS_KEYS) and None not in spines.values():
        corners = [recording.points[:, spines[key]] for key in PELVIS_KEYS]
        left, right = hip_centres(*corners)
        points[:, REPORTED.index("left_hip")], points[:, REPORTED.index("right_hip")] = left, right
        points[:, REPORTED.index("pelvis")] = (left + right) / 2
    return JointCentres(marker_set.name, points, on_skin)


def hip_centres(
    left_asis: np.ndarray, right_asis: np.ndarray, left_psis: np.ndarray, right_psis: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute left and right hip joint centres, each (T, 3), metres, from the iliac spines (T, 3).

    Regression of Harrington et al. 2007 (Journal of Biomechanics 40), with pelvic width and depth of the whole
    recording. Both posterior spines may be one sacral marker.
    """
    front, back = (left_asis + right_asis) / 2, (left_psis + right_psis) / 2
    width = float(np.nanmedian(np.linalg.norm(right_asis - left_asis, axis=1)))
    depth = float(np.nanmedian(np.linalg.norm(front - back, axis=1)))
    to_right = unit(right_asis - left_asis)
    up = unit(np.cross(to_right, front - back))
    forwards = np.cross(up, to_right)
    ahead, above, aside = -0.24 * depth - 0.0099, -0.30 * width - 0.0109, 0.33 * width + 0.0073
    middle = front + ahead * forwards + above * up
    return middle - aside * to_right, middle + aside * to_right
