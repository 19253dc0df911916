"""Search of an index by keyframes, by example and by class, and its result files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

from toolkit.io.display_names import shown
from toolkit.io.errors import RetrievalError, UsageError
from toolkit.io.files import save_csv
from toolkit.retrieval.annotation.model import MotionModel
from toolkit.retrieval.features.grades import BLOCK_COLUMNS
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.search.find import HitRanges, Match, find
from toolkit.retrieval.workflow.motions import find_motions, load_motion


def cut_example(clip: str | Path, start: float = 0.0, end: float | None = None) -> FeatureMatrix:
    """Return the features of a segment of a clip, `start` to `end` in seconds; None is the clip's end.

    Raises
    ------
    UsageError
        The segment is outside the clip.
    """
    features = relational_features(load_motion(clip))
    end = features.duration if end is None else end
    if not 0.0 <= start < end or end > features.duration + 0.5 / FEATURE_RATE:
        raise UsageError(
            f"{start:g} to {end:g} s is outside {features.name!r}, which lasts {features.duration:.2f} s; "
            "give a start and a later end inside it"
        )
    return features.sliced(round(start * FEATURE_RATE), round(end * FEATURE_RATE))


def stretches(matches: Sequence[Match], mocap: Sequence[str | Path]) -> list[Motion]:
    """Return the motions of matches, cut out of the indexed files.

    Raises
    ------
    RetrievalError
        A document is missing among the files.
    """
    files = {file.stem: file for file in find_motions(mocap)}
    found = []
    for match in matches:
        if match.document not in files:
            raise RetrievalError(f"there is no motion {match.document!r} in the folders given; name those indexed")
        motion = load_motion(files[match.document])
        start, stop = (round(seconds * motion.frame_rate) for seconds in (match.start, match.end))
        found.append(motion.sliced(min(start, len(motion) - 1), max(stop, start + 1)))
    return found


@dataclass(frozen=True, eq=False)
class SearchReport:
    """Results of a query.

    Attributes
    ----------
    label : label of the query
    matches : results, cheapest first; keyframe hits have cost 0
    share : fraction of all frames in keyframe hits; None for results with a cost
    """

    label: str
    matches: tuple[Match, ...]
    share: float | None = None


def by_keyframes(index: KeyframeIndex, queries: Sequence[KeyframeQuery]) -> list[SearchReport]:
    """Return keyframe matches: one report for each label, with merged hits of alternative queries."""
    reports = []
    for label in dict.fromkeys(query.label for query in queries):
        found = HitRanges.union([find(index, query) for query in queries if query.label == label])
        ranges = zip(found.documents, found.starts, found.stops, strict=True)
        matches = tuple(Match(index.names[d], a / FEATURE_RATE, b / FEATURE_RATE, 0.0) for d, a, b in ranges)
        reports.append(SearchReport(label, matches, found.frames / index.frames))
    return reports


def by_class(
    index: KeyframeIndex, model: MotionModel, labels: Sequence[str] | None = None, doubt: float = 0.8
) -> list[SearchReport]:
    """Return the places of a motion model's classes: one report per class, the most probable first.

    Parameters
    ----------
    index : index to search
    model : example clips and classifiers
    labels : classes to search; all by default
    doubt : 1 minus the smallest probability of a result; a search reports less probable places than
        `MotionModel.annotate`

    Raises
    ------
    RetrievalError
        The model has no such label.
    """
    unknown = sorted(set(labels or ()) - set(model.labels))
    if unknown:
        raise RetrievalError(f"the model has no class {unknown[0]!r}; it has {', '.join(model.labels)}")
    reports = []
    for label, classifier in zip(model.labels, model.classifiers, strict=True):
        if labels and label not in labels:
            continue
        places = model.examples.propose_in(label, *index.coarse)
        doubts = 1.0 - classifier.probability(places.described)
        lengths = np.diff(index.document_starts)
        stops = np.minimum(BLOCK_COLUMNS * (places.lasts + 1), lengths[places.documents])
        matches = [
            Match(
                index.names[places.documents[k]], BLOCK_COLUMNS * int(places.firsts[k]) / FEATURE_RATE,
                int(stops[k]) / FEATURE_RATE, float(doubts[k]),
            )
            for k in np.argsort(doubts, kind="stable")
            if doubts[k] <= doubt
        ]  # fmt: skip
        reports.append(SearchReport(label, tuple(matches)))
    return reports


def save_matches(path: str | Path, reports: Sequence[SearchReport]) -> None:
    """Write results as CSV: label, document, start, end, cost; seconds."""
    if Path(path).suffix.lower() != ".csv":
        raise UsageError(f"results cannot be written as {Path(path).name!r}; give a name that ends in .csv")
    rows = [(report.label, *astuple(match)) for report in reports for match in report.matches]
    save_csv(
        path,
        ("label", "document", "start", "end", "cost"),
        ([f"{v:.4f}" if isinstance(v, float) else shown(v, "table") for v in row] for row in rows),
    )
