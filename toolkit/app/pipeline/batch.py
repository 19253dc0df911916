"""Many recordings, one after the other or in processes of joblib, each of which builds its tracker once.

A job owns its run folder, never raises, and leaves a finished run of the same recording and settings alone, so that a
batch can be started again at any time. Inside `joblib.parallel_config(backend="dask")` or Ray's the same jobs run on a
cluster.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.app.pipeline.joint_choice import JointChoice
from toolkit.app.pipeline.manifest import DONE, FAILED, INTERRUPTED, Manifest, ManifestRow
from toolkit.app.pipeline.run import track_recording
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.io.errors import DepthMocapError, RecordingError, UsageError
from toolkit.io.progress import RecordingProgress, silent
from toolkit.io.workers import Task
from toolkit.recordings.opening import open_recording, open_upright
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.tracking.tracker_protocol import Tracker

ROUNDS = 3
"""How often what dead processes left is started again."""


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

    Runs that are finished are left alone, interrupted ones go on, and what failed before is tried again by the same
    call. A recording that fails does not stop the others; Ctrl-C ends the batch after the current frame.

    Parameters
    ----------
    paths : recordings, of different stems
    recipe : how each process builds its tracker
    people, joints : as in `track_recording`
    reader_options : those of `ReaderOptions`
    workers : processes of one thread each. 1 = this one, which tells how far it is in each recording; None = as the
        surrounding `joblib.parallel_config` says
    overwrite : track again what is finished, and replace runs of other recordings or settings
    progress : told after each recording, too

    Returns
    -------
    The row of every recording, in the order of `paths`.

    Raises
    ------
    UsageError
        There is no recording, two have one stem, or an option is unknown.
    DepthMocapError
        The tracker cannot be built.
    OutputError
        The manifest cannot be written.
    """
    runs, options = _run_folders(paths, output), dict(reader_options or {})
    ReaderOptions.from_mapping(options)
    jobs = [_Job(recipe, str(path), str(run), people, options, joints, not overwrite) for path, run in runs.items()]
    tracker, manifest = recipe.build(), Manifest(output)  # what is wrong with the settings is said before work starts
    status, reason = FAILED, "its process died, by lack of memory perhaps"
    try:
        for row in _one_by_one(jobs, tracker, progress) if workers == 1 else _in_processes(jobs, workers):
            manifest.append(row)
            progress("recordings", "tracked", len(manifest.rows), len(jobs))
    except KeyboardInterrupt:
        status, reason = INTERRUPTED, "the batch was stopped; start it again"
    for job in jobs:
        if job.recording not in manifest.rows:
            manifest.append(ManifestRow(job.recording, job.run, status, reason))
    return [manifest.rows[job.recording] for job in jobs]


def _run_folders(paths: Sequence[str | Path], output: str | Path) -> dict[Path, Path]:
    """The run folder of every recording."""
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
    """One recording of a batch, as `track_recordings` has it."""

    recipe: TrackerRecipe
    recording: str
    run: str
    people: int | None
    options: dict[str, Any]
    joints: JointChoice | None
    resume: bool

    def done(self, tracker: Tracker, warm_up: bool, progress: RecordingProgress = silent) -> ManifestRow:
        """Track the recording; whatever happens is in the row."""
        start = time.perf_counter()
        try:
            summary = track_recording(
                open_upright(self.recording, **self.options), tracker, self.run, people=self.people,
                resume=self.resume, warm_up=warm_up, progress=progress, joints=self.joints, made_of=self.recipe,
            )  # fmt: skip
        except Exception as error:  # a job that raised would end the whole batch
            reason = f"{error}" if isinstance(error, DepthMocapError) else f"{type(error).__name__}: {error}"
            return ManifestRow(self.recording, self.run, FAILED, reason, seconds=time.perf_counter() - start)
        status = INTERRUPTED if summary.interrupted else DONE
        spent = time.perf_counter() - start
        return ManifestRow(self.recording, self.run, status, "", summary.text(), spent, summary.frames)


def _one_by_one(jobs: Sequence[_Job], tracker: Tracker, progress: RecordingProgress) -> Iterator[ManifestRow]:
    """The rows of jobs done in this process; Ctrl-C, which ends a run in its own way, ends the others too."""
    for i, job in enumerate(jobs):
        row = job.done(tracker, warm_up=i == 0, progress=progress)
        yield row
        if row.status == INTERRUPTED:
            raise KeyboardInterrupt


def _in_processes(jobs: Sequence[_Job], workers: int | None) -> Iterator[ManifestRow]:
    """The rows of jobs as they are done; what a process that died had not finished is started again."""
    import joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    pending = {job.recording: job for job in jobs}
    for _ in range(ROUNDS):
        try:
            with _threads(workers):
                tasks = [joblib.delayed(Task.of(_in_worker))(job) for job in pending.values()]
                for row in joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(tasks):
                    del pending[row.recording]
                    yield row
            return
        except TerminatedWorkerError:
            continue


def _threads(workers: int | None) -> Any:
    """One thread in each process where we choose the processes; a surrounding configuration chooses for itself."""
    from contextlib import nullcontext

    import joblib

    return nullcontext() if workers is None else joblib.parallel_config("loky", inner_max_num_threads=1)


_TRACKERS: dict[str, Tracker] = {}
"""The tracker of a worker process, by its recipe."""


def _in_worker(job: _Job) -> ManifestRow:
    """The row of a job that is done in a worker process."""
    key = repr(job.recipe)
    first = key not in _TRACKERS
    if first:
        _TRACKERS[key] = job.recipe.build()
    return job.done(_TRACKERS[key], warm_up=first)


def unreadable(paths: Sequence[str | Path], reader_options: Mapping[str, Any]) -> dict[Path, str]:
    """Recordings that cannot be opened or whose first frame cannot be read, with the reason: told before work starts.

    Raises
    ------
    UsageError
        A reader option is unknown or wrong.
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
