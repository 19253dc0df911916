from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.io.errors import RetrievalError
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.learning.genetic import Breeder, GeneticSettings, Individual, Quality, TrainingSet, evolve
from toolkit.retrieval.learning.queries import LearningSettings, learn, training_clips
from toolkit.retrieval.search.find import find
from toolkit.retrieval.templates import MotionTemplate, QuantisedTemplate
from toolkit.retrieval.workflow.motions import load_motion

QUICK = GeneticSettings(population=12, generations=15, parents=4)
KINDS = ("left", "right", "both")


def clip(kind: str, rng: np.random.Generator, name: str = "clip") -> FeatureMatrix:
    """Return a synthetic motion: F1 rises in the middle; for "both" F2 after it, for "right" F2 alone; the rest is
    noise.
    """
    frames = int(rng.integers(24, 40))
    values = np.zeros((40, frames), dtype=bool)
    values[20:24] = np.repeat(rng.random((4, frames // 4 + 1)) < 0.3, 4, axis=1)[:, :frames]
    third = frames // 3
    first, second = {"left": (0, None), "right": (1, None), "both": (0, 1)}[kind]
    values[first, third : third + 6] = True
    if second is not None:
        values[second, 2 * third : 2 * third + 5] = True
    return FeatureMatrix(name, values)


def clips(per_kind: int, seed: int = 0) -> dict[str, list[FeatureMatrix]]:
    rng = np.random.default_rng(seed)
    return {kind: [clip(kind, rng, f"{kind}{i}") for i in range(per_kind)] for kind in KINDS}


def training_of(classes: dict[str, list[FeatureMatrix]], label: str) -> TrainingSet:
    documents = [document for members in classes.values() for document in members]
    return TrainingSet(documents, [name == label for name, members in classes.items() for _ in members])


def strict_template(members: list[FeatureMatrix], label: str = "") -> QuantisedTemplate:
    return MotionTemplate.of(members, strict=True).quantised(delta=0.0)


@pytest.fixture
def breeder() -> Breeder:
    return Breeder(strict_template(clips(4)["both"]), np.random.default_rng(1))


def check(individual: Individual) -> None:
    assert len(individual.placed) >= 2 and individual.columns == sorted(set(individual.columns))
    assert len(individual.distances) == len(individual.placed) - 1
    assert all(mask > 0 and value & ~mask == 0 for _, (mask, value) in individual.placed)
    assert all(0 <= a <= b for a, b in individual.distances)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 999999))
def test_every_operation_makes_a_valid_individual(seed: int) -> None:
    breeder = Breeder(strict_template(clips(3)["both"]), np.random.default_rng(seed))
    a, b = breeder.individual(), breeder.individual()
    check(a)
    for _ in range(6):
        a = breeder.recombined(a, b)
        check(a)
        for operation in (breeder.with_other_keyframes, breeder.with_other_entry, breeder.with_other_distances):
            a = operation(a)
            check(a)


def test_fitness_is_the_f_measure_of_the_text() -> None:
    retrieved = np.array([1, 1, 1, 0, 0, 0], dtype=bool)
    relevant = np.array([1, 1, 0, 1, 0, 0], dtype=bool)
    quality = Quality.of(retrieved, relevant, beta=2.0)
    assert quality.precision == quality.recall == pytest.approx(2 / 3)
    assert Quality.of(np.array([True] * 4), np.array([True, False, False, False])).fitness == pytest.approx(5 / 8)
    assert Quality.of(~relevant, relevant) == Quality(0.0, 0.0, 0.0)


def test_documents_found_while_learning_are_those_of_the_index(breeder: Breeder) -> None:
    classes = clips(6, seed=3)
    documents = [document for members in classes.values() for document in members]
    training, index = training_of(classes, "both"), KeyframeIndex.build(documents)
    found = 0
    for _ in range(60):
        individual = breeder.mutated(breeder.individual())
        hits = find(index, individual.query(32, "both"))
        assert np.array_equal(np.flatnonzero(training.retrieved(individual)), np.unique(hits.documents))
        found += len(hits) > 0
    assert 5 < found


def test_a_population_improves_until_it_separates_the_class() -> None:
    classes = clips(5)
    training = training_of(classes, "both")
    means: list[float] = []

    def observe(generation: int, population: Sequence[Individual]) -> None:
        assert generation == len(means) and len(population) == QUICK.population
        means.append(float(np.mean([training.quality(individual, 2.0).fitness for individual in population])))

    best = evolve(training, strict_template(classes["both"]), QUICK, np.random.default_rng(2), observe)
    assert len(means) == QUICK.generations
    assert means == sorted(means) and means[0] < means[-1]
    assert training.quality(best, 2.0).fitness == 1.0


@pytest.mark.data("hdm05")
def test_keyframes_learned_from_two_actors_find_the_third(data_folder: Path) -> None:
    kinds = ("squat1Reps", "elbowToKnee1RepsLelbowStart", "kickLFront1Reps", "rotateArmsBothBackward1Reps")
    seen: dict[str, list[Motion]] = {kind: [] for kind in kinds}
    unseen: dict[str, list[FeatureMatrix]] = {kind: [] for kind in kinds}
    for kind in kinds:
        for path in sorted((data_folder / "mocap" / "hdm05").glob(f"*_{kind}_*.amc"))[::2]:
            motion = load_motion(path)
            if "_bk_" in path.name:
                unseen[kind].append(relational_features(motion))
            else:
                seen[kind].append(motion)
    settings = LearningSettings(runs=4)
    classes, checks = training_clips(seen, settings)
    learned = learn(classes, settings, np.random.default_rng(0), labels=["squat1Reps"], checks=checks)["squat1Reps"]
    assert learned.training.fitness == 1.0
    assert training_of(unseen, "squat1Reps").quality(learned.individual, 2.0).fitness > 0.9


def test_learning_gives_the_same_queries_for_any_number_of_workers() -> None:
    classes = clips(4)
    settings = LearningSettings(genetic=QUICK, runs=3)
    told: list[tuple[str, int, int]] = []
    alone = learn(
        classes, settings, np.random.default_rng(5), labels=["both", "left"], progress=lambda *step: told.append(step)
    )
    together = learn(classes, settings, np.random.default_rng(5), labels=["both", "left"], workers=2)
    assert list(alone) == ["both", "left"]
    for label in alone:
        assert alone[label].alternatives(1) == together[label].alternatives(1)
        assert alone[label].ranked == together[label].ranked
    assert told[0] == ("both", 1, 6) and told[-1] == ("left", 6, 6)
    assert alone["both"].training.fitness == 1.0 and alone["both"].alternatives(1)[0].label == "both"
    other = learn(classes, settings, np.random.default_rng(6), labels=["both"])
    assert other["both"].ranked != alone["both"].ranked


def test_training_data_that_cannot_teach_anything_is_refused() -> None:
    classes, rng = clips(2), np.random.default_rng(0)
    quick = LearningSettings(genetic=QUICK, runs=1)
    with pytest.raises(RetrievalError, match="unknown label 'kick'; the clips have both, left, right"):
        learn(classes, quick, rng, labels=["kick"])
    with pytest.raises(RetrievalError, match="class 'left' has no clips"):
        learn({**classes, "left": []}, quick, rng)
    with pytest.raises(RetrievalError, match="all clips have the label 'both'"):
        learn({"both": classes["both"]}, quick, rng)
    with pytest.raises(RetrievalError, match="has no other document"):
        TrainingSet(classes["both"], [True, True])
    with pytest.raises(RetrievalError, match="one each"):
        TrainingSet(classes["both"], [True])
    still, other = (FeatureMatrix("still", np.full((40, 9), value)) for value in (False, True))
    with pytest.raises(RetrievalError, match="'wild' agree in fewer than 2 columns"):
        learn({**classes, "wild": [still, other]}, quick, rng)
