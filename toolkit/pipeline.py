"""A tracker run over recordings: progress, timing, interruption, resuming and the run folder."""

from __future__ import annotations

import json
import logging
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.checkpoint import load_checkpoint, save_checkpoint
from toolkit.config import load_settings, save_settings, setting_of, settings_text
from toolkit.database.database import PoseDatabase
from toolkit.errors import DepthMocapError, OutputError, RecordingError, TrackError, UsageError
from toolkit.files import sha256_of
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.people.lone import ID, LonePerson
from toolkit.sensing.recording import ReaderOptions, Recording, open_recording
from toolkit.track import PARTIAL_FILE, RUN_FILE, TRACK_FILE, RunInfo, Track, TrackWriter
from toolkit.tracking.clock import StageClock
from toolkit.tracking.crowd import Crowd, Row
from toolkit.tracking.protocol import Tracker, TrackerSettings
from toolkit.tracking.registry import DEFAULT, registered

Progress = Callable[[str, str, int, int], None]
"""Called with a recording's name, what is done ("compiling", "learning", "tracking"), frames done and all frames."""

CONFIG_FILE, LOG_FILE, STATE_FILE = "config.yaml", "log.txt", "state.npz"
MEMORY_SECONDS = 2.0
"""A killed run loses at most this much work: the state is written so often, seconds."""
WARM_UP_FRAMES = 3
"""Frames that are tracked once beforehand, so that compiled code is ready when timing begins."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class RunSummary:
    """What became of one recording.

    Attributes
    ----------
    name : of the recording
    run : its run folder
    frames, recorded_frames : rows of the track and frames of the recording
    stage_ms : median milliseconds of each stage
    """

    name: str
    run: Path
    frames: int
    recorded_frames: int
    stage_ms: dict[str, float]

    @property
    def interrupted(self) -> bool:
        """Stopped before the last frame; `resume` continues it."""
        return self.frames < self.recorded_frames

    def text(self) -> str:
        """One line for people."""
        stages = ", ".join(f"{name} {ms:.1f}" for name, ms in self.stage_ms.items())
        count = f"{self.frames} of {self.recorded_frames}" if self.interrupted else f"{self.frames}"
        hint = "; continue with --resume" if self.interrupted else ""
        return f"{self.run}: {count} frames, {sum(self.stage_ms.values()):.1f} ms a frame ({stages}){hint}"


@dataclass
class BatchReport:
    """What became of many recordings: summaries, and one sentence per recording that failed."""

    done: list[RunSummary] = field(default_factory=list)
    failed: dict[Path, str] = field(default_factory=dict)

    @property
    def interrupted(self) -> bool:
        """Whether the batch was stopped before its end."""
        return any(summary.interrupted for summary in self.done)


def load_tracker(
    config: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    database: str | Path | None = None,
    max_poses: int | None = None,
) -> Tracker:
    """The tracker that the settings name, `hybrid` if they name none.

    Parameters
    ----------
    config, overrides : settings, see `config.load_settings`; `baak2013` is the hybrid tracker as in the paper
    database : file of the pose database, for trackers that look poses up
    max_poses : use only the first poses of the database

    Raises
    ------
    DatabaseError
        The database cannot be read or belongs to another body or format version.
    SettingsError
        There is no such tracker, or a setting is unknown or wrong.
    UsageError
        The tracker needs a database and none was given.
    """
    name = setting_of("tracker", config, overrides) or DEFAULT
    registration = registered(name)
    settings: TrackerSettings = load_settings(registration.settings, config, overrides)
    if not registration.needs_database:
        return registration.build(settings, None, "")
    if database is None:
        raise UsageError(f"the tracker {name!r} looks poses up; name a pose database")
    poses = PoseDatabase.load(database)
    return registration.build(settings, poses if max_poses is None else poses.limited(max_poses), str(database))


def track_recordings(
    paths: Sequence[str | Path],
    tracker: Tracker,
    output: str | Path,
    *,
    reader_options: dict[str, Any] | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> BatchReport:
    """Track one recording into `output`, or several into `output/<stem>`.

    One of several that fails is reported and the others go on. Ctrl-C finishes the track of the current one and stops.

    Raises
    ------
    UsageError
        There is no recording, two have the same stem, or a reader option is unknown; nothing has been done then.
    DepthMocapError
        As `track_recording`, where there is only one.
    """
    runs = run_folders(paths, output)
    ReaderOptions.from_mapping(reader_options or {})
    report = BatchReport()
    for path, run in runs.items():
        try:
            recording = open_recording(path, **(reader_options or {}))
            first = not report.done
            summary = track_recording(recording, tracker, run, resume=resume, warm_up=first, progress=progress)
        except DepthMocapError as error:
            if len(runs) == 1:
                raise
            report.failed[path] = str(error)
            continue
        report.done.append(summary)
        if summary.interrupted:
            break
    return report


def run_folders(paths: Sequence[str | Path], output: str | Path) -> dict[Path, Path]:
    """The run folder of every recording.

    Raises
    ------
    UsageError
        There is no recording, or two have the same stem.
    """
    recordings = [Path(path) for path in paths]
    if not recordings:
        raise UsageError("there is no recording to track; name at least one")
    if len(recordings) == 1:
        return {recordings[0]: Path(output)}
    folders: dict[str, Path] = {}
    for path in recordings:
        if path.stem in folders:
            raise UsageError(f"{folders[path.stem]} and {path} have the same stem {path.stem!r}; track them apart")
        folders[path.stem] = path
    return {path: Path(output) / stem for stem, path in folders.items()}


def track_recording(
    recording: Recording,
    tracker: Tracker,
    run: str | Path,
    *,
    resume: bool = False,
    warm_up: bool = True,
    progress: Progress | None = None,
) -> RunSummary:
    """Follow the person through a recording and write the run folder.

    Rows are on disk as soon as they are found. Ctrl-C or a termination signal ends the run after the current frame and
    puts the track so far in place. A run that was killed or interrupted goes on with `resume`, to the same
    result as one that never stopped.

    Parameters
    ----------
    run : the run folder, made if it is missing
    resume : continue an unfinished run; one that is finished already is left alone
    warm_up : track the first frames once beforehand, so that no compilation is timed
    progress : told what is going on

    Raises
    ------
    UsageError
        The folder holds an unfinished track and `resume` is not set.
    TrackError
        The unfinished track belongs to another recording or database, or to other settings.
    OutputError
        The run folder cannot be written; the rows before stay.
    RecordingError
        A frame cannot be used; the rows before it stay.
    """
    folder, report = Path(run), progress or _silent
    info = _run_info(recording, tracker)
    if resume and (folder / RUN_FILE).exists():
        same = _is_same_run(folder, info, tracker)
        if (folder / PARTIAL_FILE).exists() and not same:
            raise TrackError(
                f"{folder} was begun with another recording, database, tracker or other settings; "
                "remove it and track again"
            )
        if same and _is_finished(folder, len(recording)):
            return _summary(recording, folder)
    writer = TrackWriter(folder, tracker.stage_names, tracker.source_names, resume=resume)
    try:
        with _log_file(folder), _stop_request() as stop:
            save_settings(tracker.settings, folder / CONFIG_FILE)
            info.save(folder)
            if warm_up:
                _warm_up(recording, tracker, report)
            crowd = Crowd(tracker, _finder(recording, tracker), recording.up_camera)
            _restore(folder, writer, crowd, tracker)
            logger.info("%s: tracking frames %d to %d", recording.name, writer.rows, len(recording))
            _follow(recording, crowd, writer, report, stop)
            if writer.rows:
                replace(info, **_shape_of(crowd.body(ID))).save(folder)
            _finish(folder, writer, len(recording))
            logger.info("%s: %d of %d frames written", recording.name, writer.rows, len(recording))
    except DepthMocapError:
        writer.abandon()
        raise
    return _summary(recording, folder)


def _silent(name: str, doing: str, done: int, total: int) -> None:
    """Progress that nobody watches."""


def _finder(recording: Recording, tracker: Tracker) -> LonePerson:
    return LonePerson(recording.camera, recording.background, tracker.settings.sensing, recording.up_camera)


def _warm_up(recording: Recording, tracker: Tracker, report: Progress) -> None:
    """Compile on purpose: the first frames are tracked by a follower that is then forgotten."""
    total = min(WARM_UP_FRAMES, len(recording))
    report(recording.name, "compiling", 0, total)
    finder = _finder(recording, tracker)
    follower = tracker.follower(finder.camera, level_rotation(recording.up_camera))
    for i, frame in enumerate(islice(recording.stream(), total)):
        for sighting in finder.find(frame.depth_mm, frame.timestamp, {}):
            follower.step(sighting, frame.timestamp, StageClock(tracker.stage_names))
        report(recording.name, "compiling", i + 1, total)


def _follow(recording: Recording, crowd: Crowd, writer: TrackWriter, report: Progress, stop: threading.Event) -> None:
    """Track from the crowd's next frame to the last one, or until a stop is asked for."""
    total, remembered = len(recording), time.monotonic()
    report(recording.name, "tracking", writer.rows, total)
    for frame in recording.stream(crowd.frames):
        if stop.is_set():
            break
        _write(writer, crowd.step(frame))
        report(recording.name, "tracking" if crowd.settled else "learning", crowd.frames, total)
        if crowd.settled and time.monotonic() - remembered > MEMORY_SECONDS:
            _remember(writer, crowd)
            remembered = time.monotonic()
    if crowd.settled and crowd.frames < total:
        _remember(writer, crowd)
    # While a body is being learnt there is no state to go on from: `resume` finds these rows again.
    _write(writer, crowd.finish())
    if not stop.is_set() and crowd.frames < total:
        raise RecordingError(
            f"{recording.name} ended after {crowd.frames} of {total} frames; copy it again and continue with --resume"
        )


