"""Batches of recordings, tracked one by one or in joblib processes with one tracker each.

A job owns its run folder, never raises, and skips a finished run of the same recording and settings. A batch can
therefore be restarted at any time. Inside `joblib.parallel_config(backend="dask")` or Ray's equivalent the same jobs
run on a cluster.
"""

from __future__ import annotations

import json
import os
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from toolkit.app.pipeline.image_joints import JointChoice
from toolkit.app.pipeline.run import track_recording
from toolkit.app.pipeline.trackers import TrackerRecipe, worker_tracker
from toolkit.io.errors import (
    DepthMocapError,
    OutputError,
    PlausibilityWarning,
    RecordingError,
    UsageError,
    os_errors_as,
)
from toolkit.io.progress import RecordingProgress, silent
from toolkit.io.safe_open import open_file
from toolkit.io.workers import task_of
from toolkit.recordings.opening import open_recording, open_upright
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.tracking.tracker_protocol import Tracker

MANIFEST_FILE = "manifest.jsonl"
DONE, FAILED, INTERRUPTED = "done", "failed", "interrupted"
HEAD = b'{"command": "track"}\n'
"""Content of the first line."""


@dataclass(frozen=True)
class ManifestRow:
    """Outcome of one recording.

    Attributes
    ----------
    recording, run : paths
    status : "done", "failed" or "interrupted"
    reason : why it failed, empty otherwise
    text : the summary for people, empty where it failed
    seconds : wall-clock time
    frames : rows of its track
    tracked : frames in which a person is tracked, of all people together
    warnings : reasons to doubt the recording or its track
    """

    recording: str
    run: str
    status: str
    reason: str = ""
    text: str = ""
    seconds: float = 0.0
    frames: int = 0
    tracked: int = 0
    warnings: tuple[str, ...] = ()


