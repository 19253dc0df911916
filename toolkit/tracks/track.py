"""Track of a person: one row per frame of a recording, as a type and as `track.npz`."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from toolkit.body import skeleton
from toolkit.io.archives import Column, check_columns, load_archive, save_archive
from toolkit.io.errors import TrackError
from toolkit.io.files import is_file

TRACKED, LOST, EMPTY = 0, 1, 2
"""States of a frame: tracked; person present but not explained; no person."""
STATE_NAMES = ("tracked", "lost", "empty")

TRACK_FILE, PARTIAL_FILE = "track.npz", "track.partial"
AGAIN = "track the recording again"

JOINT_COUNT = len(skeleton.REPORTED)
FARTHEST, LATEST = 1e4, 1e12
"""Bounds of values: metres or radians of a pose; seconds or milliseconds."""
ROW = {
    "joints": ("<f4", Column("f", (JOINT_COUNT, 3), -FARTHEST, FARTHEST)),
    "pose": ("<f8", Column("f", (skeleton.POSE_SIZE,), -FARTHEST, FARTHEST)),
    "confidence": ("<f4", Column("f", (JOINT_COUNT,), 0.0, 1.0)),
    "state": ("u1", Column("u", (), 0, len(STATE_NAMES) - 1)),
    "source": ("u1", Column("u", ())),
    "timestamps": ("<f8", Column("f", (), -LATEST, LATEST)),
    "stage_ms": ("<f4", Column("f", ("stages",), 0.0, LATEST)),
    "observed": ("?", Column("b", (JOINT_COUNT,))),
}
"""Columns of a track: type in files, and requirements on one row."""


@dataclass(frozen=True, eq=False)
class FrameResult:
    """Result of one frame.

    Attributes
    ----------
    pose : float64 (P,), level frame (see `docs/architecture.md`), named by `skeleton.POSE_NAMES`
    joints : float32 (20, 3), camera frame, metres at true scale, always finite
    confidence : float32 (20,), in [0, 1]: probability that the joint is within 10 cm, 0 where nothing is known
    state : `TRACKED`, `LOST` or `EMPTY`
    source : index into the tracker's `source_names`, the hypothesis that won
    stage_ms : float32 (S,), milliseconds per stage of the tracker's `stage_names`, disjoint
    observed : bool (20,), False for a joint that was inferred, because nothing was measured at its place
    """

    pose: Annotated[np.ndarray, ROW["pose"][1]]
    joints: Annotated[np.ndarray, ROW["joints"][1]]
    confidence: Annotated[np.ndarray, ROW["confidence"][1]]
    state: int
    source: int
    stage_ms: Annotated[np.ndarray, ROW["stage_ms"][1]]
    observed: Annotated[np.ndarray, ROW["observed"][1]] = field(
        default_factory=lambda: np.ones(JOINT_COUNT, dtype=np.bool_)
    )


@dataclass(frozen=True, eq=False)
class Track:
    """Track with one row per frame of a recording.

    Attributes
    ----------
    joints : float32 (T, 20, 3), camera frame, metres
    pose : float64 (T, P), level frame
    confidence : float32 (T, 20), in [0, 1], as in `FrameResult`
    state, source : uint8 (T,), indices into `STATE_NAMES` and `source_names`
    timestamps : float64 (T,), seconds
    stage_ms : float32 (T, S), milliseconds, without reading the file
    observed : bool (T, 20), as in `FrameResult`
    contact : bool (T, 2), contact of the left and the right foot with the floor (`motion.contact`); False in tracks of
        earlier versions
    """

    joints: np.ndarray
    pose: np.ndarray
    confidence: np.ndarray
    state: np.ndarray
    source: np.ndarray
    timestamps: np.ndarray
    stage_ms: np.ndarray
    observed: np.ndarray
    source_names: tuple[str, ...]
    stage_names: tuple[str, ...]
    joint_names: tuple[str, ...] = field(default=skeleton.REPORTED)
    pose_names: tuple[str, ...] = field(default=skeleton.POSE_NAMES)
    contact: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.bool_))

    def __post_init__(self) -> None:
        if not len(self.contact):
            object.__setattr__(self, "contact", np.zeros((len(self.joints), 2), dtype=np.bool_))
        wanted = row_columns(len(self.stage_names), len(self.source_names)) | {"contact": Column("b", ("frames", 2))}
        check_columns(vars(self), wanted, TrackError, "a track", "a tracker writes one such row per frame")
        if (np.diff(self.timestamps) < 0).any():
            raise TrackError("a track's timestamps run backwards; a tracker writes its rows in order")

    def __len__(self) -> int:
        return len(self.joints)

    @classmethod
    def of_rows(cls, rows: np.ndarray, stage_names: tuple[str, ...], source_names: tuple[str, ...]) -> Track:
        """Return the track of records of `row_type`."""
        found: dict[str, Any] = {name: np.ascontiguousarray(rows[name]) for name in ROW}
        return cls(**found, source_names=source_names, stage_names=stage_names)

    def save(self, run: str | Path) -> Path:
        """Write `track.npz` into the run folder atomically and return its path."""
        path = Path(run) / TRACK_FILE
        save_archive(path, {f.name: _storable(getattr(self, f.name)) for f in fields(self)})
        return path

    @classmethod
    def load(cls, run: str | Path) -> Track:
        """Load a track from a run folder or a `track.npz`.

        Raises
        ------
        TrackError
            There is no finished track, the file is damaged, or it names other joints or entries of a pose than ours.
        """
        folder = Path(run)
        path = folder if is_file(folder) else folder / TRACK_FILE
        if not is_file(path):
            if is_file(folder / PARTIAL_FILE):
                raise TrackError(f"{folder} holds an unfinished track; finish it with `depthmocap track --resume`")
            raise TrackError(f"{folder} holds no {TRACK_FILE}; name a run folder that `depthmocap track` wrote")
        arrays = load_archive(path, TrackError, AGAIN, inside=path != folder)
        names = [f.name for f in fields(cls)]
        if "depth" in arrays:
            raise TrackError(f"{path} is a recording and no track; track it first, and name its run folder")
        if "confidence" in arrays:  # earlier versions did not say what was observed
            arrays.setdefault("observed", np.ones(arrays["confidence"].shape, dtype=np.bool_))
            arrays.setdefault("contact", np.zeros((len(arrays["confidence"]), 2), dtype=np.bool_))  # nor who stands
        if missing := [name for name in names if name not in arrays]:
            raise TrackError(f"{path} lacks {', '.join(missing)}; {AGAIN}")
        texts = {name: Column("U", ("names",)) for name in names if name.endswith("_names")}
        for name, column in texts.items():
            check_columns(arrays, {name: column}, TrackError, str(path), AGAIN)
        found: dict[str, Any] = {
            name: tuple(arrays[name].tolist()) if name in texts else arrays[name] for name in names
        }
        for name, expected in (("joint_names", skeleton.REPORTED), ("pose_names", skeleton.POSE_NAMES)):
            if found[name] != expected:
                raise TrackError(f"{path} has {name} {found[name]}; expected {expected}; {AGAIN}")
        return cls(**found)


def row_type(stages: int) -> np.dtype:
    """Return the record type of one row with times of `stages` stages."""
    return np.dtype([(name, kind, _sizes(column, stages)) for name, (kind, column) in ROW.items()])


def row_columns(stages: int, sources: int) -> dict[str, Column]:
    """Return the columns of a track of a tracker with these numbers of stages and sources."""
    wanted = {name: replace(one, shape=("frames", *_sizes(one, stages))) for name, (_, one) in ROW.items()}
    return wanted | {"source": replace(wanted["source"], low=0, high=max(0, sources - 1))}


def check_rows(rows: np.ndarray, sources: int, where: str) -> None:
    """Raise TrackError where rows of `row_type`, from a file called `where`, are invalid."""
    wanted = row_columns(rows["stage_ms"].shape[1], sources)
    check_columns({name: rows[name] for name in wanted}, wanted, TrackError, where, AGAIN)


def row_of(result: FrameResult, timestamp: float, kind: np.dtype) -> np.ndarray:
    """Return a result as a record of `row_type`."""
    row = np.zeros((), dtype=kind)
    for item in fields(result):
        row[item.name] = getattr(result, item.name)
    row["timestamps"] = timestamp
    return row


def result_of(row: np.void) -> FrameResult:
    """Return a record of `row_type` as a result."""
    found = {item.name: row[item.name].copy() for item in fields(FrameResult)}
    return FrameResult(**found | {"state": int(row["state"]), "source": int(row["source"])})


def _sizes(column: Column, stages: int) -> tuple[int, ...]:
    return tuple(stages if isinstance(size, str) else size for size in column.shape or ())


def _storable(value: np.ndarray | tuple[str, ...]) -> np.ndarray:
    return value if isinstance(value, np.ndarray) else np.array(value, dtype=np.str_)
