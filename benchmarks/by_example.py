"""Search by example: `depthmocap bench by_example DATA`.

Each clip of a person is an example. The clips of its class, by any person, are relevant; documents contain each clip
once. Figures are the mean average precision, and the correct results among the first 10 as a fraction of the possible
number. A result is correct if it and a relevant clip share half of the shorter of the two and no better result has that
clip. Results on the example's own clip do not count.

Corpora
-------
people : documents of HDM05 actors bd, bk and dg, with excerpts of CMU subjects above 8; examples by dg. The constants
    of `features/grades.py` come from bd, bk and CMU subjects up to 8, and so did the choice of the weights
decoys : the same with the mirror images of all clips of one-sided classes, which belong to no class, and joins of at
    most 0.1 seconds
UTD-MHAD : 27 actions by 2 subjects (Kinect skeletons), each clip a document and an example; the costs of places and
    durations were chosen on subjects 1 and 3, subjects 5 and 7 are reported

Methods: DTW of joint positions (without root position, heading and size), DTW of the booleans, and
`depthmocap search --by-example`. All DTW has the same steps.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from benchmarks._keyframe_corpus import FILLER_SECONDS, FILLER_SHARE, SYMMETRIC, halves, load_examples, load_filler
from benchmarks._record import benchmark, command_cost, milliseconds_of, pin_to_one_processor, script
from tests.support.bootstrap import paired_bootstrap
from toolkit.kernels.motion.graded import distinct_hits
from toolkit.recordings.readers.utd_mhad import joints_from_kinect
from toolkit.retrieval.annotation.documents import HARD_JOINS, JOINS, TransitionSettings, assemble, excerpt
from toolkit.retrieval.annotation.training import CutClip
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import Motion, from_joints
from toolkit.retrieval.features.places import hip_aligned_joints
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix, feature_columns, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.search import example as shipped
from toolkit.retrieval.templates import QuantisedTemplate

REPORTED = "dg"
REPORTED_SUBJECTS = ("s5", "s7")
"""Subjects of UTD-MHAD."""
PARTS = 20
"""Parts of a document."""
MOST = 300
"""Number of examined results."""

Hit = tuple[float, int, int, int]
"""Cost, number of the document, first frame, frame after the last."""
Method = Callable[[FeatureMatrix, Motion], list[Hit]]


@dataclass(frozen=True, eq=False)
class Corpus:
    """Documents with their true segments: (document, first frame, frame after the last, label, clip)."""

    motions: list[Motion]
    segments: list[tuple[int, int, int, str, str]]

    @cached_property
    def features(self) -> list[FeatureMatrix]:
        """Features of each document."""
        return [relational_features(motion) for motion in self.motions]

    @cached_property
    def index(self) -> KeyframeIndex:
        """Index of all documents."""
        return KeyframeIndex.build(self.features)


def corpus_of(
    examples: Sequence[CutClip], filler: Sequence[Motion], *, decoys: bool, joins: TransitionSettings
) -> Corpus:
    """Return documents that contain each clip once, with filler and optional mirror images of one-sided classes
    between.
    """
    rng = np.random.default_rng(0)
    parts: list[tuple[Motion, str | None]] = [(e.motion, f"{e.label}/{e.motion.name}") for e in examples]
    if decoys:
        parts += [(e.motion.mirrored(), None) for e in examples if e.label not in SYMMETRIC]
    for _ in range(int(len(parts) * FILLER_SHARE)):
        parts.append((excerpt(filler, FILLER_SECONDS, rng), None))
    order = rng.permutation(len(parts))
    groups = [[parts[i] for i in order[k : k + PARTS]] for k in range(0, len(order), PARTS)]
    documents = [assemble(f"document {number}", group, joins) for number, group in enumerate(groups)]
    segments = [
        (number, *segment.frames(FEATURE_RATE), *segment.label.split("/", 1))
        for number, document in enumerate(documents)
        for segment in document.segments
    ]
    return Corpus([document.motion for document in documents], segments)  # type: ignore[arg-type]


def judge(hits: Sequence[Hit], corpus: Corpus, label: str, clip: str) -> tuple[float, float]:
    """Return average precision, and correct results among the first 10 as a fraction of the possible number."""
    relevant = {k for k, segment in enumerate(corpus.segments) if segment[3] == label and segment[4] != clip}
    found: set[int] = set()
    precisions: list[float] = []
    early = seen = 0
    for _, document, start, stop in sorted(hits):
        shared = [
            k
            for k, (d, a, b, _, _) in enumerate(corpus.segments)
            if d == document and 2 * (min(stop, b) - max(start, a)) >= min(stop - start, b - a)
        ]
        if any(corpus.segments[k][4] == clip for k in shared):
            continue
        seen += 1
        new = [k for k in shared if k in relevant and k not in found]
        if new:
            found.add(new[0])
            precisions.append(len(found) / seen)
            early += seen <= 10
    return sum(precisions) / len(relevant), early / min(10, len(relevant))


# methods


def positions(motion: Motion) -> np.ndarray:
    """Return joints at 30 Hz, float32 (3, 24, T): root at the origin, hips along x, in body lengths."""
    joints = hip_aligned_joints(motion, feature_columns(len(motion), motion.frame_rate))
    return np.ascontiguousarray(joints.T / BodyLengths.of(motion).body, dtype=np.float32)


def distance_of_positions(template: np.ndarray, document: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return subsequence DTW of positions (3, J, N) with a document (3, J, L), mean distance of a joint per column."""
    length, rows = document.shape[2], template.shape[2]
    costs, starts = np.full((2, length + 2), np.inf), np.full((2, length + 2), -1)  # two rows, after two columns
    for i in range(rows):
        cell = np.sqrt(((document - template[:, :, i : i + 1]) ** 2).sum(axis=0)).mean(axis=0) / rows
        if i == 0:
            best, origin = cell, np.arange(length)
        else:
            steps = np.array([costs[1, 1:-1] + cell, costs[1, :-2] + cell, costs[0, 1:-1] + 2 * cell])
            chosen, columns = steps.argmin(axis=0), np.arange(length)
            best = steps[chosen, columns]
            origin = np.array([starts[1, 1:-1], starts[1, :-2], starts[0, 1:-1]])[chosen, columns]
        costs[0], starts[0] = costs[1], starts[1]
        costs[1, 2:], starts[1, 2:] = best, origin
    return costs[1, 2:], starts[1, 2:]


