"""The track: what a tracker found in a recording, its type and its files in a run folder.

A run folder holds `track.npz` (exactly one row per tracked frame), `run.json`, `config.yaml` and `log.txt`. While a
run lasts its rows stand in `track.partial`: one line of JSON that names the columns' meanings, then one binary record
of fixed size per frame, so that a killed process loses at most the record it was writing.
"""

from __future__ import annotations

import errno
import json
import os
import zipfile
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.errors import OutputError, RecordingError, TrackError, UsageError
from toolkit.files import save_json, save_npz, sha256_of
from toolkit.sensing.recording import Recording, open_recording

TRACKED, LOST, EMPTY = 0, 1, 2
"""States of a frame: followed; somebody is there but not explained; nobody is there."""
STATE_NAMES = ("tracked", "lost", "empty")

TRACK_FILE, PARTIAL_FILE, RUN_FILE = "track.npz", "track.partial", "run.json"


@dataclass(frozen=True, eq=False)
class FrameResult:
    """What a tracker says about one frame.

    Attributes
    ----------
    pose : float64 (P,), level frame (see `docs/architecture.md`), named by `skeleton.POSE_NAMES`
    joints : float32 (20, 3), camera frame, metres at true scale, always finite
    confidence : float32 (20,), in [0, 1]: probability that the joint is within 5 cm, 0 where nothing is known
    state : `TRACKED`, `LOST` or `EMPTY`
    source : index into the tracker's `source_names`, the hypothesis that won
    stage_ms : float32 (S,), milliseconds per stage of the tracker's `stage_names`, disjoint
    """

    pose: np.ndarray
    joints: np.ndarray
    confidence: np.ndarray
    state: int
    source: int
    stage_ms: np.ndarray


@dataclass(frozen=True)
class RunInfo:
    """What `run.json` says about a run, enough to find its recording and to build its body again.

    Attributes
    ----------
    recording : path of the recording, absolute
    recording_sha256 : hexadecimal digest of its file or folder
    reader_options : the options with which its reader was called
    body_fingerprint : names the joint tree and its parametrisation, not the shape
    shape, scale : coefficients in the shape space and the uniform factor of the fitted body
    database : path of the pose database, empty for a tracker that uses none
    level_rotation : R_level_camera, 9 numbers row by row: p_level = R p_camera
    sensing : settings with which the depth was segmented and cleaned, by name
    version : of the toolkit
    """

    recording: str
    recording_sha256: str
    reader_options: dict[str, Any]
    body_fingerprint: str
    shape: list[float]
    scale: float
    database: str
    level_rotation: list[float]
    sensing: dict[str, Any]
    version: str

    @property
    def R_level_camera(self) -> np.ndarray:
        """Float64 (3, 3): turns points from the camera frame into the level frame."""
        return np.array(self.level_rotation, dtype=np.float64).reshape(3, 3)

    def body(self) -> Body:
        """The body as it was fitted."""
        return ShapeSpace.load().body(self.shape, scale=self.scale)

    def open_recording(self, path: str | Path | None = None) -> Recording:
        """The recording, as it was when it was tracked; `path` says where it has been moved to.

        Raises
        ------
        RecordingError
            It is gone or has changed.
        """
        found = Path(path or self.recording)
        if not found.exists():
            raise RecordingError(f"the recording {found} is gone; put it back there")
        if sha256_of(found) != self.recording_sha256:
            raise RecordingError(f"the recording {found} has changed since it was tracked; track it again")
        return open_recording(found, **self.reader_options)

    def save(self, run: str | Path) -> None:
        """Write `run.json` into the run folder."""
        save_json(Path(run) / RUN_FILE, asdict(self))

    @classmethod
    def load(cls, run: str | Path) -> RunInfo:
        """Read `run.json` of a run folder.

        Raises
        ------
        TrackError
            There is no such file, it is not JSON, or a key is missing.
        """
        path = Path(run) / RUN_FILE
        if not path.exists():
            raise TrackError(f"{run} holds no {RUN_FILE}; name a run folder that `depthmocap track` wrote")
        try:
            values = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise TrackError(f"cannot read {path}: {error}; track the recording again") from error
        names = [f.name for f in fields(cls)]
        if missing := [name for name in names if name not in values]:
            raise TrackError(f"{path} lacks {', '.join(missing)}; track the recording again")
        return cls(**{name: values[name] for name in names})


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
        for name, tail in _columns(len(self.pose_names), len(self.stage_names)).items():
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
        columns: dict[str, Any] = {
            name: tuple(value.tolist()) if name.endswith("_names") else value for name, value in values.items()
        }
        if columns["joint_names"] != skeleton.REPORTED:
            raise TrackError(f"{path} names joints {columns['joint_names']}; expected {skeleton.REPORTED}")
        return cls(**columns)


