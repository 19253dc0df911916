"""Keyframes of actors not trained on: `depthmocap bench keyframes PART`, which is one of

- `search DATA [--frames 378000] [--runs 24]`: keyframe search over 3.5 hours. Documents are made from HDM05 clips and
  CMU motions (see `benchmarks/_keyframe_corpus.py`), a third of them per actor. For each actor, queries for the 11
  classes are learned from the cut clips of the other two, at three speeds and three proportions, and from unlabelled
  pieces of documents made of their clips and half of the CMU motions; the other half of the CMU motions is the filler
  of what is searched. Every query searches the whole index; recall and data left are counted on the documents of the
  actor left out.
- `manual DATA`: the hand-written queries of `examples/keyframes.json` (3.6.1) beside learned ones, for 15 classes, in a
  corpus of the same size of the actors bk and dg. Queries were written, and learned, with clips of bd. Four classes
  that the excerpt of HDM05 lacks are made by `_keyframe_corpus.load_all`.
- `learning DATA [--runs 24]`: for each of the actors bd, bk and dg, keyframes of the 11 classes are learned from the
  cut clips of the other two and tried on all clips of this one: F-measure with beta 2 over documents, as in Eq. 4.11.
  Learned once from the clips as they are, and once from each clip also under other proportions of its actor and at
  other speeds. Beside them the mean quality of the populations over the generations (Fig. 4.3), and the time of one run
  on a training set of the size of the thesis's.
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _keyframe_corpus as corpus
from benchmarks._record import benchmark, milliseconds_of, pin_to_one_processor, script
from tests.support.suite import ROOT
from toolkit.retrieval.annotation.documents import Document
from toolkit.retrieval.annotation.training import CutClip
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery, load_queries
from toolkit.retrieval.learning.genetic import GeneticSettings, Individual, TrainingSet, evolve
from toolkit.retrieval.learning.queries import LearningSettings, learn, training_clips
from toolkit.retrieval.search.find import find
from toolkit.retrieval.templates import MotionTemplate

COUNTEREXAMPLES = 30_000
"""Frames of the documents from which counterexamples are cut."""
FRAMES = 378_000
"""Frames of the corpus at 30 Hz, 3.5 hours as in the thesis (3.6.1)."""
MANUAL = ROOT / "examples" / "keyframes.json"
ALTERNATIVES = {"1 per class": (1, False), "5 per class, tight": (5, True)}
"""Queries per class that are combined (a hit of any counts), and whether their distances are tightened."""
REPEATS = 20
"""Searches per query; the median counts."""


def median_ms(index: KeyframeIndex, query: KeyframeQuery) -> float:
    """Return the median time of a search, milliseconds."""
    return float(np.median(milliseconds_of(lambda: find(index, query), REPEATS)))


def judged(index: KeyframeIndex, truth: corpus.Truth, queries: Sequence[KeyframeQuery]) -> dict[str, Any]:
    """Return all figures of queries of a class together."""
    row: dict[str, Any] = {"milliseconds": sum(median_ms(index, query) for query in queries)}
    row["relevant"] = truth.relevant
    for name, factor in (("hits", 0.0), ("motions", 1.0)):
        row[f"left_{name}"], row[f"touched_{name}"], row[f"half_{name}"] = truth.quality(
            [find(index, query, factor) for query in queries]
        )
    return row


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Return means over classes and actors, and remaining data as a multiple of the relevant data."""
    means = means_of(rows)
    return means | {f"left_{of}_over_relevant": means[f"left_{of}"] / means["relevant"] for of in ("hits", "motions")}