def _write(writer: TrackWriter, rows: list[Row]) -> None:
    for row in rows:
        writer.append(row.result, row.timestamp)


def _remember(writer: TrackWriter, crowd: Crowd) -> None:
    save_checkpoint(writer.run / STATE_FILE, crowd.tracker.settings.tracker, crowd.export_state())


def _restore(folder: Path, writer: TrackWriter, crowd: Crowd, tracker: Tracker) -> None:
    """Go back to the last row whose state was written; the rows after it are found again."""
    if writer.rows > 0 and (folder / STATE_FILE).exists():
        crowd.restore_state(load_checkpoint(folder / STATE_FILE, tracker.settings.tracker))
    writer.cut(crowd.frames)


def _finish(folder: Path, writer: TrackWriter, total: int) -> None:
    writer.finish(complete=writer.rows == total)
    if writer.rows == total:
        (folder / STATE_FILE).unlink(missing_ok=True)


def _run_info(recording: Recording, tracker: Tracker) -> RunInfo:
    path = Path(recording.path).resolve()
    return RunInfo(
        recording=str(path),
        recording_sha256=sha256_of(path),
        reader_options=recording.options,
        body_fingerprint=skeleton.fingerprint(),
        **_shape_of(ShapeSpace.load().body()),
        database=tracker.database and str(Path(tracker.database).resolve()),
        level_rotation=level_rotation(recording.up_camera).ravel().tolist(),
        sensing=asdict(tracker.settings.sensing),
        version=version("depthmocap"),
        tracker=tracker.settings.tracker,
        seed=tracker.settings.seed,
    )


