"""Content of a report for one run: numbers as JSON, and blocks of bytes."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.evaluation.evaluate import match_people
from toolkit.evaluation.joint_errors import frame_errors, joint_errors
from toolkit.evaluation.reference import find_reference
from toolkit.io.errors import RecordingError, UsageError
from toolkit.io.progress import Progress, silent
from toolkit.io.safe_open import read_file
from toolkit.io.yaml_reader import LARGEST_YAML
from toolkit.motion.uncertain_limbs import uncertain_text
from toolkit.output.export.glb import export_glb
from toolkit.output.rendering import style
from toolkit.output.rendering.film import render_run
from toolkit.output.rendering.painter import RenderSettings
from toolkit.output.report.clouds import MILLIMETRES, STORED_UNIT, gather_clouds, pack
from toolkit.output.report.gait import gait_section
from toolkit.sensing.recording import Recording
from toolkit.tracks import EMPTY, STATE_NAMES, RunInfo, Track
from toolkit.tracks.runs import Person, load_persons, person_runs

LONGEST = 3000
"""Default maximum number of frames; the page of a longer recording would be too large for mail."""
FILM = RenderSettings(panels=("depth", "body"), height=320, aspect=0.8, extrema=0)
"""Panels of the film in a page; the 3-D view replaces the side view."""
STAGE_COLORS = ("#5b8ff9", "#f6903d", "#61ddaa", "#d3adf7", "#f6bd16", "#ff99c3", "#65789b", "#269a99")


@dataclass(frozen=True, eq=False)
class RunContent:
    """One run of a page: `data` becomes JSON and refers to `blocks` by key; `movement` is HTML."""

    data: dict[str, Any]
    blocks: dict[str, bytes]
    movement: str = ""


def describe_run(
    run: str | Path,
    key: str,
    *,
    recording: str | Path | None = None,
    references: Sequence[str | Path] = (),
    frames: range | None = None,
    progress: Progress = silent,
) -> RunContent:
    """Collect the content of a page for one run, of one person or several.

    Without the recording a page has no film, points or errors, and gives the reason.

    Parameters
    ----------
    run : the run folder
    key : unique among the runs of a page
    recording : new place of the recording
    references : see `evaluation.reference.find_reference`
    frames : a contiguous range; default: the first `LONGEST`
    progress : called as the work advances

    Raises
    ------
    TrackError
        The folder contains no finished track.
    UsageError
        The frames are no contiguous range of the track.
    """
    people, folder = load_persons(run), person_runs(run)[0]
    total = len(people[0].track)
    chosen = frames if frames is not None else range(min(total, LONGEST))
    if not len(chosen) or chosen.start < 0 or chosen.stop > total or chosen.step != 1:
        raise UsageError(f"frames {chosen} are not some of the {total} frames of {run}, one after the other")
    info = RunInfo.load(folder)
    shown = [replace(person, track=_cut(person.track, chosen)) for person in people]
    note = "" if len(chosen) == total else f"Frames {chosen.start + 1} to {chosen.stop} of {total} are shown. "
    blocks = {"glb": _glb(shown)}
    data = _numbers(run, info, shown, chosen, total) | {"config": _text(folder / "config.yaml")}
    try:
        opened = info.open_recording(recording)
    except RecordingError as error:
        note += f"No film, points or errors: {error}."
    else:
        data["plots"][:0] = _error_plots(people, opened, [Path(r) for r in references], chosen)
        seen, more = _seen(run, opened, recording, people, chosen, progress)
        data, blocks = data | seen, blocks | more
    keys = {name: f"{key}-{name}" for name in blocks}
    movement = gait_section(data["name"], people)
    return RunContent(data | keys | {"note": note}, {keys[name]: block for name, block in blocks.items()}, movement)


def _cut(track: Track, frames: range) -> Track:
    rows = slice(frames.start, frames.stop)
    columns = ("joints", "pose", "confidence", "state", "source", "timestamps", "stage_ms", "observed", "contact")
    return replace(track, **{name: getattr(track, name)[rows] for name in columns})


def _numbers(run: str | Path, info: RunInfo, people: list[Person], frames: range, total: int) -> dict[str, Any]:
    """Return times, joints, plots and facts, which need no recording."""
    times = people[0].times
    joints = np.concatenate([person.joints_level for person in people])
    seen = joints[np.isfinite(joints).all(axis=(1, 2))]
    if not len(seen):
        seen = np.zeros((1, *joints.shape[1:])) + (0.0, 0.0, -3.0)
    target = np.median(seen[:, skeleton.REPORTED.index("pelvis")], axis=0)
    feet = seen[:, [skeleton.REPORTED.index(f"{side}_foot") for side in ("left", "right")], 1]
    return {
        "name": Path(run).resolve().name,
        "first": frames.start,
        "recorded": total,
        "times": np.round(times, 4).tolist(),
        "joint_names": skeleton.REPORTED,
        "bones": skeleton.BONE_ROWS.tolist(),
        "view": {"target": np.round(target, 3).tolist(), "from": np.round(target + (1.6, 0.5, 3.0), 3).tolist()},
        "floor": round(float(np.percentile(feet, 5)) - 0.05, 3),
        "lens": [1.0, 1.0, 0.0, 0.0, 0, 0],
        "to_level": info.R_level_camera.tolist(),
        "film": None,
        "poster": None,
        "rate": 1.0,
        "unit": STORED_UNIT,
        "points": None,
        "point_counts": [],
        "room": None,
        "people": [_person(person, number, len(people)) for number, person in enumerate(people)],
        "plots": [_confidence_plot(people), _stage_plot(people)],
        "facts": _facts(info, people, total),
    }


def _person(person: Person, number: int, of: int) -> dict[str, Any]:
    track = person.track
    joints = np.rint(np.nan_to_num(person.joints_level) * MILLIMETRES).astype(int).reshape(len(track), -1).tolist()
    there = track.state != EMPTY
    colors = style.JOINT_COLORS if of == 1 else (style.person_color(number),) * len(skeleton.REPORTED)
    return {
        "name": person.name,
        "color": _hex(style.INK if of == 1 else style.person_color(number)),
        "joint_colors": [_hex(color) for color in colors],
        "state": track.state.tolist(),
        "joints": [row if here else None for row, here in zip(joints, there, strict=True)],
        "observed": ["".join("01"[seen] for seen in row) for row in track.observed.astype(int).tolist()],
    }


def _facts(info: RunInfo, people: list[Person], total: int) -> list[list[str]]:
    facts = [["recording", Path(info.recording).name], ["frames", str(total)], ["version", info.version]]
    for person in people:
        share = [f"{100 * float((person.track.state == i).mean()):.1f} % {name}" for i, name in enumerate(STATE_NAMES)]
        who = f"{person.name}: " if len(people) > 1 else ""
        facts.append([f"{who}stature", f"{person.body.height:.2f} m"])
        facts.append([f"{who}frames", ", ".join(share)])
        facts.append([f"{who}uncertain limbs", uncertain_text(person.track)])
    track = people[0].track
    for i, name in enumerate(track.stage_names):
        values = track.stage_ms[:, i]
        facts.append([f"time: {name}", f"{np.median(values):.2f} ms, 95 %: {np.percentile(values, 95):.2f} ms"])
    return [*facts, ["database", Path(info.database).name or "none"]]


def _confidence_plot(people: list[Person]) -> dict[str, Any]:
    series = []
    for number, person in enumerate(people):
        empty = person.track.state == EMPTY
        who = f"{person.name}, " if len(people) > 1 else ""
        color = style.person_color(number)
        for name, values, dimmed in (
            ("mean of all joints", person.track.confidence.mean(axis=1), color),
            ("least sure joint", person.track.confidence.min(axis=1), tuple(c // 2 for c in color)),
        ):
            held = np.where(empty, np.nan, values)
            series.append({"name": f"{who}{name}", "color": _hex(dimmed), "values": _nullable(held, 3)})
    return {"title": "confidence: probability that a joint is within 100 mm", "highest": 1.0, "series": series}


def _stage_plot(people: list[Person]) -> dict[str, Any]:
    track = people[0].track
    summed = np.cumsum(sum(person.track.stage_ms for person in people), axis=1)
    low = np.concatenate([np.zeros((len(track), 1)), summed[:, :-1]], axis=1)
    series = [
        {
            "name": name,
            "color": STAGE_COLORS[i % len(STAGE_COLORS)],
            "low": np.round(low[:, i], 2).tolist(),
            "values": np.round(summed[:, i], 2).tolist(),
        }
        for i, name in enumerate(track.stage_names)
    ]
    highest = 1.5 * float(np.percentile(summed[:, -1], 90)) if summed.size else 0.0
    return {"title": "time per frame by stage, ms", "highest": max(highest, 0.1), "series": series}


def _error_plots(
    people: Sequence[Person], recording: Recording, references: list[Path], frames: range
) -> list[dict[str, Any]]:
    """Return the error plot, or the agreement plot for another system's skeleton; nothing without a reference."""
    reference = find_reference(recording, references, len(people[0].track))
    if reference is None:
        return []
    series, highest = [], 60.0
    for number, own in enumerate(match_people(reference, [person.track for person in people])[0]):
        if own is None:
            continue
        person = people[number]
        errors = frame_errors(joint_errors(person.track.joints, own.joints))
        values = np.where(person.track.state == EMPTY, np.nan, MILLIMETRES * errors)[frames.start : frames.stop]
        known = values[np.isfinite(values)]
        highest = max(highest, 1.1 * float(known.max())) if known.size else highest
        name = person.name if len(people) > 1 else "mean of all joints"
        series.append({"name": name, "color": _hex(style.person_color(number)), "values": _nullable(values, 1)})
    title = "error: mean distance of the joints to the true ones, mm"
    if not reference.is_truth:
        title = "agreement: mean distance of the joints to another system's skeleton, mm (that is no truth)"
    return [{"title": title, "highest": highest, "series": series}]


