"""Build a pose database: read mocap, sample it, observe every selected pose, write one file (Baak 2013, 5.3.3)."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from database_builder.prior import learn_prior
from database_builder.reading import MocapFile, find_sources, of_clip, read_source
from database_builder.sampling import PosePool
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.database.origin import observed_offsets
from toolkit.io.errors import DatabaseError, MocapError, PlausibilityWarning, UsageError
from toolkit.io.files import check_output, is_folder
from toolkit.io.progress import Progress, silent
from toolkit.io.workers import task_of, usable_processors
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SEATED_MOTIONS, procedural_clips

SAMPLING_THRESHOLD = 0.009
"""Metres in the unit of Eq. 5.1, 4 cm root mean square per joint: half of the paper's 1.8 cm. Below it the
error stays the same and only the lookup gets slower."""
MANY_FILES, MANY_POSES = 16, 4000
"""Below these a build in one process ends before others have started."""


@dataclass(frozen=True)
class Sampling:
    """Selection of the poses of a database.

    Attributes
    ----------
    threshold : sampling stops when no pose is farther than this from the selected ones, metres in the unit of Eq. 5.1
    max_poses : alternative stop; None = no limit
    mirror : add the mirror image of every pose, because a tracker meets left-handed people too
    seated : add the bundled motions of people who sit on chairs, stools, sofas, the floor and at desks, which mocap
        seldom holds
    """

    threshold: float = SAMPLING_THRESHOLD
    max_poses: int | None = None
    mirror: bool = True
    seated: bool = True


SAMPLING = Sampling()


@dataclass(frozen=True)
class BuildReport:
    """Result of a build.

    Attributes
    ----------
    path : the database file
    database : its content
    poses_read : poses that the sampling chose from, mirror images included
    skipped : name and reason of every file that could not be used
    seconds : wall-clock time of each stage
    """

    path: Path
    database: PoseDatabase
    poses_read: int
    skipped: tuple[tuple[str, str], ...]
    seconds: dict[str, float]

    def text(self) -> str:
        """Return the summary that the command prints."""
        lines = [
            f"{self.path}: {len(self.database)} of {self.poses_read} poses from {len(self.database.sources)} sources"
        ]
        lines += [f"skipped {name}: {reason}" for name, reason in self.skipped]
        if self.skipped:
            given = len(self.skipped) + len(self.database.sources)
            lines.append(f"{len(self.skipped)} of {given} sources skipped; --strict makes that an error")
        lines.append("seconds: " + ", ".join(f"{stage} {value:.1f}" for stage, value in self.seconds.items()))
        return "\n".join(lines)


def build_database(
    sources: Sequence[str | Path | PoseClip] | None,
    output: str | Path,
    sampling: Sampling = SAMPLING,
    *,
    body: Body | None = None,
    workers: int | None = None,
    strict: bool = False,
    progress: Progress = silent,
) -> BuildReport:
    """Build a pose database and write it as one file.

    The result does not depend on the number of processes. They are spawned, so a script that calls this needs the usual
    `if __name__ == "__main__":`.

    Parameters
    ----------
    sources : mocap files (BVH, AMC, AMASS), folders of them, or clips of our body; None = the bundled motions
    output : the database file (`.npz`)
    sampling : selection of the poses
    body : body of the poses, joints and features; None = the neutral adult
    workers : processes; None = as many as there are processors
    strict : a file that cannot be used is an error; otherwise it is skipped and named in the report
    progress : called as stages advance

    Raises
    ------
    MocapError
        A path is missing, a folder holds no motion file, no file can be used, or (with `strict`) one cannot.
    UsageError
        A threshold, a maximum, `workers` or the suffix of `output` cannot work, or `output` would replace a source.
    OutputError
        `output` cannot be written.
    """
    target, body = _checked_target(output, sources, workers), body or load_body("neutral")
    files, clips = _sources(sources, body)
    build = _Build(body, sampling, usable_processors() if workers is None else workers, progress)
    pool, skipped = build.read(files, clips, strict)
    if len(skipped) == len(files) + len(clips):
        raise MocapError(f"no file can be used; {skipped[0][0]}: {skipped[0][1]}; give BVH, ASF/AMC or AMASS")
    database = build.database(pool, skipped)
    database.save(target)
    build.end("write")
    return BuildReport(target, database, pool.poses_read, tuple(skipped), build.seconds)


class _Build:
    """Stages of a build: reports their progress and keeps their duration in seconds of wall clock."""

    def __init__(self, body: Body, sampling: Sampling, processes: int, report: Progress) -> None:
        self.body, self.sampling, self.processes, self.report = body, sampling, processes, report
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def end(self, stage: str) -> None:
        """End a stage."""
        now = time.perf_counter()
        self.seconds[stage], self._last = now - self._last, now

    def read(
        self, files: Sequence[MocapFile], clips: Sequence[PoseClip], strict: bool
    ) -> tuple[PosePool, list[tuple[str, str]]]:
        """Return the poses of all sources, one at a time; name and reason of every source that could not be used."""
        pool, skipped = PosePool(self.sampling.threshold, self.sampling.max_poses), list[tuple[str, str]]()
        doubts: list[str] = []
        added = []
        if self.sampling.seated:
            seated_rate = 10.0  # frames a second: people who sit move slowly
            added = procedural_clips(SEATED_MOTIONS, seated_rate, body=self.body, variations=2)
        total = len(files) + len(clips) + len(added)
        with process_pool(self.processes if len(files) >= MANY_FILES else 1) as mapped:
            of_files = mapped(partial(read_source, body=self.body, mirror=self.sampling.mirror), files)
            of_clips = (of_clip(clip, self.body, self.sampling.mirror) for clip in (*clips, *added))
            for done, one in enumerate(chain(of_files, of_clips), start=1):
                self.report("read", done, total)
                doubts += one.doubts
                if not one.error:
                    pool.add(one)
                elif strict:
                    raise MocapError(
                        f"{one.name} cannot be used ({one.error}); leave it out, or build without --strict"
                    )
                else:
                    skipped.append((one.name, one.error))
        self.end("read")
        if doubts:
            others = f" (other warnings about sources: {len(doubts) - 1})" if len(doubts) > 1 else ""
            warnings.warn(PlausibilityWarning(doubts[0] + others), stacklevel=2)
        return pool, skipped

    def database(self, pool: PosePool, skipped: Sequence[tuple[str, str]]) -> PoseDatabase:
        """Return the selected poses with their observed offsets and their prior."""
        self.report("sample", 0, 1)
        selected, thinned = pool.select()
        poses = selected.poses
        self.report("sample", 1, 1)
        self.end("sample")
        offsets = self.observe(poses)
        self.end("observe")
        prior = learn_prior(poses, self.body)
        self.end("prior")
        chosen = self.sampling
        notes = {
            "poses_read": pool.poses_read, "mirror": chosen.mirror, "seated": chosen.seated,
            "max_poses": chosen.max_poses, "skipped": [list(s) for s in skipped], "thinned": thinned,
        }  # fmt: skip
        return PoseDatabase.of_poses(
            poses, self.body, pool.origins(selected), offsets=offsets, threshold=chosen.threshold, notes=notes,
            prior=prior,
        )  # fmt: skip

    def observe(self, poses: np.ndarray) -> np.ndarray:
        """Return offsets (N, 4) of the selected poses, a chunk of them at a time."""
        chunk = 500  # poses that a process receives at once, about a quarter of a second
        chunks = [poses[i : i + chunk] for i in range(0, len(poses), chunk)]
        offsets: list[np.ndarray] = []
        with process_pool(self.processes if len(poses) >= MANY_POSES else 1) as mapped:
            for part in mapped(partial(observed_offsets, self.body), chunks):
                offsets.append(part)
                self.report("observe", len(offsets), len(chunks))
        return np.concatenate(offsets)


def _checked_target(output: str | Path, sources: Sequence[str | Path | PoseClip] | None, workers: int | None) -> Path:
    """Return the file to write; raises where it cannot be one, would replace a source, or there are no processes."""
    target = Path(output)
    if target.suffix != ".npz" or is_folder(target):
        raise UsageError(f"a pose database is one .npz file, not {target}; choose a name such as poses.npz")
    if workers is not None and workers < 1:
        raise UsageError(f"a database cannot be built by {workers} processes; use at least 1")
    return check_output(target, [s for s in sources or () if not isinstance(s, PoseClip)])


def _sources(sources: Sequence[str | Path | PoseClip] | None, body: Body) -> tuple[list[MocapFile], list[PoseClip]]:
    """Return the motion files and clips to read; the bundled motions if no source is given."""
    given = list(procedural_clips(body=body) if sources is None else sources)
    clips = [s for s in given if isinstance(s, PoseClip)]
    files = find_sources([Path(s) for s in given if not isinstance(s, PoseClip)])
    if not files and not clips:
        raise UsageError("there is no source to build a pose database from; give a folder with mocap")
    return files, clips


@contextmanager
def process_pool(workers: int) -> Iterator[Callable[..., Iterator[Any]]]:
    """Yield a `map` in order over `workers` processes, or the built-in one for a single worker.

    The pool is joblib's, so that inside `joblib.parallel_config(backend="dask")` a cluster replaces it. At most
    8 results per process are buffered, so that memory does not grow with the number of items.

    Raises
    ------
    DatabaseError
        A process was killed.
    """
    import joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    around = joblib.parallel.get_active_backend()[0]
    if workers <= 1 and isinstance(around, joblib.parallel.LokyBackend):
        yield map
        return

    def mapped(function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
        rest, waiting = iter(items), 8  # unread results per process
        while some := list(islice(rest, waiting * workers)):
            yield from parallel(joblib.delayed(task_of(function))(item) for item in some)

    own = isinstance(around, joblib.parallel.LokyBackend)
    try:
        with joblib.parallel_config("loky", inner_max_num_threads=1) if own else nullcontext():
            with joblib.Parallel(n_jobs=workers, return_as="generator") as parallel:
                yield mapped
    except TerminatedWorkerError as error:
        raise DatabaseError(
            "a process of the build was killed, perhaps by lack of memory; use fewer workers"
        ) from error
