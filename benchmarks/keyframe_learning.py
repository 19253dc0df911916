"""Learned keyframes on actors not trained on: `depthmocap bench keyframe_learning DATA [--runs 24]`.

For each of the actors bd, bk and dg, keyframes of the 11 HDM05 classes are learned from the cut clips of the other two
and tried on all clips of this one: F-measure with beta 2 over documents, as in Eq. 4.11. Learned once from the clips
as they are, and once from each clip also under other proportions of its actor and at other speeds. Fig. 4.3 (quality
over generations) is drawn from a few runs, and one run is timed on a training set of the size of the thesis's.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._keyframe_corpus import ACTORS, Example, by_label, load_examples
from benchmarks._record import RESULTS, save_figures
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.learning.genetic import GeneticSettings, Individual, Quality, TrainingSet, evolve
from toolkit.retrieval.learning.queries import LearningSettings, learn, training_clips
from toolkit.retrieval.templates.template import MotionTemplate

THESIS_FRAMES, THESIS_EXAMPLES = 42_586, 9
"""Training set of the thesis: frames at 30 Hz, clips per class."""
GENERATION_STEP = 5
PARTS_OF_QUALITY = ("precision", "recall", "fitness")


def set_of(examples: Sequence[Example], label: str) -> TrainingSet:
    """All clips, the class marked."""
    return TrainingSet([e.features for e in examples], [e.label == label for e in examples])


def tables(examples: Sequence[Example], settings: LearningSettings, seed: int) -> list[dict[str, Any]]:
    """Quality of every class on the actor left out."""
    rows: list[dict[str, Any]] = []
    for actor in ACTORS:
        seen, unseen = ([e for e in examples if (e.actor == actor) == out] for out in (False, True))
        begin = time.process_time()
        classes, checks = training_clips(by_label(seen), settings)
        learned = learn(classes, settings, np.random.default_rng(seed), checks=checks)
        seconds = time.process_time() - begin
        for label, result in learned.items():
            verification = set_of(unseen, label)
            quality = verification.quality(result.individual, settings.genetic.beta)
            runs = [verification.quality(s, settings.genetic.beta).fitness for s in result.solutions]
            rows.append(
                {
                    "left_out": actor, "label": label, "clips": int(verification.relevant.sum()),
                    "precision": quality.precision, "recall": quality.recall, "fitness": quality.fitness,
                    "fitness_of_single_runs": float(np.mean(runs)), "training_fitness": result.training.fitness,
                    "learning_cpu_seconds_all_classes": seconds,
                }
            )  # fmt: skip
        print(
            f"  {actor} left out: F {np.mean([r['fitness'] for r in rows if r['left_out'] == actor]):.3f}", flush=True
        )
    return rows


def curves(examples: Sequence[Example], learning: LearningSettings, runs: int) -> dict[str, Any]:
    """Mean precision, recall and fitness of the populations over the generations (Fig. 4.3)."""
    settings = learning.genetic
    steps = list(range(0, settings.generations, GENERATION_STEP))
    sums = {part: np.zeros((len(steps), len(PARTS_OF_QUALITY))) for part in ("training", "verification")}
    populations = 0
    for actor in ACTORS:
        seen, unseen = ([e for e in examples if (e.actor == actor) == out] for out in (False, True))
        classes, _ = training_clips(by_label(seen), learning)
        documents = [document for clips in classes.values() for document in clips]
        owners = [name for name, clips in classes.items() for _ in clips]
        for label, clips in classes.items():
            training = TrainingSet(documents, [owner == label for owner in owners])
            sets = {"training": training, "verification": set_of(unseen, label)}
            template = MotionTemplate(strict=True).fit(clips).quantised(label, 0.0)

            def observe(generation: int, population: Sequence[Individual], sets: dict[str, TrainingSet] = sets) -> None:
                if generation % GENERATION_STEP == 0:
                    for part, judge in sets.items():
                        found = [judge.quality(individual, settings.beta) for individual in population]
                        means = [np.mean([getattr(q, name) for q in found]) for name in PARTS_OF_QUALITY]
                        sums[part][generation // GENERATION_STEP] += means

            for seed in range(runs):
                evolve(sets["training"], template, settings, np.random.default_rng(seed), observe)
                populations += 1
    means = {
        part: dict(zip(PARTS_OF_QUALITY, (total / populations).T.tolist(), strict=True)) for part, total in sums.items()
    }
    return {"generations": steps, "runs": populations, **means}


def plot_curves(curve: dict[str, Any], path: Path) -> None:
    """Draw the two panels of Fig. 4.3."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.5), layout="constrained")
    for axes, part in zip(figure.subplots(1, 2, sharey=True), ("training", "verification"), strict=True):
        for name, colour in zip(PARTS_OF_QUALITY, ("black", "tab:red", "tab:green"), strict=True):
            axes.plot(curve["generations"], curve[part][name], color=colour, label=name)
        axes.set(title=f"{part} clips, mean of the population", xlabel="generation", ylim=(0, 1.02))
        axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    figure.savefig(path, dpi=120)


