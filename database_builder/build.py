"""Build a pose database: read mocap, sample it, look at every selected pose, write one file (Baak 2013, 5.3.3)."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from database_builder.pool import PosePool
from database_builder.prior import learn_prior
from database_builder.processes import process_pool, usable_processors
from database_builder.reading import (
    CanonicalPoses,
    Source,
    find_sources,
    of_clip,
    read_source,
)
from database_builder.regressor import RegressorSettings, train_regressor
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.database.origin import View, observed_offsets
from toolkit.errors import MocapError, UsageError
from toolkit.files import check_output, free_folder, is_folder, locked, make_own_folder, remove_own_folder
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SEATED_MOTIONS, procedural_clips
from toolkit.progress import Progress

THRESHOLD = 0.009
"""Metres in the unit of Eq. 5.1, 4 cm root mean square per joint: half of the paper's 1.8 cm. Below it the curve of
`depthmocap bench threshold` is flat and only the lookup gets slower."""
SEATED_RATE = 10.0
"""Frames a second of the seated motions: people who sit move slowly."""
PARTS = RegressorSettings()
"""How the joint regressor is trained unless told otherwise."""
CHUNK = 500
"""Poses that a process looks at in one go, about a quarter of a second."""
MANY_FILES, MANY_POSES = 16, 4000
"""Below these a build in one process ends before others have started."""
RESIDUAL_POSES = 400
RESIDUAL_VIEWS = (
    View(yaw=np.radians(-45)), View(yaw=np.radians(-20)), View(yaw=np.radians(20)), View(yaw=np.radians(45)),
    View(distance=2.0), View(distance=4.0),
)  # fmt: skip


@dataclass(frozen=True)
class BuildReport:
    """What a build did.

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
        """A few lines for people."""
        lines = [
            f"{self.path}: {len(self.database)} of {self.poses_read} poses from {len(self.database.sources)} sources"
        ]
        lines += [f"skipped {name}: {reason}" for name, reason in self.skipped]
        lines.append("seconds: " + ", ".join(f"{stage} {value:.1f}" for stage, value in self.seconds.items()))
        return "\n".join(lines)


def build_database(
    sources: Sequence[str | Path | PoseClip] | None,
    output: str | Path,
    *,
    threshold: float = THRESHOLD,
    max_poses: int | None = None,
    body: Body | None = None,
    mirror: bool = True,
    seated: bool = True,
    parts: RegressorSettings | None = PARTS,
    workers: int | None = None,
    strict: bool = False,
    keep_work: bool = False,
    progress: Progress | None = None,
) -> BuildReport:
    """Build a pose database and write it as one file.

    Files that were read and what was trained are kept in a folder of its own beside `output` (`<stem>.work`, with a
    number behind it where that is somebody else's) until the database is written, so that a killed or failed build goes
    on where it was. The result does not depend on the number of processes. They are spawned, so a script that calls
    this needs the usual `if __name__ == "__main__":`.

    Parameters
    ----------
    sources : mocap files (BVH, AMC), folders of them, or clips of our body; None = the bundled motions
    output : the database file (`.npz`)
    threshold : sampling stops when no pose is farther than this from the selected ones, metres in the unit of Eq. 5.1
    max_poses : alternative stop; None = no limit
    body : whose poses, joints and features they become; None = the neutral adult
    mirror : add the mirror image of every pose, because a tracker meets left-handed people too
    seated : add the bundled motions of people who sit on chairs, stools, sofas, the floor and at desks, which mocap
        seldom holds
    parts : how to train the joint regressor; None = without one
    workers : processes; None = as many as there are processors
    strict : a file that cannot be used is an error; otherwise it is skipped and named in the report
    keep_work : keep the intermediate files, for another build from the same mocap
    progress : called as stages advance

    Raises
    ------
    MocapError
        A path is missing, a folder holds no motion file, no file can be used, or (with `strict`) one cannot.
    UsageError
        `threshold`, `max_poses`, `workers` or the suffix of `output` cannot work, or `output` would replace a source.
    OutputError
        `output` cannot be written.
    """
    target, body, report = _checked_target(output, sources, workers), body or load_body("neutral"), progress or _silent
    processes = usable_processors() if workers is None else workers
    work, clock = free_folder(target.with_name(f"{target.stem}.work")), _Clock()
    files, clips = _sources(sources, work, body)
    added = procedural_clips(SEATED_MOTIONS, SEATED_RATE, body=body, variations=2) if seated else []
    make_own_folder(work)
    with locked(work):
        pool = PosePool(threshold, max_poses)
        skipped = _collect(pool, _read(files, [*clips, *added], body, mirror, processes, report), strict)
        if len(skipped) == len(files) + len(clips):
            remove_own_folder(work)  # it holds nothing that another build could use
            raise MocapError(f"no file can be used; {skipped[0][0]}: {skipped[0][1]}; give BVH, ASF/AMC or AMASS")
        clock.record("read")

        report("sample", 0, 1)
        selected = pool.select()
        report("sample", 1, 1)
        clock.record("sample")

        poses, source, frame, mirrored = selected.rows.poses, *selected.rows[2:]
        offsets = _look(body, poses, processes, report)
        clock.record("look")

        forest = None
        if parts is not None:
            forest = train_regressor(poses, parts, workers=processes, kept=work, progress=partial(report, "train"))
            clock.record("train")
        prior = learn_prior(poses, body)
        clock.record("prior")
        notes = {
            "poses_read": pool.poses_read, "mirror": mirror, "seated": seated, "max_poses": max_poses,
            "skipped": [list(s) for s in skipped],
            "thinned": selected.thinned,
            "residual": residual(body, poses, offsets),
        }  # fmt: skip
        database = PoseDatabase.of_poses(
            poses, body, offsets=offsets, sources=pool.names, hashes=pool.digests, pose_source=source,
            pose_frame=frame, mirrored=mirrored, threshold=threshold, notes=notes, regressor=forest, prior=prior,
        )  # fmt: skip
        database.save(target)
        if not keep_work:
            remove_own_folder(work)
        clock.record("write")
    return BuildReport(target, database, pool.poses_read, tuple(skipped), clock.seconds)


