"""Many recordings in many processes, by joblib: each process builds its tracker once and reuses it.

A task owns its run folder, never raises, and leaves a finished run of the same recording and settings alone, so that a
batch can be started again at any time. Inside `joblib.parallel_config(backend="dask")` or Ray's the same tasks run on a
cluster.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from toolkit.errors import DepthMocapError
from toolkit.files import check_output
from toolkit.pipeline.batch import run_folders
from toolkit.pipeline.joints import JointChoice
from toolkit.pipeline.manifest import DONE, FAILED, INTERRUPTED, Manifest, ManifestRow
from toolkit.pipeline.run import track_recording
from toolkit.pipeline.trackers import TrackerRecipe
from toolkit.progress import Progress, silent
from toolkit.recordings.opening import open_upright
from toolkit.recordings.options import ReaderOptions
from toolkit.tracking.protocol import Tracker
from toolkit.workers import Task

ROUNDS = 3
"""How often what dead processes left is started again."""


def track_many(
    paths: Sequence[str | Path],
    recipe: TrackerRecipe,
    output: str | Path,
    *,
    people: int | None = 1,
    reader_options: Mapping[str, Any] | None = None,
    joints: JointChoice | None = None,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> list[ManifestRow]:
    """Track recordings into `output/<stem>` and write `output/manifest.jsonl` as results arrive.

    Runs that are finished are left alone: what failed before is tried again by the same call.

    Parameters
    ----------
    paths : recordings, of different stems
    recipe : how each process builds its tracker
    people, reader_options, joints : as in `track_recordings`
    workers : processes of one thread each; None = as the surrounding `joblib.parallel_config` says, else one
    overwrite : track again what is finished, and replace runs of other recordings or settings
    progress : told after each recording

    Returns
    -------
    The row of every recording, in the order of `paths`.

    Raises
    ------
    UsageError
        There is no recording, two have one stem, an option is unknown, or the output would damage an input.
    DepthMocapError
        The tracker cannot be built.
    OutputError
        The manifest cannot be written.
    """
    import joblib

    jobs = {str(path): run for path, run in _folders(paths, output).items()}
    options = dict(reader_options or {})
    ReaderOptions.from_mapping(options)
    recipe.build()  # what is wrong with the settings is said once, and before work starts
    manifest = Manifest(output)
    tasks = {
        path: joblib.delayed(Task.of(_task))(recipe, path, str(run), people, options, joints, not overwrite)
        for path, run in jobs.items()
    }
    left, status, reason = _done(tasks, manifest, workers, progress)
    for path in left:
        manifest.append(ManifestRow(path, str(jobs[path]), status, reason))
    return [manifest.rows[str(path)] for path in paths]


def _done(
    tasks: dict[str, Any], manifest: Manifest, workers: int | None, progress: Progress
) -> tuple[list[str], str, str]:
    """Do the tasks, of recordings; those that were not done, and the status and the reason of all of them."""
    import joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    pending = dict(tasks)
    for _ in range(ROUNDS):
        try:
            with _threads(workers):
                for row in joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(list(pending.values())):
                    del pending[row.recording]
                    manifest.append(row)
                    progress("recordings", len(tasks) - len(pending), len(tasks))
            break
        except TerminatedWorkerError:
            continue
        except KeyboardInterrupt:
            return list(pending), INTERRUPTED, "the batch was stopped; start it again"
    return list(pending), FAILED, "its process died, by lack of memory perhaps"


def _folders(paths: Sequence[str | Path], output: str | Path) -> dict[Path, Path]:
    """Run folder of each recording, `output/<stem>` for a single one too."""
    folders = run_folders(paths, output)
    if len(folders) == 1:
        folders = {path: Path(output) / path.stem for path in folders}
    for path, run in folders.items():
        check_output(run, [path], sealed=[path])
    return folders


def _threads(workers: int | None) -> Any:
    """One thread in each process where we choose the processes; a surrounding configuration chooses for itself."""
    from contextlib import nullcontext

    import joblib

    return nullcontext() if workers is None else joblib.parallel_config("loky", inner_max_num_threads=1)


_TRACKERS: dict[str, Tracker] = {}
"""This process's tracker, by its recipe."""


def _task(
    recipe: TrackerRecipe,
    path: str,
    run: str,
    people: int | None,
    options: dict[str, Any],
    joints: JointChoice | None,
    resume: bool,
) -> ManifestRow:
    """Track one recording; whatever happens is in the row."""
    start, first = time.perf_counter(), repr(recipe) not in _TRACKERS
    try:
        if first:
            _TRACKERS[repr(recipe)] = recipe.build()
        recording = open_upright(path, **options)
        tracker = _TRACKERS[repr(recipe)]
        summary = track_recording(
            recording,
            tracker,
            run,
            people=people,
            resume=resume,
            warm_up=first,
            joints=joints,
            made_of=recipe,
        )
    except Exception as error:  # a task that raised would end the whole batch
        reason = f"{error}" if isinstance(error, DepthMocapError) else f"{type(error).__name__}: {error}"
        return ManifestRow(path, run, FAILED, reason, seconds=time.perf_counter() - start)
    status = INTERRUPTED if summary.interrupted else DONE
    return ManifestRow(path, run, status, "", summary.text(), time.perf_counter() - start, summary.frames)
