"""Stabilisation of run folders with a class file: new run folders and reports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from toolkit.app.pipeline.run_writer import CONFIG_FILE
from toolkit.app.stabilise.loop import Round, StabiliseSettings, best_round, stabilise
from toolkit.app.stabilise.result_page import write_page
from toolkit.app.stabilise.source_run import SourceRun, open_source
from toolkit.io.errors import RetrievalError, TrackError, UsageError
from toolkit.io.files import check_output, locked, save_json, save_text
from toolkit.io.progress import Progress, silent
from toolkit.io.yaml_reader import read_text
from toolkit.retrieval.annotation.annotation_report import REPORT_FILES, read_segments, write_report
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.classes import load_classes
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.priors.marks import load_marks
from toolkit.retrieval.templates import WILDCARD
from toolkit.tracks import RUN_FILE, TRACK_FILE
from toolkit.tracks.track import AGAIN

RESULT_FILE = "stabilise.json"


def stabilise_run(
    run: str | Path,
    classes: str | Path,
    output: str | Path,
    *,
    settings: StabiliseSettings | None = None,
    segments: str | Path | None = None,
    marks: str | Path | None = None,
    recording: str | Path | None = None,
    database: str | Path | None = None,
    progress: Progress = silent,
) -> list[Round]:
    """Stabilise a run and write a run folder with its report (`depthmocap stabilise`).

    Parameters
    ----------
    run : a finished run of one person, by the hybrid tracker
    classes : class file written by `depthmocap learn --templates`
    output : a run folder, with segments.csv and .json, annotation.png, stabilise.json and report.html
    settings : see `StabiliseSettings`
    segments : CSV of labelled stretches (start, end, label), in place of those that annotation finds
    marks : YAML of template entries, see `load_marks`; replaces those of the classes
    recording, database : where they have been moved to
    progress : told what is going on

    Returns
    -------
    The rounds; the written track is that of the best one.

    Raises
    ------
    TrackError
        The folder holds no finished run.
    RecordingError, DatabaseError
        The recording or the database is missing or has changed.
    RetrievalError
        The class file, the segments or the marks are invalid.
    UsageError
        The output is the run itself, or the run is one of several people or of another tracker.
    """
    settings, folder = settings or StabiliseSettings(), Path(output)
    for name in (TRACK_FILE, RUN_FILE, CONFIG_FILE, RESULT_FILE, *REPORT_FILES):
        check_output(folder / name, [Path(run) / TRACK_FILE, Path(run) / RUN_FILE, Path(run) / CONFIG_FILE, classes])
    wanted = load_classes(classes)
    source = open_source(run, recording=recording, database=database)
    labelled = None if segments is None else _segments(segments, source, wanted)
    marked = None if marks is None else load_marks(marks, wanted)
    with locked(folder):
        rounds = stabilise(source, wanted, settings, segments=labelled, marks=marked, progress=progress)
        _write(source, rounds, settings, folder)
    return rounds


def _segments(path: str | Path, source: SourceRun, classes: Sequence[MotionClass]) -> list[Segment]:
    """Return the labelled segments, which lie in the track without overlap.

    Raises
    ------
    RetrievalError
        A segment ends before it begins, ends after the track, overlaps another one or has an unknown label.
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
            raise RetrievalError(f"{what} overlaps the one that ends at {before.end:g} s; a frame has one label")
        if segment.label not in labels:
            raise RetrievalError(f"{what} has no known label; the classes are {', '.join(labels)}")
    return found


def _write(source: SourceRun, rounds: Sequence[Round], settings: StabiliseSettings, folder: Path) -> None:
    """Write the run folder; the track comes last, so that a folder with a track is complete."""
    folder.mkdir(parents=True, exist_ok=True)
    best = best_round(rounds)
    if best.annotation is not None:
        write_report(replace(best.annotation, segments=best.segments), folder)
    save_json(folder / RESULT_FILE, result_of(source, rounds, settings))
    write_page(source, rounds, best, folder)
    save_text(folder / CONFIG_FILE, read_text(source.run / CONFIG_FILE, TrackError, AGAIN, inside=True))
    source.info.save(folder)
    best.track.save(folder)


def result_of(source: SourceRun, rounds: Sequence[Round], settings: StabiliseSettings) -> dict[str, object]:
    """Return the content of `stabilise.json`: rounds, labels, gaps and the sources that filled them."""
    times = source.track.timestamps

    def gaps(found: Round) -> list[dict[str, object]]:
        return [
            {
                "limb": gap.limb, "start": float(times[gap.start]), "end": float(times[gap.stop - 1]),
                "hidden_frames": int(gap.hidden.sum()), "sources": gap.sources, "accepted": gap.accepted,
                "changed": gap.changed, "residual_before": gap.before, "residual_after": gap.after,
            }
            for gap in found.gaps
        ]  # fmt: skip

    return {
        "run": source.run.name,
        "settings": asdict(settings),
        "rounds": [
            {
                "segments": [asdict(s) for s in found.segments],
                "gaps": gaps(found),
                "moved": found.moved,
                "marked_frames": _marked(found),
                "distance_before": found.before,
                "distance_after": found.after,
            }
            for found in rounds
        ],
        "result": rounds.index(best_round(rounds)) + 1,
        "floor": source.floor._asdict(),
    }


def _marked(found: Round) -> dict[str, int]:
    """Return feature -> number of frames in which a template entry requires a value."""
    counts = (found.priors != WILDCARD).sum(axis=1)
    return {f"F{row + 1}": int(count) for row, count in enumerate(counts) if count}


def output_folders(runs: Sequence[Path], output: Path) -> dict[Path, Path]:
    """Return the folder of each run: `output` for one run, `output`/<name> for several.

    Raises
    ------
    UsageError
        Two runs have the same name.
    """
    if len(runs) == 1:
        return {runs[0]: output}
    names = [run.resolve().name for run in runs]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise UsageError(f"two runs are called {twice[0]!r}, so their results would collide; rename one")
    return {run: output / name for run, name in zip(runs, names, strict=True)}
