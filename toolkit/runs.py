"""Run folders of several people: `RUN/person_01/`, `RUN/person_02/`, ... and the `people.json` that lists them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from toolkit.errors import TrackError
from toolkit.files import save_json

PEOPLE_FILE = "people.json"


@dataclass(frozen=True)
class PersonSummary:
    """What `people.json` says about one person.

    Attributes
    ----------
    id : number in order of appearance, from 1
    folder : name of the person's run folder within the run, such as `person_01`
    first_frame, last_frame : the first and the last frame in which they are there
    stature : of the fitted body, metres
    tracked, lost, hidden : shares, in [0, 1], of the frames in between
    """

    id: int
    folder: str
    first_frame: int
    last_frame: int
    stature: float
    tracked: float
    lost: float
    hidden: float


def save_people(run: str | Path, people: Sequence[PersonSummary]) -> Path:
    """Write `people.json` into a run and return its path.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    path = Path(run) / PEOPLE_FILE
    save_json(path, {"people": [asdict(person) for person in people]})
    return path


def load_people(run: str | Path) -> tuple[PersonSummary, ...]:
    """Read `people.json` of a run.

    Raises
    ------
    TrackError
        There is no such file, it is not understood, or it names something outside the run.
    """
    path = Path(run) / PEOPLE_FILE
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))["people"]
        people = tuple(PersonSummary(**{f.name: row[f.name] for f in fields(PersonSummary)}) for row in rows)
        folders = [str(person.folder) for person in people]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TrackError(f"cannot read {path}: {error}; track the recording again") from error
    if any(Path(folder).name != folder or folder in ("", ".", "..") for folder in folders):
        raise TrackError(f"{path} names the folders {folders}; they must be plain names within the run")
    return people


def person_runs(run: str | Path) -> tuple[Path, ...]:
    """The ordinary run folders of a run: one per person (none of nobody) where it has a `people.json`, else itself.

    Raises
    ------
    TrackError
        `people.json` is damaged.
    """
    folder = Path(run)
    if not (folder / PEOPLE_FILE).exists():
        return (folder,)
    return tuple(folder / person.folder for person in load_people(folder))
