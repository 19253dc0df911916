"""What is handed over as a folder, as a zip of its files: finished runs, unfinished ones, all that a tracker reads."""

from __future__ import annotations

import shutil
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.fake_tracker import write_recording
from tests.fuzz_files import Make, body_file, database_file
from tests.fuzzing import zipped
from tests.run_helpers import write_run
from toolkit.app.pipeline import TrackerRecipe, second, track_recording
from toolkit.app.pipeline import run as pipeline
from toolkit.body import skeleton
from toolkit.output.export.run import export_run
from toolkit.output.report.page import write_report
from toolkit.recordings.opening import open_upright
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import Track

RUN = "run.zip"


class Killed(BaseException):
    """In place of a signal."""


def _pack(folder: Path, path: Path) -> Path:
    files = sorted(p for p in folder.rglob("*") if p.is_file() and not p.name.startswith("."))
    path.write_bytes(zipped({str(p.relative_to(folder)): p.read_bytes() for p in files}))
    return path


def _unpack(path: Path) -> Path:
    folder = path.with_name("unpacked")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.unpack_archive(path, folder, "zip")
    return folder


@cache
def _tracker(folder: Path) -> Tracker:
    return TrackerRecipe("hybrid", {}, database=folder / "poses.npz", body=folder / "me.npz").build()


def _track(recording: Path, tracker: Tracker, run: Path, stop: int = -1) -> None:
    """Track into a run folder, as a process does that is killed after so many of its reports."""
    reports = iter(range(1000))

    def report(*_: Any) -> None:
        if next(reports) == stop:
            raise Killed

    memory = pipeline.MEMORY_SECONDS, second.MEMORY_SECONDS
    pipeline.MEMORY_SECONDS = second.MEMORY_SECONDS = -1.0  # a state after every frame
    try:
        track_recording(open_upright(recording), tracker, run, resume=True, warm_up=False, progress=report)
    except Killed:
        pass
    finally:
        pipeline.MEMORY_SECONDS, second.MEMORY_SECONDS = memory


def stopped_run(reports: int) -> Make:
    """A run of the default tracker over five frames that was killed after so many reports: 6 are of its first pass."""

    def make(folder: Path) -> Path:
        write_recording(folder / "take.npz", 5)
        database_file(folder)
        body_file(folder)
        _track(folder / "take.npz", _tracker(folder), folder / "run", reports)
        return _pack(folder / "run", folder / RUN)

    return make


def resumed(path: Path) -> Any:
    """The track of a run that is gone on with."""
    run = _unpack(path)
    _track(path.with_name("take.npz"), _tracker(path.parent), run)
    track = Track.load(run)
    return track.pose, track.joints, track.state


def all_read(folder: Path) -> Path:
    """A recording, a database and a body."""
    parts = folder / "parts"
    parts.mkdir()
    write_recording(parts / "take.npz", 2)
    database_file(parts)
    body_file(parts)
    return _pack(parts, folder / "parts.zip")


def tracked(path: Path) -> Any:
    """The track of a recording by a tracker with a database and a body."""
    parts = _unpack(path)
    _track(parts / "take.npz", _tracker.__wrapped__(parts), parts / "run")
    track = Track.load(parts / "run")
    return track.pose, track.joints, track.state


def finished_run(folder: Path) -> Path:
    """A run folder."""
    run = write_run(folder / "run", np.zeros((3, skeleton.POSE_SIZE)))
    return _pack(run, folder / RUN)


def shown(path: Path) -> Any:
    """What becomes of a run in a page and in files of other programs."""
    run = _unpack(path)
    written = [write_report([run], path.with_name("page.html"))]
    for suffix in (".csv", ".bvh"):
        written += export_run(run, path.with_name(f"motion{suffix}"))
    return [p.read_bytes() for p in written]
