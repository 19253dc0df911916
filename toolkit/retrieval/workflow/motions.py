"""Loading of motions and poses from files, and the class labels of clips."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from toolkit.body.shape import load_body
from toolkit.io.errors import RetrievalError
from toolkit.io.yaml_reader import read_table
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget
from toolkit.retrieval.features.motion import Motion, even_frames, from_clip, from_track
from toolkit.retrieval.features.relational import feature_columns
from toolkit.sensing.recording import frame_rate_of
from toolkit.tracks import RunInfo, Track


def find_motions(paths: Sequence[str | Path]) -> list[Path]:
    """Return motion files, run folders, and all motion files below other folders, in the given order."""
    found: list[Path] = []
    for path in map(Path, paths):
        found.extend([path] if (path / "track.npz").is_file() else find_clips(path))
    return found


def load_motion(path: str | Path) -> Motion:
    """Return the motion of a clip file or of a run folder, named by its stem."""
    path = Path(path)
    if path.is_dir():
        return from_track(Track.load(path), RunInfo.load(path).body(), path.name)
    return from_clip(read_clip(path))


def load_poses(path: str | Path) -> np.ndarray:
    """Return the poses (T, P) of a clip on the neutral body, or of a run folder, one per feature column.

    Raises
    ------
    RigError
        No joint map fits the clip.
    """
    path = Path(path)
    if path.is_dir():
        track = Track.load(path)
        low, high, share = even_frames(track)
        rows = np.where(share < 0.5, low, high)
        return track.pose[rows[feature_columns(len(rows), frame_rate_of(track.timestamps))]]
    clip = read_clip(path)
    poses = retarget(clip, load_body("neutral")).poses
    # Retargeting drops leading calibration frames; they get the first pose.
    rows = feature_columns(len(clip), float(clip.frame_rate)) - (len(clip) - len(poses))
    return poses[np.maximum(rows, 0)]


class Tag(NamedTuple):
    """Class of a clip and its performer, "" if unknown."""

    label: str
    person: str


def tags_of(files: Sequence[Path], table: str | Path | None = None) -> dict[Path, Tag]:
    """Return motion class and performer of each clip: from a table, else from its folder's name.

    If all clips are in one folder, or if their names have the same class as their folders, names are parsed
    (`tags_in_names`).

    Parameters
    ----------
    files : clips
    table : CSV file with the columns clip (the stem), label, and optionally person

    Raises
    ------
    RetrievalError
        A clip has no label, or the table cannot be read.
    """
    if table is not None:
        known = _table(Path(table))
        return {file: _tag(known.get(file.stem), file, table) for file in files}
    named = tags_in_names(files)
    folders = {file: file.resolve().parent.name for file in files}
    flat = len(set(folders.values())) < 2 < len(files)
    if flat or all(named[file].label == folder for file, folder in folders.items()):
        return named
    return {file: Tag(folder, "") for file, folder in folders.items()}


def tags_in_names(files: Sequence[Path]) -> dict[Path, Tag]:
    """Return classes and performers from the names of clips alone, such as `bd_kick_01` and `walk-3`.

    A name is split at underscores, hyphens, points and spaces, and numbers are dropped. Of the parts that vary, the
    first one is the performer if each performer occurs with several classes; the rest is the class.
    """
    parts = {file: [word for word in re.split(r"[_\-. ]+", file.stem) if word.strip("0123456789")] for file in files}
    words = {file: [word.rstrip("0123456789") for word in found] for file, found in parts.items()}
    if len({len(found) for found in words.values()}) != 1:
        return {file: Tag("_".join(found), "") for file, found in words.items()}
    columns = [column for column in zip(*words.values(), strict=True) if len(set(column)) > 1]
    rests = ["_".join(rest) for rest in zip(*columns[1:], strict=True)] if len(columns) > 1 else []
    if rests:
        classes_of = {
            person: {r for p, r in zip(columns[0], rests, strict=True) if p == person} for person in columns[0]
        }
        if min(map(len, classes_of.values())) > 1:
            return dict(zip(files, map(Tag, rests, columns[0]), strict=True))
    whole = (
        ["_".join(row) for row in zip(*columns, strict=True)]
        if columns
        else ["_".join(found) for found in words.values()]
    )
    return {file: Tag(label, "") for file, label in zip(files, whole, strict=True)}


def _tag(row: Mapping[str, str] | None, file: Path, table: str | Path) -> Tag:
    if not row or not row["label"]:
        raise RetrievalError(f"clip {file.name} has no label in {table}; give it one or leave it out")
    return Tag(row["label"], row.get("person", ""))


def _table(path: Path) -> dict[str, dict[str, str]]:
    rows = read_table(path, RetrievalError, "give a CSV file with the columns clip and label")
    if not rows or not all({"clip", "label"} <= row.keys() for row in rows):
        raise RetrievalError(f"{path} has no columns clip and label, or a line without a label; correct it")
    return {row["clip"]: row for row in rows}
