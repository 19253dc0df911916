"""People of a run: folders `RUN/person_01/`, `RUN/person_02/`, ... and the `people.json` that lists them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.errors import TrackError, UsageError
from toolkit.io.files import save_json
from toolkit.io.typed_values import Range, TypedReader
from toolkit.io.yaml_reader import read_json
from toolkit.people.evidence import Evidence
from toolkit.tracks import EMPTY, RunInfo, Track
from toolkit.tracks.track import AGAIN

PEOPLE_FILE = "people.json"


@dataclass(frozen=True)
class PersonSummary:
    """Entry of `people.json` for one person.

    Attributes
    ----------
    id : number in order of appearance, from 1
    folder : name of the person's run folder within the run, such as `person_01`
    first_frame, last_frame : the first and the last frame with the person in view
    stature : stature of the fitted body, metres
    tracked, lost, hidden : shares, in [0, 1], of the frames in between
    evidence : evidence for a person, None where it was not needed
    """

    id: int
    folder: str
    first_frame: Annotated[int, Range(0)]
    last_frame: Annotated[int, Range(0)]
    stature: Annotated[float, Range(0, 10)]
    tracked: Annotated[float, Range(0, 1)]
    lost: Annotated[float, Range(0, 1)]
    hidden: Annotated[float, Range(0, 1)]
    evidence: Evidence | None = None

    def text(self) -> str:
        """Return one line for a terminal."""
        why = "" if self.evidence is None else f"; {self.evidence.text()}"
        frames = f"frames {self.first_frame} to {self.last_frame}, {100 * self.tracked:.0f} % tracked"
        return f"{self.folder}: {self.stature:.2f} m, {frames}{why}"


@dataclass(frozen=True)
class People:
    """Content of `people.json`.

    Attributes
    ----------
    people : all of them, in order of appearance
    furniture : evidence of tracks that were classified as furniture
    """

    people: tuple[PersonSummary, ...]
    furniture: tuple[Evidence, ...] = ()

    def text(self) -> str:
        """Return a line for each person and for each piece of furniture."""
        lines = [person.text() for person in self.people]
        return "\n".join([*lines, *(f"furniture, left out: {own.text()}" for own in self.furniture)])


def save_people(run: str | Path, people: Sequence[PersonSummary], furniture: Sequence[Evidence] = ()) -> None:
    """Write `people.json` into a run.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    save_json(Path(run) / PEOPLE_FILE, asdict(People(tuple(people), tuple(furniture))))


def load_people(run: str | Path) -> People:
    """Read `people.json` of a run.

    Raises
    ------
    TrackError
        There is no such file, it is not understood, or it names something outside the run.
    """
    path = Path(run) / PEOPLE_FILE
    reader = TypedReader(TrackError, AGAIN, loose=True, source=str(path))
    whole = reader.read(_without_old_evidence(read_json(path, TrackError, AGAIN, inside=True)), People, "")
    people = whole.people
    folders = [person.folder for person in people]
    if not all(_is_plain(folder) for folder in folders):
        raise TrackError(f"{path} names the folders {folders}; they must be plain names within the run")
    most_people = 1000  # maximum number of people in one recording: a person who is not re-identified counts twice
    if len(people) > most_people or len(set(folders)) < len(folders):
        raise TrackError(f"{path} lists {len(people)} people, some of them twice or more than a camera sees; {AGAIN}")
    if linked := [folder for folder in folders if (Path(run) / folder).is_symlink()]:
        raise TrackError(f"{Path(run) / linked[0]} is a link; put the folder itself there")
    return whole


def _without_old_evidence(content: Any) -> Any:
    """Return the content of `people.json` without the evidence of earlier versions, which held other columns."""
    if not isinstance(content, dict):
        return content
    people, furniture = (content.get(key) for key in ("people", "furniture"))
    for person in people if isinstance(people, list) else ():
        if isinstance(person, dict) and isinstance(person.get("evidence"), dict) and "moved" not in person["evidence"]:
            person["evidence"] = None
    if isinstance(furniture, list):
        content["furniture"] = [own for own in furniture if not isinstance(own, dict) or "moved" in own]
    return content


def _is_plain(name: str) -> bool:
    longest_name = 200  # maximum length of the name of a person's folder, bytes
    short = len(name.encode(errors="replace")) <= longest_name
    return short and name.isprintable() and Path(name).name == name and name not in ("", ".", "..")


