"""A run folder as a file of another program: the format follows from the file's suffix."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from toolkit.errors import UsageError
from toolkit.export.bvh import export_bvh
from toolkit.export.c3d import export_c3d
from toolkit.export.document import export_json
from toolkit.export.glb import export_glb
from toolkit.export.tables import export_csv, export_trc
from toolkit.export.tree import OWN
from toolkit.files import check_output
from toolkit.runs import PEOPLE_FILE, Person, load_persons, person_runs
from toolkit.track import RUN_FILE, TRACK_FILE

Writer = Callable[[Path, Sequence[Person], str], None]
"""Called with the file, the people and the rig."""


class Format(NamedTuple):
    """A file format: how it is written, whether a file holds several people, whether a rig names its joints."""

    write: Writer
    together: bool
    rigged: bool


def _bvh(path: Path, people: Sequence[Person], rig: str) -> None:
    (person,) = people
    export_bvh(path, person.body, person.track.pose, person.frame_rate(), rig=rig)


def _trc(path: Path, people: Sequence[Person], rig: str) -> None:
    (person,) = people
    export_trc(path, person.joints_level, person.times, person.frame_rate())


def _csv(path: Path, people: Sequence[Person], rig: str) -> None:
    (person,) = people
    export_csv(path, person.track.joints, person.track.timestamps)


FORMATS: dict[str, Format] = {
    ".glb": Format(lambda path, people, rig: export_glb(path, people, rig=rig), together=True, rigged=True),
    ".bvh": Format(_bvh, together=False, rigged=True),
    ".c3d": Format(lambda path, people, rig: export_c3d(path, people), together=True, rigged=False),
    ".trc": Format(_trc, together=False, rigged=False),
    ".csv": Format(_csv, together=False, rigged=False),
    ".json": Format(lambda path, people, rig: export_json(path, people), together=True, rigged=False),
}
"""What can be exported, by suffix."""


def export_run(run: str | Path, path: str | Path, *, rig: str | None = None) -> tuple[Path, ...]:
    """Write everybody in a run folder to `path`; its suffix, one of `FORMATS`, says how.

    GLB, C3D and JSON hold several people. The other formats hold one: of several people each has a file of their own,
    `<stem>_<person><suffix>`.

    Parameters
    ----------
    run : run folder, of one person or of several
    path : the file to write
    rig : joint names of GLB and BVH, one of `tree.export_rigs()` or a YAML file; the body's own by default

    Returns
    -------
    The files that were written.

    Raises
    ------
    TrackError
        The folder holds no finished track.
    UsageError
        The suffix is unknown, `path` is a file of the run, a rig is named for a format without joints of a skeleton, an
        optional package is missing, or there are too few frames for a frame rate.
    RigError
        The rig is unknown.
    OutputError
        A file cannot be written.
    """
    target = Path(path)
    format_ = FORMATS.get(target.suffix.lower())
    if format_ is None:
        raise UsageError(f"cannot export to {path}; choose one of the suffixes {', '.join(FORMATS)}")
    if rig is not None and not format_.rigged:
        named = ", ".join(suffix for suffix, known in FORMATS.items() if known.rigged)
        raise UsageError(f"--rig {rig} is for {named}; {target.suffix} names the joints that are reported")
    check_output(target, [Path(run) / PEOPLE_FILE, *(f / n for f in person_runs(run) for n in (TRACK_FILE, RUN_FILE))])
    people, names = load_persons(run), rig or OWN
    if format_.together or len(people) == 1:
        format_.write(target, people, names)
        return (target,)
    written = []
    for person in people:
        written.append(target.with_name(f"{target.stem}_{person.name}{target.suffix}"))
        format_.write(written[-1], [person], names)
    return tuple(written)
