"""Many recordings, one after the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.errors import DepthMocapError, RecordingError, UsageError
from toolkit.files import check_output
from toolkit.pipeline.joints import JointChoice
from toolkit.pipeline.run import RUN_FILES, track_recording
from toolkit.pipeline.summary import BatchReport
from toolkit.pipeline.trackers import TrackerRecipe
from toolkit.progress import RecordingProgress, silent
from toolkit.recordings.opening import open_recording, open_upright
from toolkit.recordings.options import ReaderOptions
from toolkit.tracking.protocol import Tracker

if TYPE_CHECKING:
    from toolkit.pipeline.events import EventStream


def track_recordings(
    paths: Sequence[str | Path],
    tracker: Tracker,
    output: str | Path,
    *,
    people: int | None = 1,
    reader_options: dict[str, Any] | None = None,
    resume: bool = False,
    progress: RecordingProgress = silent,
    watcher: EventStream | None = None,
    joints: JointChoice | None = None,
    made_of: TrackerRecipe | None = None,
) -> BatchReport:
    """Track one recording into `output`, or several into `output/<stem>`.

    One of several that fails is reported and the others go on. Ctrl-C finishes the track of the current one and stops.
    No run folder may replace what the tracker is `made_of`, by default its database.

    Raises
    ------
    UsageError
        There is no recording, two have the same stem, a reader option is unknown, or a run folder would damage a
        recording, the database or another input; nothing has been done then.
    DepthMocapError
        As `track_recording`, where there is only one.
    """
    runs = run_folders(paths, output)
    ReaderOptions.from_mapping(reader_options or {})
    needed = (made_of or TrackerRecipe(database=tracker.database)).files()
    for path, run in runs.items():
        check_output(run, [path], sealed=[path])
        for name in RUN_FILES:
            check_output(run / name, needed)
    report = BatchReport()
    for path, run in runs.items():
        try:
            recording = open_upright(path, **(reader_options or {}))
            first = not report.done
            summary = track_recording(
                recording, tracker, run, people=people, resume=resume, warm_up=first, progress=progress,
                watcher=watcher, joints=joints, made_of=made_of,
            )  # fmt: skip
        except DepthMocapError as error:
            if len(runs) == 1:
                raise
            report.failed[path] = str(error)
            continue
        report.done.append(summary)
        if summary.interrupted:
            break
    return report


def unreadable(paths: Sequence[str | Path], reader_options: Mapping[str, Any] | None = None) -> dict[Path, str]:
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
            recording = open_recording(path, **(reader_options or {}))
            next(iter(recording.stream()), None)
        except RecordingError as error:
            failed[path], first = str(error), first or error
    if first is not None and len(failed) == len(set(map(Path, paths))):
        if len(failed) == 1:
            raise first
        raise RecordingError(f"none of the {len(failed)} recordings can be read; the first: {first}")
    return failed


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