def person_runs(run: str | Path) -> tuple[Path, ...]:
    """Return the run folders of a run: one per person (maybe none) where it has a `people.json`, else itself.

    Raises
    ------
    TrackError
        `people.json` is damaged.
    """
    folder = Path(run)
    if not (folder / PEOPLE_FILE).exists():
        return (folder,)
    return tuple(folder / person.folder for person in load_people(folder).people)


@dataclass(frozen=True, eq=False)
class Person:
    """Track with its body.

    Attributes
    ----------
    name : name of the person in files: the folder's name
    track : one row per frame of the recording
    body : as it was fitted
    R_level_camera : float64 (3, 3), turns points from the camera frame into the level frame
    id : the person's number in `people.json`, 1 for a person who was followed alone
    camera_height : metres of the camera above the floor, None where none was seen
    recording : name of the recording's file or folder
    turns : quarter turns clockwise by which the recording's images were turned upright
    """

    name: str
    track: Track
    body: Body
    R_level_camera: np.ndarray
    id: int = 1
    camera_height: float | None = None
    recording: str = ""
    turns: int = 0

    @property
    def there(self) -> np.ndarray:
        """Frames in which the person is present, tracked or lost: bool (T,)."""
        return np.asarray(self.track.state != EMPTY)

    @property
    def held_poses(self) -> np.ndarray:
        """Poses, where the person is absent that of the nearest frame: float64 (T, P)."""
        there = np.flatnonzero(self.there)
        if not len(there):
            return self.track.pose
        rows = np.arange(len(self.track))
        after = np.clip(np.searchsorted(there, rows), 0, len(there) - 1)
        before = np.clip(after - 1, 0, None)
        nearer = np.abs(there[before] - rows) <= np.abs(there[after] - rows)
        return self.track.pose[np.where(nearer, there[before], there[after])]

    def moved(self, offset: np.ndarray) -> Person:
        """Return the person with `offset` (3,), metres, level frame, as the origin of level and camera frame."""
        track = self.track
        pose = track.pose.copy()
        pose[:, skeleton.ROOT_POSITION] -= offset
        joints = (track.joints.astype(np.float64) - offset @ self.R_level_camera).astype(track.joints.dtype)
        return replace(self, track=replace(track, pose=pose, joints=joints))

    @property
    def times(self) -> np.ndarray:
        """Seconds since the first frame: float64 (T,)."""
        return self.track.timestamps - self.track.timestamps[0]

    @property
    def joints_level(self) -> np.ndarray:
        """Reported joints in the level frame (y up), metres, NaN where absent: float64 (T, 20, 3)."""
        joints = self.track.joints.astype(np.float64) @ self.R_level_camera.T
        joints[self.track.state == EMPTY] = np.nan
        return joints

    def frame_rate(self) -> float:
        """Return the median frame rate of the track, for files with one number for it.

        Raises
        ------
        UsageError
            There are fewer than two frames, or their times do not grow.
        """
        steps = np.diff(self.track.timestamps)
        if len(steps) == 0 or not np.median(steps) > 0:
            raise UsageError(
                f"a file with a frame rate needs two frames whose times grow; {self.name} has {len(self.track)} in all,"
                " export it as .glb, .csv or .json"
            )
        return float(1.0 / np.median(steps))


def load_persons(run: str | Path) -> tuple[Person, ...]:
    """Load all people of a run folder, in order of appearance.

    Raises
    ------
    TrackError
        A folder holds no finished track, or `people.json` is damaged.
    UsageError
        A track has no frames, or no person was found.
    """
    people, several = [], (Path(run) / PEOPLE_FILE).exists()
    numbers = [person.id for person in load_people(run).people] if several else [1]
    for number, folder in zip(numbers, person_runs(run), strict=True):
        track, info = Track.load(folder), RunInfo.load(folder)
        if not len(track):
            raise UsageError(f"{folder} has no frames; there is nothing to show or export")
        height = info.floor[0] if info.floor else None
        name, source = folder.resolve().name, Path(info.recording).name
        turns = int(info.reader_options.get("rotate", 0)) // 90
        people.append(Person(name, track, info.body(), info.R_level_camera, number, height, source, turns))
    if not people:
        raise UsageError(f"no person was found in {run}; there is nothing to show or export")
    return tuple(people)