def _checked_target(output: str | Path, sources: Sequence[str | Path | PoseClip] | None, workers: int | None) -> Path:
    """The file to write; an error where it cannot be one, would replace a source, or nobody would work on it."""
    target = Path(output)
    if target.suffix != ".npz" or is_folder(target):
        raise UsageError(f"a pose database is one .npz file, not {target}; choose a name such as poses.npz")
    if workers is not None and workers < 1:
        raise UsageError(f"a database cannot be built by {workers} processes; use at least 1")
    return check_output(target, [s for s in sources or () if not isinstance(s, PoseClip)])


def _sources(
    sources: Sequence[str | Path | PoseClip] | None, work: Path, body: Body
) -> tuple[list[Source], list[PoseClip]]:
    """Motion files and clips to read; the bundled motions where nothing is named."""
    given = list(procedural_clips(body=body) if sources is None else sources)
    clips = [s for s in given if isinstance(s, PoseClip)]
    files = find_sources([Path(s) for s in given if not isinstance(s, PoseClip)], work)
    if not files and not clips:
        raise UsageError("there is no source to build a pose database from; give a folder with mocap")
    return files, clips


def _collect(pool: PosePool, read: Iterator[CanonicalPoses], strict: bool) -> list[tuple[str, str]]:
    """Put the poses of all sources into the pool; name and reason of every one that could not be used."""
    skipped: list[tuple[str, str]] = []
    for one in read:
        if not one.error:
            pool.add(one)
        elif strict:
            raise MocapError(f"{one.name} cannot be used ({one.error}); leave it out, or build without --strict")
        else:
            skipped.append((one.name, one.error))
    return skipped


def residual(body: Body, poses: np.ndarray, offsets: np.ndarray) -> list[dict[str, float]]:
    """How far the centre and facing seen in other views lie from the stored ones, over up to 400 poses.

    Parameters
    ----------
    body, poses, offsets : canonical poses (N, P) and their stored offsets (N, 4)

    Returns
    -------
    one entry a view: its `yaw_degrees` and `distance` (metres); of the centre's distances the median and the 90th
    percentile (`centre_mm`, `centre_90_mm`) and the length of their mean vector (`bias_mm`); of the facing's
    differences the median and the 90th percentile (`facing_degrees`, `facing_90_degrees`)
    """
    rows = np.unique(np.linspace(0, len(poses) - 1, min(RESIDUAL_POSES, len(poses))).astype(np.int64))
    entries = []
    for view in RESIDUAL_VIEWS:
        difference = observed_offsets(body, poses[rows], view) - offsets[rows]
        apart = 1000 * np.linalg.norm(difference[:, :3], axis=1)
        turn = np.abs(np.angle(np.exp(1j * difference[:, 3]), deg=True))
        entries.append(
            {
                "yaw_degrees": float(np.degrees(view.yaw)),
                "distance": view.distance,
                "centre_mm": float(np.median(apart)),
                "centre_90_mm": float(np.quantile(apart, 0.9)),
                "bias_mm": float(1000 * np.linalg.norm(difference[:, :3].mean(axis=0))),
                "facing_degrees": float(np.median(turn)),
                "facing_90_degrees": float(np.quantile(turn, 0.9)),
            }
        )
    return entries


class _Clock:
    """Wall-clock seconds of the stages of a build."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def record(self, stage: str) -> None:
        """End of a stage."""
        now = time.perf_counter()
        self.seconds[stage], self._last = now - self._last, now


def _silent(stage: str, done: int, total: int) -> None:
    pass


def _read(
    files: Sequence[Source], clips: Sequence[PoseClip], body: Body, mirror: bool, processes: int, report: Progress
) -> Iterator[CanonicalPoses]:
    """Canonical poses of all files, then of all clips, one at a time."""
    done = 0
    with process_pool(processes if len(files) >= MANY_FILES else 1) as mapped:
        of_files = mapped(partial(read_source, body=body, mirror=mirror), files)
        for result in chain(of_files, (of_clip(clip, body, mirror) for clip in clips)):
            done += 1
            report("read", done, len(files) + len(clips))
            yield result


def _look(body: Body, poses: np.ndarray, processes: int, report: Progress) -> np.ndarray:
    """Offsets (N, 4) of the selected poses, a chunk of them at a time."""
    chunks = [poses[i : i + CHUNK] for i in range(0, len(poses), CHUNK)]
    offsets: list[np.ndarray] = []
    with process_pool(processes if len(poses) >= MANY_POSES else 1) as mapped:
        for part in mapped(partial(observed_offsets, body), chunks):
            offsets.append(part)
            report("look", len(offsets), len(chunks))
    return np.concatenate(offsets)