def means_of(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Return the means of all real numbers."""
    return {
        key: float(np.mean([row[key] for row in rows])) for key, value in rows[0].items() if isinstance(value, float)
    }


def through_file(documents: Sequence[Document]) -> KeyframeIndex:
    """Return the index as the command uses it: written, opened again, mapped."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motions.index"
        KeyframeIndex.build([document.features for document in documents]).save(path)
        return KeyframeIndex.open(path)


@benchmark(data=Path, runs=24, frames=FRAMES)
def search(options: argparse.Namespace) -> tuple[str, Any]:
    """Search with queries of actors not trained on."""
    rng = np.random.default_rng(0)
    clips, filler = corpus.load_examples(options.data), corpus.load_filler(options.data)
    frames = options.frames // len(corpus.ACTORS)
    people = corpus.left_out(clips)
    documents = [d for _, _, own in people for d in corpus.make_documents(own, filler[1::2], frames, rng)]
    index = through_file(documents)
    together: dict[str, list[dict[str, Any]]] = {}
    pin_to_one_processor()
    for actor, seen, _ in corpus.left_out(clips):
        counterexamples = []
        for _, _, own in corpus.left_out(seen):
            counterexamples += corpus.make_documents(own, filler[0::2], COUNTEREXAMPLES // 2, rng)
        learned = corpus.learned_from(seen, counterexamples, LearningSettings(runs=options.runs), rng)
        for label, result in learned.items():
            for name, (number, tight) in ALTERNATIVES.items():
                row = judged(index, corpus.Truth(documents, label, actor), result.alternatives(number, tight))
                together.setdefault(name, []).append(row)
    return "keyframe_search", {"together": {name: summary(rows) for name, rows in together.items()}}


@benchmark(data=Path, runs=24)
def manual(options: argparse.Namespace) -> tuple[str, Any]:
    """Search with hand-written queries, and with those learned from the same clips."""
    rng = np.random.default_rng(0)
    filler = corpus.load_filler(options.data, corpus.HOLDS_A_CLASS + corpus.PUNCHES)
    seen, *others = (own for _, _, own in corpus.left_out(corpus.load_all(options.data)))
    documents = [d for own in others for d in corpus.make_documents(own, filler[1::2], FRAMES // len(others), rng)]
    index = KeyframeIndex.build([document.features for document in documents])
    counterexamples = corpus.make_documents(seen, filler[0::2], COUNTEREXAMPLES, rng)
    learned = corpus.learned_from(seen, counterexamples, LearningSettings(runs=options.runs), rng)
    queries = {"by hand": load_queries(MANUAL), "learned": [q for r in learned.values() for q in r.alternatives(1)]}
    classes: dict[str, Any] = {}
    pin_to_one_processor()
    for kind, found in queries.items():
        for query in found:
            truth, motions = corpus.Truth(documents, query.label), find(index, query, 1.0)
            left, recall, _ = truth.quality([motions])
            row = {"precision": truth.precision(motions), "recall": recall, "left": left}
            classes.setdefault(query.label, {})[kind] = {"milliseconds": median_ms(index, query)} | row
    means = {kind: means_of([classes[label][kind] for label in classes]) for kind in queries}
    return "keyframe_manual", {"together": means, "classes": classes}


THESIS_FRAMES, THESIS_EXAMPLES = 42_586, 9
"""Training set of the thesis: frames at 30 Hz, clips per class."""
GENERATION_STEP, CURVE_RUNS = 5, 2
"""Generations from one point of a curve to the next, and genetic runs of each class and rotation."""
PARTS_OF_QUALITY = ("precision", "recall", "fitness")


def set_of(clips: Sequence[CutClip], label: str) -> TrainingSet:
    """Return all clips with the class marked."""
    return TrainingSet([c.features for c in clips], [c.label == label for c in clips])


def fitness_of(clips: Sequence[CutClip], settings: LearningSettings) -> float:
    """Return the mean fitness over classes on clips of actors who are left out of the learning, mean of the actors."""
    found = []
    for _, seen, unseen in corpus.left_out(clips):
        classes, checks = training_clips(corpus.motions_by_label(seen), settings)
        learned = learn(classes, settings, np.random.default_rng(0), checks=checks)
        found.append(np.mean([set_of(unseen, name).quality(own.individual).fitness for name, own in learned.items()]))
    return float(np.mean(found))


def curves(clips: Sequence[CutClip], learning: LearningSettings) -> dict[str, Any]:
    """Return mean precision, recall and fitness of the populations over the generations (Fig. 4.3)."""
    steps = list(range(0, learning.genetic.generations, GENERATION_STEP))
    total, populations = np.zeros((len(steps), len(PARTS_OF_QUALITY))), 0
    for _, seen, unseen in corpus.left_out(clips):
        classes, _ = training_clips(corpus.motions_by_label(seen), learning)
        documents = [document for own in classes.values() for document in own]
        owners = [name for name, own in classes.items() for _ in own]
        for label, own in classes.items():
            training, verification = TrainingSet(documents, [owner == label for owner in owners]), set_of(unseen, label)
            template = MotionTemplate.of(own, strict=True).quantised(delta=0.0)

            def observe(generation: int, population: Sequence[Individual], judge: TrainingSet = verification) -> None:
                if generation % GENERATION_STEP == 0:
                    found = [judge.quality(individual) for individual in population]
                    means = [np.mean([getattr(q, name) for q in found]) for name in PARTS_OF_QUALITY]
                    total[generation // GENERATION_STEP] += means

            for seed in range(CURVE_RUNS):
                evolve(training, template, learning.genetic, np.random.default_rng(seed), observe)
                populations += 1
    means = dict(zip(PARTS_OF_QUALITY, (total / populations).T.tolist(), strict=True))
    return {"generations": steps, "verification": means}


def timed_run(clips: Sequence[CutClip]) -> dict[str, Any]:
    """Return the time of a genetic run on 9 clips of a class against clips of all other classes at several speeds."""
    settings = GeneticSettings()
    label = "kickLFront1Reps"
    positive = [e.features for e in clips if e.label == label][:THESIS_EXAMPLES]
    negative: list[FeatureMatrix] = []
    frames = sum(map(len, positive))
    for factor in (1.0, 0.8, 1.25, 0.9, 1.1):
        for motion in (e.motion for e in clips if e.label != label):
            for mirrored in (False, True):
                if frames < THESIS_FRAMES:
                    changed = motion.at_speed(factor)
                    features = relational_features(changed.mirrored() if mirrored else changed)
                    negative.append(replace(features, name=f"{features.name} x {factor}"))
                    frames += len(features)
    training = TrainingSet([*positive, *negative], [True] * len(positive) + [False] * len(negative))
    template = MotionTemplate.of(positive, strict=True).quantised(delta=0.0)
    evolve(training, template, replace(settings, generations=2), np.random.default_rng(0))
    seeds = count()
    milliseconds = milliseconds_of(
        lambda: evolve(training, template, settings, np.random.default_rng(next(seeds))), 10, time.process_time
    )
    return {"frames": int(training.document_starts[-1]), "median_cpu_seconds": float(np.median(milliseconds)) / 1000.0}


@benchmark(data=Path, runs=24)
def learn_keyframes(options: argparse.Namespace) -> tuple[str, Any]:
    """Learn keyframes from two actors and try them on the third."""
    clips = corpus.load_examples(options.data)
    figures: dict[str, Any] = {"one_run": timed_run(clips)}
    for name, learning in (
        ("clips as they are", LearningSettings(runs=options.runs, proportions=(), speeds=())),
        ("also under other proportions and speeds", LearningSettings(runs=options.runs)),
    ):
        figures[name] = {"fitness": fitness_of(clips, learning), "curves": curves(clips, learning)}
    return "keyframe_learning", figures


main = script(__name__, __doc__, {"search": search, "manual": manual, "learning": learn_keyframes})
