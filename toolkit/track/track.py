"""The track: one row per frame of a recording, as a type and as `track.npz`."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.errors import TrackError
from toolkit.files import save_npz

TRACK_FILE, PARTIAL_FILE = "track.npz", "track.partial"


@dataclass(frozen=True, eq=False)
class Track:
    """One row per frame of a recording.

    Attributes
    ----------
    joints : float32 (T, 20, 3), camera frame, metres
    pose : float64 (T, P), level frame
    confidence : float32 (T, 20), in [0, 1], as in `FrameResult`
    state, source : uint8 (T,), indices into `STATE_NAMES` and `source_names`
    timestamps : float64 (T,), seconds
    stage_ms : float32 (T, S), milliseconds, without reading the file
    """

    joints: np.ndarray
    pose: np.ndarray
    confidence: np.ndarray
    state: np.ndarray
    source: np.ndarray
    timestamps: np.ndarray
    stage_ms: np.ndarray
    source_names: tuple[str, ...]
    stage_names: tuple[str, ...]
    joint_names: tuple[str, ...] = field(default=skeleton.REPORTED)
    pose_names: tuple[str, ...] = field(default=skeleton.POSE_NAMES)

    def __post_init__(self) -> None:
        frames = len(self.joints)
        for name, tail in columns(len(self.pose_names), len(self.stage_names)).items():
            if (shape := getattr(self, name).shape) != (frames, *tail):
                raise TrackError(
                    f"a track's {name} has shape {shape}, expected {(frames, *tail)}; write one row per frame"
                )
        if not np.isfinite(self.joints).all():
            raise TrackError("a track's joints are not all finite; a tracker predicts them while it is lost")

    def __len__(self) -> int:
        return len(self.joints)

    def save(self, run: str | Path) -> Path:
        """Write `track.npz` into the run folder, whole or not at all, and return its path."""
        path = Path(run) / TRACK_FILE
        save_npz(path, {f.name: _storable(getattr(self, f.name)) for f in fields(self)})
        return path

    @classmethod
    def load(cls, run: str | Path) -> Track:
        """Read a run folder, or a `track.npz` itself.

        Raises
        ------
        TrackError
            There is no finished track, the file is damaged, or it names joints other than the 20 reported ones.
        """
        folder = Path(run)
        path = folder if folder.is_file() else folder / TRACK_FILE
        if not path.exists():
            if (folder / PARTIAL_FILE).exists():
                raise TrackError(f"{folder} holds an unfinished track; finish it with `depthmocap track --resume`")
            raise TrackError(f"{folder} holds no {TRACK_FILE}; name a run folder that `depthmocap track` wrote")
        try:
            with np.load(path) as arrays:
                values = {f.name: arrays[f.name] for f in fields(cls)}
        except (OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError) as error:
            raise TrackError(f"cannot read {path}: {error}; track the recording again") from error
        found: dict[str, Any] = {
            name: tuple(value.tolist()) if name.endswith("_names") else value for name, value in values.items()
        }
        if found["joint_names"] != skeleton.REPORTED:
            raise TrackError(f"{path} names joints {found['joint_names']}; expected {skeleton.REPORTED}")
        return cls(**found)


def columns(pose_size: int, stages: int) -> dict[str, tuple[int, ...]]:
    """Name and shape of one row of every column."""
    joints = len(skeleton.REPORTED)
    return {
        "joints": (joints, 3),
        "pose": (pose_size,),
        "confidence": (joints,),
        "state": (),
        "source": (),
        "timestamps": (),
        "stage_ms": (stages,),
    }


def _storable(value: np.ndarray | tuple[str, ...]) -> np.ndarray:
    return value if isinstance(value, np.ndarray) else np.array(value, dtype=np.str_)
