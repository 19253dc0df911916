"""Export of a run folder; the format follows from the suffix or is named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import UsageError
from toolkit.io.files import check_output, save_json
from toolkit.io.spans import spans
from toolkit.motion.contact import ground_of
from toolkit.motion.motion_summary import as_plain, summary_of
from toolkit.motion.resting import at_rest
from toolkit.output.export.amass import export_amass
from toolkit.output.export.bvh import export_bvh
from toolkit.output.export.document import export_json, export_k4abt
from toolkit.output.export.glb import export_glb
from toolkit.output.export.opensim import export_opensim
from toolkit.output.export.pixels import label_images, write_body_index
from toolkit.output.export.tables import export_angles, export_c3d, export_csv, export_mot, export_trc
from toolkit.output.export.tree import OWN
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracks import LOST, RUN_FILE, TRACK_FILE, RunInfo
from toolkit.tracks.runs import PEOPLE_FILE, Person, load_persons, person_runs

FLOOR, CAMERA = "floor", "camera"


def origin_of(people: Sequence[Person], name: str) -> tuple[np.ndarray, str]:
    """Return the origin of a file of these people, `floor` (below the first position of the first one) or `camera`: its
    place (3,) in the level frame, metres, and one sentence about the axes, "" for the camera.

    Raises
    ------
    UsageError
        The name is neither.
    """
    if name == CAMERA:
        return np.zeros(3), ""
    if name != FLOOR:
        raise UsageError(f"--origin {name} is neither floor nor camera")
    first = min(people, key=lambda person: int(np.argmax(person.there)) if person.there.any() else len(person.there))
    place = first.track.pose[int(np.argmax(first.there)), skeleton.ROOT_POSITION]
    height, ground = ground_of(people)
    axes = f"y up, ground at y = 0 ({ground}), z towards the camera; origin below the first position of the person."
    return np.array([place[0], height, place[2]]), axes


@dataclass(frozen=True, eq=False)
class ExportJob:
    """Content of an export.

    Attributes
    ----------
    people : in the frame of the origin
    axes : sentence about the axes, "" with the origin at the camera, see `origin_of`
    rig : rig with the written joint names
    run : the run folder, None for people in memory
    recording : new place of the recording
    model : model of OpenSim that is scaled, None for none
    unit : unit of a BVH file, "cm" or "m"
    """

    people: Sequence[Person]
    axes: str
    rig: str
    run: Path | None = None
    recording: str | Path | None = None
    model: str | Path | None = None
    unit: str = "cm"

    @property
    def person(self) -> Person:
        """Return the only person."""
        (person,) = self.people
        return person


Writer = Callable[[Path, ExportJob], None]


class Format(NamedTuple):
    """A file format.

    Attributes
    ----------
    suffix : suffix of its files
    write : called with the file and the exported people
    together : True if a file holds several people
    options : options of `export_run` that only some formats have: "rig", "model", "unit"
    origins : supported origins, the default first
    blank : True if it can express that no person is present, so that an empty track is a file
    """

    suffix: str
    write: Writer
    together: bool = False
    options: tuple[str, ...] = ()
    origins: tuple[str, ...] = (FLOOR, CAMERA)
    blank: bool = True


def notes_of(axes: str, people: Sequence[Person]) -> dict[str, Any]:
    """Return the axes, and for each person the intervals (frames from 0) without the person or with a lost one."""
    return {
        "axes": axes or "Origin at the camera.",
        "people": [
            {
                "name": person.name,
                "nobody_there": _ranges(~person.there),
                "lost": _ranges(person.track.state == LOST),
            }
            for person in people
        ],
        "meaning": "In frames without the person the nearest pose is repeated, which is no measurement; in lost "
        "frames the pose is far from the measured points.",
    }


def _ranges(flags: np.ndarray) -> list[list[int]]:
    return [[span.start, span.stop - 1] for span in spans(flags)]


def _bvh(path: Path, job: ExportJob) -> None:
    person = job.person
    export_bvh(path, person.body, person.held_poses, person.frame_rate(), rig=job.rig, unit=job.unit)
    save_json(path.with_name(f"{path.name}.notes.json"), notes_of(job.axes, job.people))


def _body_index(path: Path, job: ExportJob) -> None:
    if job.run is None:
        raise UsageError("this format holds measured depth; track into a run folder and export that")
    info = RunInfo.load(person_runs(job.run)[0])
    recording, sensing = info.open_recording(job.recording), SensingSettings(**info.sensing)
    several = (job.run / PEOPLE_FILE).exists()
    write_body_index(path, label_images(job.people, recording, sensing, several=several))


def _gait(path: Path, job: ExportJob) -> None:
    found = [{"name": person.name} | as_plain(summary_of(person)) for person in job.people]
    save_json(path, {"format": "depthmocap gait", "people": found})


FORMATS: dict[str, Format] = {
    "glb": Format(
        ".glb",
        lambda path, job: export_glb(path, job.people, rig=job.rig, notes=notes_of(job.axes, job.people)),
        together=True,
        options=("rig",),
    ),
    "bvh": Format(".bvh", _bvh, options=("rig", "unit"), blank=False),
    "c3d": Format(".c3d", lambda path, job: export_c3d(path, job.people), together=True),
    "trc": Format(".trc", lambda path, job: export_trc(path, job.person)),
    "csv": Format(".csv", lambda path, job: export_csv(path, job.person, level=bool(job.axes))),
    "json": Format(
        ".json", lambda path, job: export_json(path, job.people, job.axes), together=True, origins=(CAMERA, FLOOR)
    ),
    "k4abt": Format(".json", lambda path, job: export_k4abt(path, job.people), together=True, origins=(CAMERA,)),
    "angles": Format(".csv", lambda path, job: export_angles(path, job.person)),
    "mot": Format(".mot", lambda path, job: export_mot(path, job.person), blank=False),
    "gait": Format(".json", _gait, together=True, origins=(FLOOR,)),
    "body-index": Format("", _body_index, together=True, origins=(CAMERA,)),
    "opensim": Format(
        "", lambda path, job: export_opensim(path, job.person, job.model), options=("model",), blank=False
    ),
    "amass": Format(".npz", lambda path, job: export_amass(path, job.person), blank=False),
}
"""Formats by name; of several with one suffix the first is the default."""


def export_run(
    run: str | Path | Sequence[Person],
    path: str | Path,
    *,
    rig: str | None = None,
    format: str | None = None,
    origin: str | None = None,
    recording: str | Path | None = None,
    as_tracked: bool = False,
    model: str | Path | None = None,
    unit: str | None = None,
) -> tuple[Path, ...]:
    """Write all people of a run folder to `path` in the format of its suffix, or in `format` (one of `FORMATS`).

    GLB, C3D, body-index and the JSON formats hold several people. Each other format gets one file per person,
    `<stem>_<person><suffix>`.

    Parameters
    ----------
    run : run folder, of one person or of several, or people whose tracks are in memory
    path : the file to write
    rig : joint names of GLB and BVH, one of `tree.export_rigs()`; default: those of the body
    format : a key of `FORMATS`
    origin : "floor" (y up, ground at 0, below the first position of the person) or "camera"; default: that of the
        format
    recording : new place of the recording, for formats with measured data
    as_tracked : keep the jitter of motionless bodies and sliding feet in files on the floor, see `motion.resting`
    model : `.osim` file that the format opensim scales to the person
    unit : unit of a BVH file, "cm" (default) or "m"

    Returns
    -------
    The written files, or the folder of body-index.

    Raises
    ------
    TrackError
        The folder contains no finished track.
    UsageError
        Suffix, format or origin are unknown or contradict each other, `path` is a file of the run, a rig is named for a
        format without skeleton, an optional package is missing, or there are too few frames for a frame rate.
    RigError
        The rig is unknown.
    OutputError
        A file cannot be written.
    """
    folder, people, target = None, run, Path(path)
    if isinstance(people, (str, Path)):
        folder = Path(people)
        sources = (part / name for part in person_runs(folder) for name in (TRACK_FILE, RUN_FILE))
        check_output(target, [folder / PEOPLE_FILE, *sources])
        people = load_persons(folder)
    name, format_ = _chosen(target, format)
    for option, value in (("rig", rig), ("model", model), ("unit", unit)):
        if value is not None and option not in format_.options:
            takers = [known.suffix or f"--format {key}" for key, known in FORMATS.items() if option in known.options]
            raise UsageError(f"--{option} {value} is for {', '.join(takers)}; leave it out for {name}")
    if origin is not None and origin in (FLOOR, CAMERA) and origin not in format_.origins:
        raise UsageError(f"--origin {origin} is not for {name}, whose origin is the {format_.origins[0]}")
    place = origin or format_.origins[0]
    if place == FLOOR and not as_tracked:
        people = [at_rest(person) for person in people]
    files = {target: people}
    if not format_.together and len(people) > 1:
        files = {target.with_name(f"{target.stem}_{each.name}{target.suffix}"): [each] for each in people}
    for file, shown in files.items():
        if not format_.blank and not shown[0].there.any():
            raise UsageError(
                f"{shown[0].name} is in no frame, which {file.name} cannot represent; export .csv or .json"
            )
        offset, axes = origin_of(shown, place)
        moved = [person.moved(offset) for person in shown]
        format_.write(file, ExportJob(moved, axes, rig or OWN, folder, recording, model, unit or "cm"))
    return tuple(files)


def _chosen(target: Path, format: str | None) -> tuple[str, Format]:
    """Return name and format by name or suffix."""
    suffix = target.suffix.lower()
    if format is not None:
        if format not in FORMATS:
            raise UsageError(f"--format {format} is unknown; choose one of {', '.join(FORMATS)}")
        if suffix != FORMATS[format].suffix:
            wanted = f"*{FORMATS[format].suffix}" if FORMATS[format].suffix else "a folder"
            raise UsageError(f"--format {format} is written to {wanted}, not to {target.name}")
        return format, FORMATS[format]
    for name, known in FORMATS.items():
        if known.suffix == suffix and suffix:
            return name, known
    suffixes = ", ".join(dict.fromkeys(known.suffix for known in FORMATS.values() if known.suffix))
    raise UsageError(f"cannot export to {target}; choose one of the suffixes {suffixes}")