def _seen(
    run: str | Path,
    recording: Recording,
    moved_to: str | Path | None,
    people: Sequence[Person],
    frames: range,
    progress: Progress,
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Return film, its first picture, points and room as bytes, and the numbers that describe them."""
    camera, times = recording.camera, people[0].times[frames.start : frames.stop]
    rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 and times[-1] > times[0] else 25.0
    rate = float(np.clip(rate, 1.0, 120.0))
    with tempfile.TemporaryDirectory() as folder:
        film = render_run(
            run, Path(folder) / "film.webm", recording=moved_to, settings=FILM, frames=frames, rate=rate,
            progress=lambda done, of: progress("drawing the film", done, of),
        )  # fmt: skip
        blocks = {"film": film.read_bytes(), "poster": _first_picture(film)}
    joints = np.concatenate(
        [np.where((person.track.state == EMPTY)[:, None, None], np.nan, person.track.joints) for person in people],
        axis=1,
    )
    clouds = gather_clouds(recording, joints, frames)
    blocks |= {"points": pack(clouds.points), "room": pack(clouds.room)}
    facts = {"rate": rate, "point_counts": clouds.counts.tolist()}
    lens = [camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height]
    return facts | {"lens": lens}, blocks


def _first_picture(film: Path) -> bytes:
    """Return the first picture of a film as JPEG: browsers show nothing of a film before it plays."""
    import cv2

    opened = cv2.VideoCapture(str(film))
    _, picture = opened.read()
    opened.release()
    return cv2.imencode(".jpg", picture)[1].tobytes()


def _glb(people: list[Person]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motion.glb"
        export_glb(path, people, colors=style.mesh_colors([person.body for person in people]))
        return path.read_bytes()


def _text(path: Path) -> str:
    """Return the settings of a run if they are a regular file of its folder, because pages may be mailed."""
    try:
        return read_file(path, LARGEST_YAML, inside=True).decode("utf-8", "replace")
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        return "no config.yaml beside the track" if missing else f"config.yaml is not shown: {error.strerror or error}"


def _nullable(values: np.ndarray, decimals: int) -> list[float | None]:
    return [round(value, decimals) if np.isfinite(value) else None for value in values.tolist()]


def _hex(color: Sequence[int]) -> str:
    return "#" + "".join(f"{int(c):02x}" for c in color)