class Manifest:
    """Manifest in the output folder of a batch; replaces the manifest of an earlier batch.

    Attributes
    ----------
    path : path of the file, which is written with its first row
    rows : so far, by recording

    Raises
    ------
    UsageError
        The folder holds a manifest of another program.
    """

    def __init__(self, folder: str | Path) -> None:
        self.path = Path(folder) / MANIFEST_FILE
        self.rows: dict[str, ManifestRow] = {}
        if not os.path.lexists(self.path):
            return
        with os_errors_as(UsageError, f"cannot read {self.path}", "choose another output"):
            with open_file(self.path, inside=True) as stream:
                own = HEAD.startswith(stream.readline(len(HEAD)))  # a partially written first line counts as a header
        if not own:
            raise UsageError(f"{self.path} is the manifest of something else; choose another output")

    def append(self, row: ManifestRow) -> None:
        """Append a row; it is on the disk when this returns.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        with os_errors_as(OutputError, f"cannot write {self.path}", "free some space"):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with open_file(self.path, "a+b" if self.rows else "w+b", inside=True) as stream:
                stream.write((b"" if self.rows else HEAD) + json.dumps(asdict(row)).encode() + b"\n")
                stream.flush()
                os.fsync(stream.fileno())
        self.rows[row.recording] = row


def track_recordings(
    paths: Sequence[str | Path],
    recipe: TrackerRecipe,
    output: str | Path,
    *,
    people: int | None = 1,
    reader_options: Mapping[str, Any] | None = None,
    joints: JointChoice | None = None,
    workers: int | None = 1,
    overwrite: bool = False,
    progress: RecordingProgress = silent,
) -> list[ManifestRow]:
    """Track recordings into `output/<stem>` and write `output/manifest.jsonl` as results arrive.

    Finished runs are skipped, interrupted ones are resumed, failed ones are repeated. A failing recording does not stop
    the others; Ctrl-C ends the batch after the current frame.

    Parameters
    ----------
    paths : recordings, of different stems
    recipe : recipe of the tracker in each process
    people, joints : as in `track_recording`
    reader_options : those of `ReaderOptions`
    workers : number of single-threaded processes. 1 = this process, which reports the progress of each recording; None
        = as given by the surrounding `joblib.parallel_config`
    overwrite : repeat finished runs, and replace runs of other recordings or settings
    progress : also called after each recording

    Returns
    -------
    One row per recording, in the order of `paths`.

    Raises
    ------
    UsageError
        `paths` is empty, two recordings have the same stem, or a reader option is unknown.
    DepthMocapError
        The tracker cannot be built.
    OutputError
        The manifest cannot be written.
    """
    runs, options = _run_folders(paths, output), dict(reader_options or {})
    ReaderOptions.from_mapping(options)
    jobs = [_Job(recipe, str(path), str(run), people, options, joints, not overwrite) for path, run in runs.items()]
    tracker, manifest = recipe.build(), Manifest(output)  # report wrong settings before work starts
    status, reason = FAILED, "its process died, perhaps from lack of memory"
    try:
        alone = len(jobs) == 1 and workers is not None
        rows = _one_by_one(jobs, tracker, progress, workers or 1) if workers == 1 or alone else None
        for row in rows or _in_processes(jobs, workers):
            manifest.append(row)
            for doubt in row.warnings:
                warnings.warn(PlausibilityWarning(doubt), stacklevel=2)
            progress("recordings", "tracked", len(manifest.rows), len(jobs))
    except KeyboardInterrupt:
        status, reason = INTERRUPTED, "the batch was stopped; start it again"
    for job in jobs:
        if job.recording not in manifest.rows:
            manifest.append(ManifestRow(job.recording, job.run, status, reason))
    return [manifest.rows[job.recording] for job in jobs]


def _run_folders(paths: Sequence[str | Path], output: str | Path) -> dict[Path, Path]:
    """Return the run folder of each recording."""
    if not paths:
        raise UsageError("there is no recording to track; name at least one")
    stems: dict[str, Path] = {}
    for path in map(Path, paths):
        if path.stem in stems:
            raise UsageError(f"{stems[path.stem]} and {path} have the same stem {path.stem!r}; track them apart")
        stems[path.stem] = path
    return {path: Path(output) / stem for stem, path in stems.items()}


@dataclass(frozen=True)
class _Job:
    """One recording of a batch with the arguments of `track_recording`."""

    recipe: TrackerRecipe
    recording: str
    run: str
    people: int | None
    options: dict[str, Any]
    joints: JointChoice | None
    resume: bool

    def done(self, tracker: Tracker, progress: RecordingProgress = silent, workers: int = 1) -> ManifestRow:
        """Track the recording and return its row, also after a failure."""
        start = time.perf_counter()
        try:
            with warnings.catch_warnings(record=True) as doubts:  # those of a worker process are shown by the caller
                warnings.simplefilter("always", PlausibilityWarning)
                summary = track_recording(
                    open_upright(self.recording, **self.options), tracker, self.run,
                    people=self.people, resume=self.resume, progress=progress, joints=self.joints,
                    made_of=self.recipe, workers=workers,
                )  # fmt: skip
        except Exception as error:  # a job that raised would end the whole batch
            reason = f"{error}" if isinstance(error, DepthMocapError) else f"{type(error).__name__}: {error}"
            return ManifestRow(self.recording, self.run, FAILED, reason, seconds=time.perf_counter() - start)
        status = INTERRUPTED if summary.interrupted else DONE
        spent = time.perf_counter() - start
        texts = tuple(str(doubt.message) for doubt in doubts if issubclass(doubt.category, PlausibilityWarning))
        tracked = summary.states["tracked"]
        return ManifestRow(self.recording, self.run, status, "", summary.text(), spent, summary.frames, tracked, texts)


def _one_by_one(
    jobs: Sequence[_Job], tracker: Tracker, progress: RecordingProgress, workers: int
) -> Iterator[ManifestRow]:
    """Yield the rows of jobs in this process; Ctrl-C ends the remaining jobs."""
    for job in jobs:
        row = job.done(tracker, progress=progress, workers=workers)
        yield row
        if row.status == INTERRUPTED:
            raise KeyboardInterrupt


def _in_processes(jobs: Sequence[_Job], workers: int | None) -> Iterator[ManifestRow]:
    """Yield the rows of parallel jobs in order of completion; restart the jobs of a dead process."""
    import joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    pending = {job.recording: job for job in jobs}
    rounds = 3  # maximum number of restarts after the death of a worker process
    for _ in range(rounds):
        try:
            with _threads(workers):
                tasks = [joblib.delayed(task_of(_in_worker))(job) for job in pending.values()]
                for row in joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(tasks):
                    del pending[row.recording]
                    yield row
            return
        except TerminatedWorkerError:
            continue


def _threads(workers: int | None) -> Any:
    """Return the joblib configuration: one thread per process, unless a configuration is already active."""
    from contextlib import nullcontext

    import joblib

    return nullcontext() if workers is None else joblib.parallel_config("loky", inner_max_num_threads=1)


def _in_worker(job: _Job) -> ManifestRow:
    """Run a job in a worker process and return its row."""
    return job.done(worker_tracker(job.recipe))


def unreadable(paths: Sequence[str | Path], reader_options: Mapping[str, Any]) -> dict[Path, str]:
    """Return the recordings that cannot be opened, or whose first frame cannot be read, with the reason.

    Raises
    ------
    UsageError
        A reader option is unknown or invalid.
    RecordingError
        None of the recordings can be read.
    """
    failed: dict[Path, str] = {}
    first: RecordingError | None = None
    for path in map(Path, paths):
        try:
            recording = open_recording(path, **reader_options)
            next(iter(recording.stream()), None)
        except RecordingError as error:
            failed[path], first = str(error), first or error
    if first is not None and len(failed) == len(set(map(Path, paths))):
        if len(failed) == 1:
            raise first
        raise RecordingError(f"none of the {len(failed)} recordings can be read; the first: {first}")
    return failed