def _columns(pose_size: int, stages: int) -> dict[str, tuple[int, ...]]:
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


def _record(stages: int) -> np.dtype:
    types = dict(joints="<f4", pose="<f8", confidence="<f4", state="u1", source="u1", timestamps="<f8", stage_ms="<f4")
    return np.dtype([(name, types[name], tail) for name, tail in _columns(skeleton.POSE_SIZE, stages).items()])


class TrackWriter:
    """Writes a track row by row; what has been appended survives the death of the process.

    Parameters
    ----------
    run : the run folder, made if it is missing
    stage_names, source_names : the tracker's
    resume : continue the rows of an unfinished track in this folder, if there is one

    Raises
    ------
    UsageError
        The folder holds an unfinished track and `resume` is not set.
    TrackError
        The unfinished track was written by a tracker with other stages, sources or pose entries.
    OutputError
        The folder cannot be written.
    """

    def __init__(
        self, run: str | Path, stage_names: tuple[str, ...], source_names: tuple[str, ...], *, resume: bool = False
    ) -> None:
        self.run = Path(run)
        self.stage_names, self.source_names = stage_names, source_names
        self._path = self.run / PARTIAL_FILE
        self._record = _record(len(stage_names))
        names = {
            "joint_names": skeleton.REPORTED,
            "pose_names": skeleton.POSE_NAMES,
            "stage_names": stage_names,
            "source_names": source_names,
        }
        self._header = json.dumps(names).encode() + b"\n"
        self.rows = 0
        try:
            self.run.mkdir(parents=True, exist_ok=True)
            if self._path.exists() and self._path.stat().st_size > 0:
                self._stream = self._reopen(resume)
            else:
                self._stream = self._path.open("w+b", buffering=0)
                self._write(self._header)
        except OSError as error:
            reason = error.strerror or error
            raise OutputError(f"cannot write {self._path}: {reason}; choose a folder that can be written") from error

    def _reopen(self, resume: bool) -> BinaryIO:
        size = self._path.stat().st_size - len(self._header)
        rows = max(0, size) // self._record.itemsize
        if not resume:
            raise UsageError(
                f"{self.run} holds an unfinished track of {rows} frames; "
                f"add --resume to continue it, or remove {self._path}"
            )
        stream = self._path.open("r+b", buffering=0)
        if stream.readline() != self._header:
            stream.close()
            raise TrackError(f"{self._path} was begun by another tracker or version; remove it and track again")
        self._stream = stream
        self.cut(rows)
        return stream

    def _write(self, data: bytes) -> None:
        if self._stream.write(data) != len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def cut(self, rows: int) -> None:
        """Keep only the first `rows` rows and go on from there."""
        end = len(self._header) + rows * self._record.itemsize
        self._stream.truncate(end)
        self._stream.seek(end)
        self.rows = rows

    def append(self, result: FrameResult, timestamp: float) -> None:
        """Add the next frame's row.

        Raises
        ------
        OutputError
            The row cannot be written, for example because the disk is full; the rows before it stay.
        """
        row = np.zeros((), dtype=self._record)
        for name in ("joints", "pose", "confidence", "state", "source", "stage_ms"):
            row[name] = getattr(result, name)
        row["timestamps"] = timestamp
        try:
            self._write(row.tobytes())
        except OSError as error:
            raise OutputError(
                f"cannot write frame {self.rows} to {self._path}: {error.strerror or error}; "
                "free some space and continue with --resume"
            ) from error
        self.rows += 1

    def finish(self, *, complete: bool = True) -> Path:
        """Put `track.npz` in place by one rename and return its path.

        With `complete=False` (an interrupted run) the partial file stays, so that the run can still be resumed.
        """
        rows = (
            np.memmap(self._path, dtype=self._record, mode="r", offset=len(self._header), shape=(self.rows,))
            if self.rows
            else np.empty(0, dtype=self._record)
        )
        columns: dict[str, Any] = {name: rows[name] for name in self._record.names or ()}
        path = Track(**columns, source_names=self.source_names, stage_names=self.stage_names).save(self.run)
        self._stream.close()
        if complete:
            self._path.unlink()
        return path

    def abandon(self) -> None:
        """Let go of the partial file, which stays unless it holds no row."""
        self._stream.close()
        if self.rows == 0:
            self._path.unlink(missing_ok=True)
