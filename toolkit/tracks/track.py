"""Track of a person: one row per frame of a recording, as a type and as `track.npz`."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

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

    pose: np.ndarray
    joints: np.ndarray
    confidence: np.ndarray
    state: int
    source: int
    stage_ms: np.ndarray
    observed: np.ndarray = field(default_factory=lambda: np.ones(len(skeleton.REPORTED), dtype=np.bool_))


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
        wanted = row_columns(len(self.pose_names), len(self.stage_names), len(self.source_names))
        wanted["contact"] = Column("b", ("frames", 2))
        check_columns(vars(self), wanted, TrackError, "a track", "a tracker writes one such row per frame")
        if (np.diff(self.timestamps) < 0).any():
            raise TrackError("a track's timestamps run backwards; a tracker writes its rows in order")

    def __len__(self) -> int:
        return len(self.joints)

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


def columns(pose_size: int, stages: int) -> dict[str, tuple[int, ...]]:
    """Return name and shape of one row of every column."""
    joints = len(skeleton.REPORTED)
    return {
        "joints": (joints, 3),
        "pose": (pose_size,),
        "confidence": (joints,),
        "state": (),
        "source": (),
        "timestamps": (),
        "stage_ms": (stages,),
        "observed": (joints,),
    }


def row_columns(pose_size: int, stages: int, sources: int) -> dict[str, Column]:
    """Return the columns that every tracker writes."""
    shapes = columns(pose_size, stages)
    farthest, latest = 1e4, 1e12  # bounds of values: metres or radians of a pose; seconds or milliseconds
    spans = {
        "joints": (-farthest, farthest), "pose": (-farthest, farthest), "confidence": (0.0, 1.0),
        "state": (0.0, len(STATE_NAMES) - 1.0), "source": (0.0, max(0.0, sources - 1.0)),
        "timestamps": (-latest, latest), "stage_ms": (0.0, latest),
    }  # fmt: skip
    kinds = {name: "u" if name in ("state", "source") else "f" for name in spans}
    wanted = {name: Column(kinds[name], ("frames", *shapes[name]), *span) for name, span in spans.items()}
    return wanted | {"observed": Column("b", ("frames", *shapes["observed"]))}


def _storable(value: np.ndarray | tuple[str, ...]) -> np.ndarray:
    return value if isinstance(value, np.ndarray) else np.array(value, dtype=np.str_)
