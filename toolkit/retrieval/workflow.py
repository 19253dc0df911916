"""From files to files: motions into an index, clips into learned queries, queries into results."""

from __future__ import annotations

import csv
import io
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from toolkit.errors import RetrievalError, UsageError
from toolkit.files import save_json, save_text
from toolkit.mocap.read import find_clips, read_clip
from toolkit.retrieval.annotation import distance_function
from toolkit.retrieval.automatic import ChoiceSettings, choose_query, steady_entries, template_of
from toolkit.retrieval.features import FEATURE_RATE, FEATURES, FeatureMatrix, relational_features
from toolkit.retrieval.index import KeyframeIndex
from toolkit.retrieval.keyframes import KeyframeQuery, keyframes_of_column
from toolkit.retrieval.learning import LearnedQuery, LearningSettings, Progress, learn, training_clips
from toolkit.retrieval.motion import Motion, from_clip, from_track
from toolkit.retrieval.query_file import save_queries
from toolkit.retrieval.search import HitRanges, Match, find, pieces, rank
from toolkit.retrieval.templates import WILDCARD, QuantisedTemplate
from toolkit.track import RunInfo, Track

EXAMPLE_CHOICE = ChoiceSettings(least_score=0.3, most=1, steady=9)
"""Keyframes from a single example: entries steady for 0.3 s on both sides, one keyframe per set."""
EXAMPLE_STEADY = 3
"""Columns on both sides over which an entry of an example has to be steady to count in the refined search."""
SHORTEST_EXAMPLE = 0.3
"""Seconds."""


def find_motions(paths: Sequence[str | Path]) -> list[Path]:
    """Motion files, run folders, and all motion files below other folders, in the order given."""
    found: list[Path] = []
    for path in map(Path, paths):
        found.extend([path] if (path / "track.npz").is_file() else find_clips(path))
    return found


def load_motion(path: str | Path) -> Motion:
    """The motion of a clip file or of a run folder, named by its stem."""
    path = Path(path)
    if path.is_dir():
        return from_track(Track.load(path), RunInfo.load(path).body(), path.name)
    return from_clip(read_clip(path))


def index_motions(
    paths: Sequence[str | Path],
    output: str | Path,
    *,
    add: bool = False,
    progress: Callable[[str, int, int], None] | None = None,
) -> KeyframeIndex:
    """Index motions and write the index, whole or not at all.

    Parameters
    ----------
    paths : clips, run folders, folders of clips
    output : the index file
    add : add to the index that `output` is, instead of writing a new one
    progress : told what is done, how many motions are read, and how many there are

    Raises
    ------
    RetrievalError
        Two motions of one name, or an index to add to that does not fit.
    """
    before = KeyframeIndex.open(output) if add else None
    files = find_motions(paths)
    documents = []
    for number, file in enumerate(files, start=1):
        documents.append(relational_features(load_motion(file)))
        if progress is not None:
            progress("features", number, len(files))
    index = KeyframeIndex.build(documents) if before is None else before.added(documents)
    index.save(output)
    return index


@dataclass(frozen=True, eq=False)
class Query:
    """A keyframe query, and the template of the refined search if there is one."""

    keyframes: KeyframeQuery
    template: QuantisedTemplate | None = None


def query_by_example(
    clip: str | Path, start: float, end: float | None, choice: ChoiceSettings = EXAMPLE_CHOICE
) -> Query:
    """A query from a stretch of a clip, `start` to `end` in seconds; None is the clip's end.

    Raises
    ------
    UsageError
        The stretch lies outside the clip.
    RetrievalError
        The stretch is too short, or nothing in it is characteristic.
    """
    features = relational_features(load_motion(clip))
    end = features.duration if end is None else end
    if not 0.0 <= start < end or end > features.duration + 0.5 / FEATURE_RATE:
        raise UsageError(
            f"{start:g} to {end:g} s is no stretch of {features.name!r}, which lasts {features.duration:.2f} s; "
            "give a start and a later end inside it"
        )
    if end - start < SHORTEST_EXAMPLE:
        raise RetrievalError(
            f"the example of {end - start:.2f} s is too short for keyframes; give at least {SHORTEST_EXAMPLE} s"
        )
    example = features.sliced(round(start * FEATURE_RATE), round(end * FEATURE_RATE))
    template = template_of(example)
    refined = QuantisedTemplate(template.name, steady_entries(template.values, EXAMPLE_STEADY), template.weights)
    return Query(choose_query(template, choice, label=example.name), refined)


@dataclass(frozen=True, eq=False)
class SearchReport:
    """What a query found.

    Attributes
    ----------
    label : of the query
    ranges : hit ranges of the keyframe search
    matches : the results: alignments of the refined search, cheapest first, or the hit ranges at cost 0
    share : part of all frames left after the keyframe search
    searched : part of all frames left for the refined search, after extension
    milliseconds : time of the keyframe search
    refined_milliseconds : time of the refined search, 0 without one
    """

    label: str
    ranges: HitRanges
    matches: tuple[Match, ...]
    share: float
    searched: float
    milliseconds: float
    refined_milliseconds: float