def joined(results: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Hit]:
    """Return the best hits of a distance function that was computed document by document."""
    cost = np.concatenate([costs for costs, _ in results]).astype(np.float32)
    start = np.concatenate([starts for _, starts in results]).astype(np.int32)
    edges = np.cumsum([0, *(len(costs) for costs, _ in results)])
    found = distinct_hits(cost, start, edges, np.inf, MOST)
    return [(float(cost[edges[d] + last]), int(d), int(first), int(last) + 1) for d, first, last in found]


def methods_for(corpus: Corpus) -> dict[str, Method]:
    """Return all methods on a corpus, by the names of the table."""
    placed = [positions(motion) for motion in corpus.motions]
    numbers = {name: number for number, name in enumerate(corpus.index.names)}

    def by_positions(_: FeatureMatrix, motion: Motion) -> list[Hit]:
        template = positions(motion)
        return joined([distance_of_positions(template, document) for document in placed])

    def by_booleans(example: FeatureMatrix, _: Motion) -> list[Hit]:
        template = QuantisedTemplate(example.values.astype(np.int8), np.ones(len(example)))
        return joined([template.distance(document.words) for document in corpus.features])

    def by_search(example: FeatureMatrix, _: Motion) -> list[Hit]:
        found = shipped.search_example(corpus.index, example, MOST)
        frames = [(round(match.start * FEATURE_RATE), round(match.end * FEATURE_RATE)) for match in found]
        return [(m.cost, numbers[m.document], start, stop) for m, (start, stop) in zip(found, frames, strict=True)]

    return {
        "DTW of positions": by_positions, "DTW of booleans": by_booleans, "with places of limbs (shipped)": by_search
    }  # fmt: skip


