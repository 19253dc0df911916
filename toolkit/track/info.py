"""`run.json`: what a run was made from."""

from __future__ import annotations

import os
import re
from dataclasses import MISSING, asdict, dataclass, field, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from toolkit import skeleton
from toolkit.archives import Column, check_columns
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.errors import RecordingError, TrackError, UsageError
from toolkit.files import is_file, read_json, save_json, sha256_of
from toolkit.sensing.recording import ReaderOptions, Recording
from toolkit.sensing.settings import SensingSettings
from toolkit.track.track import AGAIN

RUN_FILE = "run.json"


@dataclass(frozen=True)
class RunInfo:
    """What `run.json` says about a run, enough to find its recording and to build its body again.

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
    version : of the toolkit
    tracker : name of the tracker
    seed : of everything random
    up_source : how the vertical was known, see `Vertical`
    floor : metres of the camera above the floor, one number; empty where none is seen
    sensors_sha256, classes_sha256 : of the file of inertial sensors or of motion classes that guided the tracker, empty
        without
    body_sha256 : of the file of the person's own body, empty where it was learnt
    joints_2d : which joints in the image the tracker was told: "none", "colour", "depth", or "given" and their digest
    folder : the run folder that was read, empty for a new one; not written
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
    tracker: str = "hybrid"
    seed: int = 0
    up_source: str = ""
    sensors_sha256: str = ""
    classes_sha256: str = ""
    joints_2d: str = "none"
    body_sha256: str = ""
    offsets: list[float] = field(default_factory=list)
    floor: list[float] = field(default_factory=list)
    recording_relative: str = field(default="", compare=False)
    folder: str = field(default="", compare=False)

    @property
    def R_level_camera(self) -> np.ndarray:
        """Float64 (3, 3): turns points from the camera frame into the level frame."""
        return np.array(self.level_rotation, dtype=np.float64).reshape(3, 3)

    def body(self) -> Body:
        """The body as it was fitted."""
        offsets = np.array(self.offsets, dtype=np.float64) if self.offsets else None
        return ShapeSpace.load().body(self.shape, scale=self.scale, offsets=offsets)

    def open_recording(self, path: str | Path | None = None) -> Recording:
        """The recording, as it was when it was tracked; `path` says where it has been moved to.

        Without `path` it is looked for beside the run folder as before, then where it lay. Its digest decides.

        Raises
        ------
        RecordingError
            It is gone or has changed.
        """
        from toolkit.recordings.opening import open_recording  # all readers

        places = [Path(path)] if path else [Path(self.recording)]
        if not path and self.folder and self.recording_relative:
            places.insert(0, Path(self.folder) / self.recording_relative)
        present = [place for place in places if place.exists()]
        if not present:
            raise RecordingError(f"the recording {places[-1]} is gone; put it back there, or name it with --recording")
        for place in present:
            if sha256_of(place) == self.recording_sha256:
                return open_recording(place, **self.reader_options)
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
        values = read_json(path, TrackError, AGAIN)
        if not isinstance(values, dict):
            raise TrackError(f"{path} holds no names with values; {AGAIN}")
        wanted = [f.name for f in fields(cls) if f.default is MISSING and f.default_factory is MISSING]
        if missing := [name for name in wanted if name not in values]:
            raise TrackError(f"{path} lacks {', '.join(missing)}; {AGAIN}")
        known = {f.name: values[f.name] for f in fields(cls) if f.name in values}
        _check_values(known, path)
        return cls(**known | {"folder": str(run)})


JSON_KINDS: dict[str, tuple[type, ...]] = {
    "str": (str,), "int": (int,), "float": (int, float), "list[float]": (list,), "dict[str, Any]": (dict,)
}  # fmt: skip
"""Annotation of a field -> the types that JSON gives it."""


def _check_values(values: dict[str, Any], path: Path) -> None:
    """Raise TrackError for a value of another type, numbers that no run has, or another body."""
    for f in fields(RunInfo):
        value = values.get(f.name)
        if f.name in values and (not isinstance(value, JSON_KINDS[str(f.type)]) or isinstance(value, bool)):
            raise TrackError(f"{f.name} in {path} is {type(value).__name__}; it must be {f.type}; {AGAIN}")
    try:
        numbers = {
            name: np.array(values.get(name, []), dtype=np.float64, ndmin=1)
            for name in ("shape", "level_rotation", "scale", "offsets", "floor")
        }
    except (TypeError, ValueError) as error:
        raise TrackError(f"{path} holds something else than numbers ({error}); {AGAIN}") from error
    columns = {
        "shape": Column("f", ("n",), -100, 100),
        "offsets": Column("f", ("m",), -0.1, 0.1),
        "level_rotation": Column("f", (9,)),
        "scale": Column("f", (1,), 0.01, 100),
        "floor": Column("f", ("f",), 0, 100),
    }
    check_columns(numbers, columns, TrackError, str(path), AGAIN)
    turn = numbers["level_rotation"].reshape(3, 3)
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-6 or np.linalg.det(turn) < 0:
        raise TrackError(f"level_rotation in {path} is no rotation; {AGAIN}")
    release, own = _release(values["version"]), version("depthmocap")
    if release is None or release > (_release(own) or ()):
        raise TrackError(
            f"{path} was written by version {values['version']!r}, this is {own}; install that one or a later one"
        )
    if values["body_fingerprint"] != skeleton.fingerprint():
        raise TrackError(
            f"{path} was made with another body (fingerprint {values['body_fingerprint']}, this one has "
            f"{skeleton.fingerprint()}); {AGAIN}"
        )
    known = {f.name for f in fields(SensingSettings)}
    if unknown := sorted(set(values["sensing"]) - known):
        raise TrackError(f"{path} has the unknown setting sensing.{unknown[0]}; {AGAIN}")
    try:
        ReaderOptions.from_mapping(values["reader_options"])
    except UsageError as error:
        raise TrackError(f"the reader options in {path} cannot be used: {error}; {AGAIN}") from error


def _release(text: str) -> tuple[int, int] | None:
    """The first two numbers of a version; a file of a later release may mean something that this one does not know."""
    numbers = re.match(r"(\d{1,9})(?:\.(\d{1,9}))?(?!\w)", text)
    return None if numbers is None else (int(numbers[1]), int(numbers[2] or 0))


def _relative(recording: str, folder: Path) -> str:
    """Path of the recording as seen from the run folder, empty where none leads there (from one drive to another)."""
    try:
        return Path(os.path.relpath(recording, folder.resolve())).as_posix()
    except ValueError:
        return ""
