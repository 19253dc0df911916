"""Stabilisation from files to files: run folders and a class file in, run folders out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from toolkit.app.pipeline.run_writer import CONFIG_FILE
from toolkit.app.stabilise.source_run import SourceRun, open_source
from toolkit.app.stabilise.stabiliser import ALIGNMENT_THRESHOLD, Stabilised, stabilise
from toolkit.io.errors import RetrievalError, TrackError, UsageError
from toolkit.io.files import check_output, locked, save_json, save_text
from toolkit.io.progress import Progress, silent
from toolkit.io.yaml_reader import read_text
from toolkit.retrieval.annotation.annotation_report import REPORT_FILES, read_segments, write_report
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.classes import load_classes
from toolkit.retrieval.annotation.measures import Segment
from toolkit.tracks import RUN_FILE, TRACK_FILE
from toolkit.tracks.track import AGAIN

RESULT_FILE = "stabilise.json"


def stabilise_run(
    run: str | Path,
    classes: str | Path,
    output: str | Path,
    *,
    threshold: float = ALIGNMENT_THRESHOLD,
    segments: str | Path | None = None,
    recording: str | Path | None = None,
    database: str | Path | None = None,
    progress: Progress = silent,
) -> Stabilised:
    """Stabilise a run and write a run folder (`depthmocap stabilise`).

    Parameters
    ----------
    run : finished run of one person by the hybrid tracker
    classes : class file of `depthmocap learn --templates`
    output : run folder to write, with stabilise.json and, without `segments`, the report of the annotation
    threshold : see `stabilise`
    segments : CSV of labelled segments (start, end, label), in place of an annotation of the track
    recording, database : new paths, if they were moved
    progress : callback for the number of frames done

    Raises
    ------
    TrackError
        There is no finished run.
    RecordingError, DatabaseError
        The recording or the database is missing or has changed.
    RetrievalError
        The class file or the segments are invalid.
    UsageError
        The output is the run itself, or the run has several people or another tracker.
    """
    folder = Path(output)
    for name in (TRACK_FILE, RUN_FILE, CONFIG_FILE, RESULT_FILE, *REPORT_FILES):
        check_output(folder / name, [Path(run) / TRACK_FILE, Path(run) / RUN_FILE, Path(run) / CONFIG_FILE, classes])
    wanted = load_classes(classes)
    source = open_source(run, recording=recording, database=database)
    labelled = None if segments is None else _segments(segments, source, wanted)
    with locked(folder):
        result = stabilise(source, wanted, threshold, segments=labelled, progress=progress)
        _write(source, result, threshold, folder)
    return result


def _segments(path: str | Path, source: SourceRun, classes: Sequence[MotionClass]) -> list[Segment]:
    """Return the labelled segments of a file, sorted by start.

    Raises
    ------
    RetrievalError
        A segment is empty, ends after the track, overlaps another one, or has a label of no class.
    """
    found = sorted(read_segments(path), key=lambda s: s.start)
    last = float(source.track.timestamps[-1] - source.track.timestamps[0]) if len(source.track) else 0.0
    labels = [c.label for c in classes]
    for before, segment in zip([None, *found], found, strict=False):
        what = f"segment {segment.label!r} of {path} from {segment.start:g} to {segment.end:g} s"
        if not 0.0 <= segment.start < segment.end:
            raise RetrievalError(f"{what} has no length; correct it")
        if segment.end > last + 0.5:
            raise RetrievalError(f"{what} ends after the track, which has {last:.2f} s; correct it")
        if before is not None and segment.start < before.end - 1e-6:
            raise RetrievalError(f"{what} overlaps the one that ends at {before.end:g} s; give each frame one label")
        if segment.label not in labels:
            raise RetrievalError(f"{what} has an unknown label; the classes are {', '.join(labels)}")
    return found


def _write(source: SourceRun, result: Stabilised, threshold: float, folder: Path) -> None:
    """Write the run folder; the track is written last, so that a folder with a track is complete."""
    folder.mkdir(parents=True, exist_ok=True)
    if result.annotation is not None:
        write_report(result.annotation, folder)
    save_json(folder / RESULT_FILE, summary_of(source, result, threshold))
    save_text(folder / CONFIG_FILE, read_text(source.run / CONFIG_FILE, TrackError, AGAIN, inside=True))
    source.info.save(folder)
    result.track.save(folder)


def summary_of(source: SourceRun, result: Stabilised, threshold: float) -> dict[str, object]:
    """Return the content of `stabilise.json`: threshold, segments, gaps and distances."""
    times = source.track.timestamps
    gaps = [
        {
            "limb": gap.limb, "start": float(times[gap.start]), "end": float(times[gap.stop - 1]),
            "hidden_frames": int(gap.hidden.sum()), "sources": gap.sources, "accepted": gap.accepted,
            "changed": gap.changed, "residual_before": gap.before, "residual_after": gap.after,
        }
        for gap in result.gaps
    ]  # fmt: skip
    return {
        "run": source.run.name,
        "threshold": threshold,
        "segments": [asdict(s) for s in result.segments],
        "gaps": gaps,
        "moved": result.moved,
        "contact_frames": result.contact_frames,
        "distance_before": result.before,
        "distance_after": result.after,
        "floor": source.floor._asdict(),
    }


def output_folders(runs: Sequence[Path], output: Path) -> dict[Path, Path]:
    """Return the output folder of each run: `output` for one run, `output`/<name> for several.

    Raises
    ------
    UsageError
        Two runs have the same name.
    """
    if len(runs) == 1:
        return {runs[0]: output}
    names = [run.resolve().name for run in runs]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise UsageError(f"two runs are called {twice[0]!r}, and so would be their results; rename one")
    return {run: output / name for run, name in zip(runs, names, strict=True)}