def table(corpus: Corpus, queries: Sequence[tuple[Motion, str]]) -> dict[str, Any]:
    """Return mean average precision and precision at 10 of each method, over all examples and per class."""
    rows: dict[str, Any] = {}
    examples = [(relational_features(motion), motion, label) for motion, label in queries]
    for name, method in methods_for(corpus).items():
        scores = {
            motion.name: (label, *judge(method(features, motion), corpus, label, motion.name))
            for features, motion, label in examples
        }
        values = np.array([score[1:] for score in scores.values()])
        spread_of_map = paired_bootstrap(values[:, 0], np.zeros(len(values)), np.random.default_rng(0))
        labels = sorted({label for label, _, _ in scores.values()})
        classes = {name: float(np.mean([p for label, p, _ in scores.values() if label == name])) for name in labels}
        rows[name] = {
            "map": float(values[:, 0].mean()), "map_interval": [spread_of_map.low, spread_of_map.high],
            "precision_at_10": float(values[:, 1].mean()), "classes": classes,
        }  # fmt: skip
    return rows


def timed(corpus: Corpus, queries: Sequence[tuple[Motion, str]]) -> dict[str, float]:
    """Return milliseconds of a search in an hour, the corpus repeated."""
    documents: list[FeatureMatrix] = []
    frames = 0
    while frames < 3600 * 30:  # an hour at 30 Hz
        features = corpus.features[len(documents) % len(corpus.features)]
        documents.append(replace(features, name=f"{features.name} {len(documents)}"))
        frames += len(features)
    index = KeyframeIndex.build(documents)
    examples = [relational_features(motion) for motion, _ in queries]
    shipped.search_example(index, examples[0], 20)
    queued = iter(examples)
    milliseconds = milliseconds_of(
        lambda: shipped.search_example(index, next(queued), 20), len(examples), time.process_time
    )
    return {
        "mean_example_seconds": float(np.mean([example.grades.shape[1] / FEATURE_RATE for example in examples])),
        "median_milliseconds": float(np.median(milliseconds)),
        "worst_milliseconds": float(np.max(milliseconds)),
    }


def processor_seconds_of_the_command(corpus: Corpus, clip: Path) -> float:
    """Return the processor time of `depthmocap search --by-example` including process start, minimum of four."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motions.index"
        corpus.index.save(path)
        return min(command_cost(["search", path, "--by-example", clip])[1] for _ in range(4))


def kinect_corpus(data: Path) -> tuple[Corpus, list[tuple[Motion, str]]]:
    """Return each UTD-MHAD clip of some subjects as a document and as an example."""
    files = sorted((data / "depth" / "utd_mhad").glob("*_skeleton.mat"))
    queries = [
        (from_joints(joints_from_kinect(loadmat(file)["d_skel"]) * -1.0, FEATURE_RATE, file.stem), words[0])
        for file in files
        if (words := file.stem.split("_"))[1] in REPORTED_SUBJECTS
    ]
    segments = [(number, 0, len(motion), action, motion.name) for number, (motion, action) in enumerate(queries)]
    return Corpus([motion for motion, _ in queries], segments), queries


@benchmark(data=Path)
def by_example(options: argparse.Namespace) -> tuple[str, Any]:
    """Search all corpora by example."""
    examples, filler = load_examples(options.data), load_filler(options.data)
    pin_to_one_processor()
    late = halves(filler)[1]
    queries = [(e.motion, e.label) for e in examples if e.person == REPORTED]
    clip = next((options.data / "mocap" / "hdm05").glob("*squat*.amc"))
    corpus = corpus_of(examples, late, decoys=False, joins=JOINS)
    decoys = corpus_of(examples, late, decoys=True, joins=HARD_JOINS)
    kinect, actions = kinect_corpus(options.data)
    return "by_example", {
        "people": table(corpus, queries),
        "decoys": table(decoys, queries),
        "an hour": timed(corpus, queries),
        "seconds_of_the_command": processor_seconds_of_the_command(corpus, clip),
        "utd_mhad": table(kinect, actions),
    }


main = script(__name__, __doc__, by_example)
