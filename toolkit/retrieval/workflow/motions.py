"""Motions from files, and the class of each clip."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from toolkit.errors import RetrievalError, UsageError
from toolkit.files import read_table
from toolkit.mocap.read import find_clips, read_clip
from toolkit.retrieval.features.motion import Motion, from_clip, from_track
from toolkit.track import RunInfo, Track


def find_motions(paths: Sequence[str | Path]) -> list[Path]:
    """Motion files, run folders, and all motion files below other folders, in the order given."""
    found: list[Path] = []
    for path in map(Path, paths):
        found.extend([path] if (path / "track.npz").is_file() else find_clips(path))
    return found


def load_motion(path: str | Path) -> Motion:
    """The motion of a clip file or of a run folder, named by its stem."""
    path = Path(path)
    if path.is_dir():
        return from_track(Track.load(path), RunInfo.load(path).body(), path.name)
    return from_clip(read_clip(path))


def labels_of(files: Sequence[Path], pattern: str | None = None, table: str | Path | None = None) -> dict[Path, str]:
    """Motion class of each clip: from a table (CSV: clip, label), else from its name, else from its folder's name.

    Parameters
    ----------
    files : clips
    pattern : regular expression with a group `label` that matches a clip's whole stem
    table : CSV file with the columns clip (the stem) and label

    Raises
    ------
    UsageError
        A pattern without that group, or both ways at once.
    RetrievalError
        A clip without a label, or a table that cannot be read.
    """
    if pattern is not None and table is not None:
        raise UsageError("labels come from a pattern or from a table, not from both; leave one out")
    if table is not None:
        known = _label_table(Path(table))
        return {file: _label(known.get(file.stem), file, f"in {table}") for file in files}
    if pattern is None:
        return {file: file.resolve().parent.name for file in files}
    try:
        expression = re.compile(pattern)
    except re.error as error:
        raise UsageError(f"pattern {pattern!r} is no regular expression ({error}); correct it") from error
    if "label" not in expression.groupindex:
        raise UsageError(f"pattern {pattern!r} has no group named label; write (?P<label>...) around it")
    found = {file: expression.fullmatch(file.stem) for file in files}
    return {file: _label(match and match["label"], file, f"by pattern {pattern!r}") for file, match in found.items()}


def _label(label: str | None, file: Path, where: str) -> str:
    if not label:
        raise RetrievalError(f"clip {file.name} has no label {where}; give it one or leave it out")
    return label


def _label_table(path: Path) -> dict[str, str]:
    rows = read_table(path, RetrievalError, "give a CSV file with the columns clip and label")
    if not rows or not all({"clip", "label"} <= row.keys() for row in rows):
        raise RetrievalError(f"{path} has no columns clip and label, or a line without a label; correct it")
    return {row["clip"]: row["label"] for row in rows}