def timed_run(examples: Sequence[Example], repeats: int) -> dict[str, Any]:
    """Time of one genetic run on 9 clips of one class and, as others, clips of all other classes at several speeds."""
    settings = GeneticSettings()
    label = "kickLFront1Reps"
    positive = [e.features for e in examples if e.label == label][:THESIS_EXAMPLES]
    negative: list[FeatureMatrix] = []
    frames = sum(map(len, positive))
    for factor in (1.0, 0.8, 1.25, 0.9, 1.1):
        for motion in (e.motion for e in examples if e.label != label):
            for mirrored in (False, True):
                if frames < THESIS_FRAMES:
                    changed = motion.at_speed(factor)
                    features = relational_features(changed.mirrored() if mirrored else changed)
                    negative.append(replace(features, name=f"{features.name} x {factor}"))
                    frames += len(features)
    training = TrainingSet([*positive, *negative], [True] * len(positive) + [False] * len(negative))
    template = MotionTemplate(strict=True).fit(positive).quantised(label, 0.0)
    evolve(training, template, replace(settings, generations=2), np.random.default_rng(0))
    seconds, last = [], Quality(0.0, 0.0, 0.0)
    for seed in range(repeats):
        begin = time.process_time()
        best = evolve(training, template, settings, np.random.default_rng(seed))
        seconds.append(time.process_time() - begin)
        last = training.quality(best, settings.beta)
    return {
        "frames": training.frames, "documents": len(training.relevant), "median_cpu_seconds": float(np.median(seconds)),
        "worst_cpu_seconds": float(np.max(seconds)), "training_fitness": last.fitness,
    }  # fmt: skip


def main() -> None:
    """Parse the command line, measure, print and store the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="the shared data folder")
    parser.add_argument("--runs", type=int, default=24, help="genetic runs per class")
    parser.add_argument("--curve-runs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    examples = load_examples(options.data)
    run = timed_run(examples, 10)
    print(f"one run on {run['frames']} frames: {run['median_cpu_seconds']:.3f} s", flush=True)
    figures: dict[str, Any] = {"one_run": run}
    for name, learning in (
        ("clips as they are", LearningSettings(runs=options.runs, proportions=(), speeds=())),
        ("also under other proportions and speeds", LearningSettings(runs=options.runs)),
    ):
        print(name, flush=True)
        rows = tables(examples, learning, options.seed)
        means = {actor: float(np.mean([r["fitness"] for r in rows if r["left_out"] == actor])) for actor in ACTORS}
        figures[name] = {
            "fitness_by_actor_left_out": means,
            "fitness": float(np.mean(list(means.values()))),
            "classes": rows,
            "curves": curves(examples, learning, options.curve_runs),
        }
        population = figures[name]["curves"]["verification"]["fitness"][-1]
        print(f"  mean {figures[name]['fitness']:.3f}, mean of the last populations {population:.3f}", flush=True)
    plot_curves(figures[name]["curves"], RESULTS / "keyframe_learning.png")
    settings = {"runs": options.runs, "curve_runs": options.curve_runs, "seed": options.seed, "clips": len(examples)}
    settings["training_set_of_the_timed_run"] = (
        "HDM05 clips, mirrored and at speeds 0.8 to 1.25, up to the thesis's size"
    )
    print(save_figures("keyframe_learning", figures, settings))


if __name__ == "__main__":
    main()
