"""Annotation of motion files and run folders, with one report folder per motion."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from toolkit.io.archives import archive_names
from toolkit.io.errors import RetrievalError, UsageError
from toolkit.io.files import check_output
from toolkit.io.progress import Progress, silent
from toolkit.retrieval.annotation.annotation_report import REPORT_FILES, read_segments, write_report
from toolkit.retrieval.annotation.annotator import AS_PUBLISHED, HIT_THRESHOLD, Annotation, Annotator, MotionClass
from toolkit.retrieval.annotation.classes import load_classes
from toolkit.retrieval.annotation.measures import Scores
from toolkit.retrieval.annotation.model import RELEARN, MotionModel
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.search.find import preselect
from toolkit.retrieval.workflow.motions import find_motions, load_motion


@dataclass(frozen=True, eq=False)
class AnnotatedFile:
    """Annotated motion: its annotation, its report folder, and its scores if the truth is known."""

    annotation: Annotation
    folder: Path
    scores: dict[str, Scores]


def annotate_motions(
    sources: Sequence[str | Path],
    classes: Sequence[MotionClass] | MotionModel,
    output: str | Path,
    *,
    queries: Sequence[KeyframeQuery] = (),
    truth: str | Path | None = None,
    threshold: float | None = None,
    as_published: bool = False,
    progress: Progress = silent,
) -> list[AnnotatedFile]:
    """Label motions and write a report for each: one motion to `output` itself, several to `output`/<stem>.

    Parameters
    ----------
    sources : motion files, run folders, folders of motion files
    classes : motion model or template classes of the thesis
    output : output folder
    queries : learned keyframe queries that restrict the search of template classes
    truth : CSV with true segments (start, end, label); for several motions a folder with <stem>.csv
    threshold : largest cost of a template, in place of the classes' own
    as_published : apply the rules of the thesis to template classes (`AS_PUBLISHED`), with the threshold of its 5.4
        unless one is given
    progress : callback for the number of motions done

    Raises
    ------
    UsageError
        Two motions have the same stem, several motions have one file of true segments, or a report would overwrite an
        input.
    RetrievalError
        A motion is too short, or the true segments do not fit.
    """
    files = find_motions(sources)
    _check_stems(files)
    truths = _truth_files(files, truth)
    folders = {file: Path(output) if len(files) == 1 else Path(output) / file.stem for file in files}
    for folder in folders.values():
        for name in REPORT_FILES:
            check_output(folder / name, [*files, *truths.values()])
    annotate = _annotating(classes, queries, threshold, as_published)
    done = []
    for number, file in enumerate(files, start=1):
        features = relational_features(load_motion(file))
        annotation = annotate(features)
        true = read_segments(truths[file]) if file in truths else None
        done.append(AnnotatedFile(annotation, folders[file], write_report(annotation, folders[file], true)))
        progress("annotating", number, len(files))
    return done


def _annotating(
    classes: Sequence[MotionClass] | MotionModel,
    queries: Sequence[KeyframeQuery],
    threshold: float | None,
    as_published: bool,
) -> Callable[[FeatureMatrix], Annotation]:
    if isinstance(classes, MotionModel):
        if queries or threshold is not None or as_published:
            raise UsageError(
                "--queries, --threshold and --as-published belong to motion templates, not to a motion model; learn "
                "classes with `depthmocap learn --templates`"
            )
        return classes.annotate
    if as_published and threshold is None:
        threshold = HIT_THRESHOLD
    if threshold is not None:
        classes = [replace(motion_class, threshold=threshold) for motion_class in classes]
    annotator = Annotator(classes, AS_PUBLISHED) if as_published else Annotator(classes)

    def annotate(features: FeatureMatrix) -> Annotation:
        if not queries:
            return annotator.annotate(features)
        return annotator.annotate(features, preselect(KeyframeIndex.build([features]), queries, annotator.labels)[0])

    return annotate


def load_wanted(path: str | Path) -> list[MotionClass] | MotionModel:
    """Return the motion model or the template classes of a file."""
    names = archive_names(path, RetrievalError, RELEARN)
    return MotionModel.load(path) if "columns" in names else load_classes(path)


def _check_stems(files: Sequence[Path]) -> None:
    twice = [stem for stem, count in Counter(file.stem for file in files).items() if count > 1]
    if twice:
        raise UsageError(f"two motions are called {twice[0]!r}, and so would be their reports; rename one")


def _truth_files(files: Sequence[Path], truth: str | Path | None) -> dict[Path, Path]:
    if truth is None:
        return {}
    path = Path(truth)
    if path.is_dir():
        found = {file: path / f"{file.stem}.csv" for file in files if (path / f"{file.stem}.csv").is_file()}
        if not found:
            raise RetrievalError(f"{path} holds no true segments for {files[0].stem}; name them {files[0].stem}.csv")
        return found
    if len(files) > 1:
        raise UsageError(f"one file of true segments, {path.name}, cannot serve {len(files)} motions; give a folder")
    return {files[0]: path}