def search(index: KeyframeIndex, query: Query, threshold: float = np.inf) -> SearchReport:
    """Keyframe search, then the refined search on the extended hits if the query has a template.

    Parameters
    ----------
    index : what to search
    query : keyframes and perhaps a template
    threshold : results of the refined search have to cost less, in mean share of mismatching features

    Raises
    ------
    RetrievalError
        No document of the index is long enough for the template.
    """
    template = query.template
    longest = int(np.diff(index.document_starts).max())
    if template is not None and longest < (need := 1 + len(template) // 2):
        raise RetrievalError(
            f"the longest document of the index has {longest} frames at 30 Hz, but {template.name!r} needs {need}; "
            "use a shorter example"
        )
    _load_search()
    begin = time.perf_counter()
    ranges = find(index, query.keyframes)
    middle = time.perf_counter()
    searched = pieces(index, query.keyframes, ranges)
    if template is None:
        spans = zip(ranges.documents, ranges.starts, ranges.stops, strict=True)
        matches = [Match(index.names[d], a / FEATURE_RATE, b / FEATURE_RATE, 0.0) for d, a, b in spans]
    else:
        matches = rank(index, searched, lambda piece: distance_function(template, piece), threshold)
    end = time.perf_counter()
    return SearchReport(
        query.keyframes.label, ranges, tuple(matches), ranges.frames / index.frames, searched.frames / index.frames,
        1000 * (middle - begin), 1000 * (end - middle) if template is not None else 0.0,
    )  # fmt: skip


@lru_cache(maxsize=1)
def _load_search() -> None:
    """Search a few frames, so that loading or compiling the code is not timed with the first search."""
    values = np.zeros((len(FEATURES), 6), dtype=bool)
    values[0], values[14] = True, [False, True, True, False, True, False]
    column = np.full(len(FEATURES), WILDCARD, dtype=np.int8)
    column[[0, 14]] = 1
    moment = keyframes_of_column(column)
    query = KeyframeQuery.from_positions([(0, moment), (1, moment)], 2, 0.5)
    find(KeyframeIndex.build([FeatureMatrix("warm-up", values)]), query)


def save_matches(path: str | Path, reports: Sequence[SearchReport]) -> None:
    """Write results as CSV (label, document, start, end, cost; seconds) or, by the suffix, as JSON."""
    rows = [{"label": report.label, **asdict(match)} for report in reports for match in report.matches]
    if Path(path).suffix.lower() == ".json":
        save_json(path, rows)
        return
    if Path(path).suffix.lower() != ".csv":
        raise UsageError(f"results cannot be written as {Path(path).name!r}; give a name that ends in .csv or .json")
    stream = io.StringIO()
    writer = csv.DictWriter(stream, ["label", "document", "start", "end", "cost"], lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: f"{v:.4f}" if isinstance(v, float) else v for key, v in row.items()} for row in rows)
    save_text(path, stream.getvalue())


def labels_of(files: Sequence[Path], pattern: str | None = None, table: str | Path | None = None) -> dict[Path, str]:
    """Motion class of each clip: from a table (CSV: clip, label), else from its name, else from its folder's name.

    Parameters
    ----------
    files : clips
    pattern : regular expression with a group `label` that matches a clip's whole stem
    table : CSV file with the columns clip (the stem) and label

    Raises
    ------
    UsageError
        A pattern without that group, or both ways at once.
    RetrievalError
        A clip without a label, or a table that cannot be read.
    """
    if pattern is not None and table is not None:
        raise UsageError("labels come from a pattern or from a table, not from both; leave one out")
    if table is not None:
        known = _label_table(Path(table))
        return {file: _label(known.get(file.stem), file, f"in {table}") for file in files}
    if pattern is None:
        return {file: file.resolve().parent.name for file in files}
    try:
        expression = re.compile(pattern)
    except re.error as error:
        raise UsageError(f"pattern {pattern!r} is no regular expression ({error}); correct it") from error
    if "label" not in expression.groupindex:
        raise UsageError(f"pattern {pattern!r} has no group named label; write (?P<label>...) around it")
    found = {file: expression.fullmatch(file.stem) for file in files}
    return {file: _label(match and match["label"], file, f"by pattern {pattern!r}") for file, match in found.items()}


def _label(label: str | None, file: Path, where: str) -> str:
    if not label:
        raise RetrievalError(f"clip {file.name} has no label {where}; give it one or leave it out")
    return label


def _label_table(path: Path) -> dict[str, str]:
    try:
        rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        raise RetrievalError(f"cannot read the labels {path} ({error}); give a CSV file with clip and label") from error
    if not rows or not {"clip", "label"} <= rows[0].keys():
        raise RetrievalError(f"{path} has no columns clip and label; name them in its first line")
    return {row["clip"]: row["label"] for row in rows}


def learn_queries(
    clips: Mapping[Path, str],
    output: str | Path,
    rng: np.random.Generator,
    *,
    labels: Sequence[str] | None = None,
    others: Sequence[str | Path] = (),
    settings: LearningSettings | None = None,
    alternatives: int = 1,
    tight: bool = False,
    workers: int = 1,
    progress: Progress | None = None,
) -> dict[str, LearnedQuery]:
    """Learn keyframe queries for motion classes and write them as one file.

    Parameters
    ----------
    clips : cut clip -> its class
    output : the query file (JSON)
    rng : source of all randomness
    labels : classes to learn; all by default
    others : clips and folders of clips that belong to no class
    settings : how
    alternatives : queries written per class, the best first
    tight : write those with tightened distances (`LearnedQuery.tight`)
    workers : processes; they do not change the result
    progress : told after each genetic run
    """
    motions: dict[str, list[Motion]] = {label: [] for label in sorted(set(clips.values()))}
    settings = settings or LearningSettings()
    for file, label in clips.items():
        motions[label].append(load_motion(file))
    classes, checks = training_clips(motions, settings)
    more = [relational_features(load_motion(file)) for file in find_motions(others)]
    learned = learn(
        classes, settings, rng, labels=labels, others=more, checks=checks, workers=workers, progress=progress
    )
    save_queries(output, [query for result in learned.values() for query in result.alternatives(alternatives, tight)])
    return learned
