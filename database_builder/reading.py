"""Mocap files to canonical poses of one body, in parallel processes, resumable file by file."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from toolkit import skeleton
from toolkit.archives import load_archive, save_archive
from toolkit.body.body import Body
from toolkit.database.canonical import canonicalise, mirrored
from toolkit.errors import DatabaseError, DepthMocapError
from toolkit.files import sha256_of
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget

READING_VERSION = 1
"""Raised whenever reading or retargeting changes what comes out, so that older intermediate files are not used."""
WAITING = 8
"""Results of each process that may wait to be taken."""


@dataclass(frozen=True)
class Source:
    """A mocap file to read: its name in reports, its path and the intermediate file that keeps what was read."""

    name: str
    path: Path
    kept: Path


@dataclass(frozen=True, eq=False)
class CanonicalPoses:
    """The poses of one source, as the sampling needs them.

    Attributes
    ----------
    name : of the source
    digest : SHA-256 of its file, or of the poses themselves
    poses : float32 (N, P), canonical; with mirroring the second half are the mirror images of the first
    joints : float32 (N, 20, 3), metres, the reported joints of these poses
    frames : number of frames of the source (N, or N / 2 with mirroring)
    error : why the source could not be used, then there are no poses; empty = it could
    """

    name: str
    digest: str
    poses: np.ndarray
    joints: np.ndarray
    frames: int
    error: str = ""


def find_sources(paths: Iterable[Path], work: Path) -> list[Source]:
    """All motion files in the given files and folders, each once, sorted by path; names are relative to what was given.

    Raises
    ------
    MocapError
        A path is missing or a folder holds no motion file.
    """
    found: dict[Path, str] = {}
    for root in paths:
        for file in find_clips(root):
            name = file.name if file == root else file.relative_to(root).as_posix()
            found.setdefault(file.resolve(), name)
    return [
        Source(name, path, work / f"{hashlib.sha256(str(path).encode()).hexdigest()[:16]}.npz")
        for path, name in sorted(found.items())
    ]


def of_clip(clip: PoseClip, body: Body, mirror: bool) -> CanonicalPoses:
    """Canonical poses of a clip that is already one of our body."""
    digest = hashlib.sha256(np.ascontiguousarray(clip.poses).tobytes()).hexdigest()
    return _canonical(clip.name, digest, clip.poses, body, mirror)


def read_source(source: Source, body: Body, mirror: bool) -> CanonicalPoses:
    """Canonical poses of a file: from the intermediate file if that fits, else read, retargeted and kept there.

    A file that cannot be used is reported in `error`, whatever is wrong with it, so that it cannot stop the others.
    """
    try:
        digest = _digest(source.path)
        key = _key(digest, body, mirror)
        if (known := _kept(source, digest, key)) is not None:
            return known
        result = _canonical(source.name, digest, retarget(read_clip(source.path), body).poses, body, mirror)
    except Exception as error:
        reason = f"{error}" if isinstance(error, DepthMocapError) else f"{type(error).__name__}: {error}"
        empty = np.zeros((0, skeleton.POSE_SIZE), np.float32), np.zeros((0, len(skeleton.REPORTED), 3), np.float32)
        return CanonicalPoses(source.name, "", *empty, 0, reason)
    arrays = {"key": key, "poses": result.poses, "joints": result.joints, "frames": result.frames}
    save_archive(source.kept, arrays, compressed=False)
    return result


def _canonical(name: str, digest: str, world_poses: np.ndarray, body: Body, mirror: bool) -> CanonicalPoses:
    poses = canonicalise(world_poses)[0]
    if mirror:
        poses = np.concatenate([poses, mirrored(poses)])
    stored = poses.astype(np.float32)
    joints = body.joint_positions(stored).astype(np.float32)
    return CanonicalPoses(name, digest, stored, joints, len(world_poses))


def _digest(path: Path) -> str:
    """SHA-256 of a motion file; for AMC of the skeletons beside it too, because they give it its meaning."""
    digest = sha256_of(path)
    if path.suffix.lower() != ".amc":
        return digest
    skeletons = sorted(p for p in path.parent.iterdir() if p.suffix.lower() == ".asf")
    return hashlib.sha256("".join([digest, *map(sha256_of, skeletons)]).encode()).hexdigest()


def _key(digest: str, body: Body, mirror: bool) -> str:
    """Names everything that the canonical poses of a file depend on."""
    parts = (digest, READING_VERSION, skeleton.fingerprint(), mirror, body.joints.tobytes(), body.sites.tobytes())
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _kept(source: Source, digest: str, key: str) -> CanonicalPoses | None:
    try:
        data = load_archive(source.kept, DatabaseError, "it is made again")
        if str(data["key"]) != key:
            return None
        return CanonicalPoses(source.name, digest, data["poses"], data["joints"], int(data["frames"]))
    except Exception:  # missing or half-read: whatever is wrong with it, the file is read again
        return None


@contextmanager
def process_pool(workers: int) -> Iterator[Callable[..., Iterator[Any]]]:
    """Yield a `map` in order over `workers` processes, or the built-in one for a single worker.

    They are joblib's, so that inside `joblib.parallel_config(backend="dask")` a cluster takes their place. No more than
    `WAITING` results for each of them wait to be taken, so that memory does not grow with the number of items.

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
        rest = iter(items)
        while some := list(islice(rest, WAITING * workers)):
            yield from parallel(joblib.delayed(function)(item) for item in some)

    own = isinstance(around, joblib.parallel.LokyBackend)
    try:
        with joblib.parallel_config("loky", inner_max_num_threads=1) if own else nullcontext():
            with joblib.Parallel(n_jobs=workers, return_as="generator") as parallel:
                yield mapped
    except TerminatedWorkerError as error:
        raise DatabaseError(
            "a process of the build was killed, by lack of memory perhaps; use fewer workers"
        ) from error


def usable_processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
