"""Provenance of a run: `run.json`."""

from __future__ import annotations

import os
import re
from dataclasses import asdict, dataclass, field, fields, replace
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.io.errors import RecordingError, TrackError, UsageError
from toolkit.io.files import is_file, save_json, sha256_of
from toolkit.io.typed_values import Range, TypedReader
from toolkit.io.yaml_reader import read_json
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracks.track import AGAIN

RUN_FILE = "run.json"


@dataclass(frozen=True)
class RunInfo:
    """Content of `run.json`, sufficient to find the recording and to rebuild the body.

    Attributes
    ----------
    recording : path of the recording, absolute
    recording_relative : the same from the run folder, so that both can be moved together; empty if unknown
    recording_sha256 : hexadecimal digest of its file or folder
    reader_options : the options with which its reader was called
    body_fingerprint : names the joint tree and its parametrisation, not the shape
    shape, scale : coefficients in the shape space and the uniform factor of the fitted body
    offsets : metres by which a scanned body's vertices lie outside that of the shape space; empty for none
    database : path of the pose database, empty for a tracker that uses none
    level_rotation : R_level_camera, 9 numbers row by row: p_level = R p_camera
    sensing : settings with which the depth was segmented and cleaned, by name
    version : version of the toolkit
    tracker : name of the tracker
    seed : seed of all random numbers
    up_source : source of the vertical, see `Vertical`
    floor : metres of the camera above the floor, one number; empty where none is seen
    sensors_sha256 : of the file of inertial sensors that guided the tracker, empty
        without
    body_sha256 : of the file of the person's own body, empty where it was learnt
    joints_2d : source of image joints: "none", "colour", "depth", or "given" and their digest
    folder : the run folder that was read, empty for a new one; not written
    """

    recording: str
    recording_sha256: str
    reader_options: dict[str, Any]
    body_fingerprint: str
    shape: list[Annotated[float, Range(-100, 100)]]
    scale: Annotated[float, Range(0.01, 100)]
    database: str
    level_rotation: list[Annotated[float, Range(-1, 1)]]
    sensing: dict[str, Any]
    version: str
    tracker: str = "hybrid"
    seed: int = 0
    up_source: str = ""
    sensors_sha256: str = ""
    joints_2d: str = "none"
    body_sha256: str = ""
    offsets: list[Annotated[float, Range(-0.1, 0.1)]] = field(default_factory=list)
    floor: list[Annotated[float, Range(0, 100)]] = field(default_factory=list)
    recording_relative: str = field(default="", compare=False)
    folder: str = field(default="", compare=False)

    @property
    def R_level_camera(self) -> np.ndarray:
        """Rotation from the camera frame to the level frame: float64 (3, 3)."""
        return np.array(self.level_rotation, dtype=np.float64).reshape(3, 3)

    def body(self) -> Body:
        """Return the fitted body."""
        offsets = np.array(self.offsets, dtype=np.float64) if self.offsets else None
        return ShapeSpace.load().body(self.shape, scale=self.scale, offsets=offsets)

    def open_recording(self, path: str | Path | None = None) -> Recording:
        """Open the recording that was tracked; `path` gives its new place.

        Without `path` the relative path is tried first, then the absolute one. The digest decides.

        Raises
        ------
        RecordingError
            It is missing or has changed.
        """
        from toolkit.recordings.opening import open_recording  # all readers

        places = [Path(path)] if path else [Path(self.recording)]
        if not path and self.folder and self.recording_relative:
            places.insert(0, Path(self.folder) / self.recording_relative)
        present = [place for place in places if place.exists()]
        if not present:
            raise RecordingError(f"the recording {places[-1]} is gone; put it back there, or name it with --recording")
        for place in present:
            try:
                recording = open_recording(place, **self.reader_options)  # no disk is read whole that is no recording
                if sha256_of(place) == self.recording_sha256:
                    return recording
            except (RecordingError, UsageError, OSError):
                continue
        raise RecordingError(f"the recording {present[-1]} has changed since it was tracked; track it again")

    def save(self, run: str | Path) -> None:
        """Write `run.json` into the run folder."""
        values = asdict(self) | {"recording_relative": _relative(self.recording, Path(run))}
        del values["folder"]
        save_json(Path(run) / RUN_FILE, values)

    @classmethod
    def load(cls, run: str | Path) -> RunInfo:
        """Read `run.json` of a run folder.

        Raises
        ------
        TrackError
            There is no such file, it is not JSON, a key is missing or of another type, or the run is another body's or
            a later version's.
        """
        path = Path(run) / RUN_FILE
        if not is_file(path):
            raise TrackError(f"{run} holds no {RUN_FILE}; name a run folder that `depthmocap track` wrote")
        reader = TypedReader(TrackError, AGAIN, loose=True, source=str(path))
        info = reader.read(read_json(path, TrackError, AGAIN, inside=True), cls, "")
        _check(info, path)
        return replace(info, folder=str(run))


def _check(info: RunInfo, path: Path) -> None:
    """Raise TrackError for an invalid rotation, another body, a later version or an unknown setting."""
    turn = np.array(info.level_rotation, dtype=np.float64)
    if len(turn) != 9 or not _is_rotation(turn.reshape(3, 3)):
        raise TrackError(f"level_rotation in {path} is no rotation; {AGAIN}")
    release, own = _release(info.version), version("depthmocap")
    if release is None or release > (_release(own) or ()):
        raise TrackError(
            f"{path} was written by version {info.version!r}, this is {own}; install that one or a later one"
        )
    if info.body_fingerprint != skeleton.fingerprint():
        raise TrackError(
            f"{path} was made with another body (fingerprint {info.body_fingerprint}, this one has "
            f"{skeleton.fingerprint()}); {AGAIN}"
        )
    known = {f.name for f in fields(SensingSettings)}
    if unknown := sorted(set(info.sensing) - known):
        raise TrackError(f"{path} has the unknown setting sensing.{unknown[0]}; {AGAIN}")
    try:
        ReaderOptions.from_mapping(info.reader_options)
    except UsageError as error:
        raise TrackError(f"the reader options in {path} cannot be used: {error}; {AGAIN}") from error


def _is_rotation(matrix: np.ndarray) -> bool:
    """Return True if float64 (3, 3) is a rotation."""
    return bool(np.abs(matrix @ matrix.T - np.eye(3)).max() <= 1e-6 and np.linalg.det(matrix) > 0)


def _release(text: str) -> tuple[int, int] | None:
    """Return the first two numbers of a version; files of a later release may have another meaning."""
    numbers = re.match(r"(\d{1,9})(?:\.(\d{1,9}))?(?!\w)", text)
    return None if numbers is None else (int(numbers[1]), int(numbers[2] or 0))


def _relative(recording: str, folder: Path) -> str:
    """Return the path of the recording relative to the run folder, empty if there is none (another drive)."""
    try:
        return Path(os.path.relpath(recording, folder.resolve())).as_posix()
    except ValueError:
        return ""