def _shape_of(body: Body) -> dict[str, Any]:
    return {"shape": [float(c) for c in body.shape], "scale": body.scale}


def _is_same_run(folder: Path, info: RunInfo, tracker: Tracker) -> bool:
    """Whether a run folder was begun with this recording, database, version and these settings."""
    before, config = RunInfo.load(folder), folder / CONFIG_FILE
    facts = ("recording_sha256", "reader_options", "body_fingerprint", "database", "version", "tracker")
    return (
        all(_as_json(getattr(before, fact)) == _as_json(getattr(info, fact)) for fact in facts)
        and config.exists()
        and config.read_text(encoding="utf-8") == settings_text(tracker.settings)
    )


def _as_json(value: Any) -> str:
    return json.dumps(value, sort_keys=True)


def _is_finished(folder: Path, frames: int) -> bool:
    done = (folder / TRACK_FILE).exists() and not (folder / PARTIAL_FILE).exists()
    return done and len(Track.load(folder)) == frames


def _summary(recording: Recording, folder: Path) -> RunSummary:
    track = Track.load(folder)
    medians = np.median(track.stage_ms, axis=0) if len(track) else np.zeros(len(track.stage_names))
    stages = dict(zip(track.stage_names, map(float, medians), strict=True))
    return RunSummary(recording.name, folder, len(track), len(recording), stages)


@contextmanager
def _stop_request() -> Iterator[threading.Event]:
    """An event that Ctrl-C or a termination signal sets; a second one is not held back any more.

    Outside the main thread signals cannot be caught, and the event stays unset.
    """
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def request(number: int, frame: object) -> None:
        stop.set()
        signal.signal(number, before[signal.Signals(number)])

    for number in before:
        signal.signal(number, request)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _log_file(folder: Path) -> Iterator[None]:
    """Everything that the toolkit logs meanwhile goes to `log.txt` too."""
    try:
        handler = logging.FileHandler(folder / LOG_FILE, encoding="utf-8")
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"cannot write {folder / LOG_FILE}: {reason}; choose a folder that can be written") from error
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    root = logging.getLogger("toolkit")
    level = root.level
    root.addHandler(handler)
    root.setLevel(logging.INFO)
    try:
        yield
    finally:
        root.setLevel(level)
        root.removeHandler(handler)
        handler.close()
