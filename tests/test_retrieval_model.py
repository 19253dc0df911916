"""Motion models: examples, classifiers, learning from documents of other people, and the file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.retrieval_motions import random_motion
from toolkit.io.errors import RetrievalError, UsageError
from toolkit.kernels.motion.graded import differences, graded_distances, nearest_example
from toolkit.retrieval.annotation.annotator import HIT_THRESHOLD
from toolkit.retrieval.annotation.documents import assemble
from toolkit.retrieval.annotation.examples import ExampleSet
from toolkit.retrieval.annotation.model import MotionModel
from toolkit.retrieval.annotation.place_classifier import MEASURES, PlaceClassifier
from toolkit.retrieval.annotation.training import (
    CutClip,
    folds_of,
    leave_one_out,
    train,
)
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import relational_features
from toolkit.retrieval.workflow.annotate import annotate_motions
from toolkit.retrieval.workflow.motions import tags_in_names, tags_of


def performed(seed: int, person: int, seconds: float = 1.6) -> Motion:
    """Return a movement by one person: slightly different joints and speed."""
    motion = random_motion(seed, seconds=seconds)
    rng = np.random.default_rng([seed, person])
    joints = motion.joints + rng.normal(0.0, 0.01, motion.joints.shape[1:])
    return replace(motion, name=f"{seed} by {person}", joints=joints).at_speed(float(rng.uniform(0.85, 1.15)))


def clips_of(people: int = 3, classes: tuple[int, ...] = (1, 2), copies: int = 2) -> list[CutClip]:
    """Return clips of movements by several people."""
    return [
        CutClip(performed(seed, 10 * person + copy), f"move {seed}", f"person {person}")
        for seed in classes
        for person in range(people)
        for copy in range(copies)
    ]


@pytest.fixture(scope="module")
def others() -> list[Motion]:
    return [random_motion(seed, seconds=4.0) for seed in (51, 52)]


@pytest.fixture(scope="module")
def model(others: list[Motion]) -> MotionModel:
    return train(clips_of(), others, np.random.default_rng(0))


def test_the_nearest_example_is_the_cheapest_of_all_and_the_first_of_equals() -> None:
    rng = np.random.default_rng(2)
    columns = rng.integers(-127, 128, (60, 40)).astype(np.int8)
    examples = np.concatenate([columns[5:10], columns[30:37], columns[5:10]]).astype(np.float32)
    starts, edges = np.array([0, 5, 12, 17]), np.array([0, 25, 60])
    weights = np.full((3, 40), 0.025, np.float32)
    cost, start, example = nearest_example(examples, starts, weights, np.arange(3), columns, edges)
    each = [graded_distances(examples[a:b], weights[0], columns, edges) for a, b in ((0, 5), (5, 12), (12, 17))]
    np.testing.assert_array_equal(cost, np.min([costs for costs, _ in each], axis=0))
    assert (cost[9], start[9], example[9]) == (0.0, 5, 0), "example 2 is the same"
    assert (cost[36], start[36], example[36]) == (0.0, 5, 1)
    assert set(nearest_example(examples, starts, weights, np.array([1]), columns, edges)[2]) <= {-1, 1}


@pytest.mark.parametrize("seed", range(4))
def test_weighted_differences_add_up_to_the_cost_of_the_alignment(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.integers(-127, 128, (50, 40)).astype(np.int8)
    example = rng.integers(-127, 128, (7, 40)).astype(np.float32)
    weights = (rng.random((1, 40)) / 7).astype(np.float32)
    cost, start = graded_distances(example, weights[0], columns, np.array([0, 50]))
    end = int(cost.argmin())
    found = differences(example, np.array([0, 7]), weights, columns, np.array([[0, start[end], end]]))
    assert float((found[0] * weights[0]).sum()) * 7 == pytest.approx(float(cost[end]), rel=1e-4)


def test_examples_propose_the_place_where_the_motion_is() -> None:
    clips = clips_of(people=1)
    document = assemble(
        "d", [(random_motion(60, 3.0), None), (performed(1, 99), "move 1"), (random_motion(61, 3.0), None)]
    )
    examples = ExampleSet.of([(clip.features, clip.label) for clip in clips])
    places = examples.propose("move 1", [relational_features(document.motion)])
    best = int(places.described[:, -2].argmin())
    (segment,) = document.segments
    assert 4 * places.firsts[best] / 30 == pytest.approx(segment.start, abs=0.3)
    assert 4 * (places.lasts[best] + 1) / 30 == pytest.approx(segment.end, abs=0.3)
    assert places.described.shape == (len(places.documents), MEASURES)


def test_a_classifier_learns_the_relevant_difference_and_otherwise_uses_the_cost() -> None:
    rng = np.random.default_rng(0)
    measures = rng.random((200, MEASURES))
    true = measures[:, 3] < 0.2
    classifier = PlaceClassifier.learned(measures, true)
    assert ((classifier.probability(measures) >= 0.5) == true).mean() > 0.9
    assert np.abs(classifier.weights).argmax() == 3
    plain = PlaceClassifier.learned(measures, np.zeros(200, dtype=bool))
    costs = np.zeros((3, MEASURES))
    costs[:, -2] = 10 * HIT_THRESHOLD + np.array([-0.5, 0.0, 0.5])
    assert plain.probability(costs)[1] == 0.5 and (np.diff(plain.probability(costs)) < -0.4).all()


def test_a_new_person_is_annotated(model: MotionModel, others: list[Motion]) -> None:
    parts = [(performed(1, 70), "move 1"), (random_motion(62, 2.0), None), (performed(2, 71), "move 2")]
    document = assemble("new", parts)
    found = model.annotate(relational_features(document.motion))
    assert [segment.label for segment in found.segments] == ["move 1", "move 2"]
    for segment, true in zip(found.segments, document.segments, strict=True):
        assert segment.start == pytest.approx(true.start, abs=0.4) and segment.end == pytest.approx(true.end, abs=0.4)
        assert 0.5 <= segment.score <= 1.0
    assert found.measure == "doubt" and found.frames.any(axis=1).all()
    assert not model.annotate(relational_features(document.motion), least=0.999999).segments


def test_equal_seeds_learn_equal_models_and_a_file_gives_them_back(
    model: MotionModel, others: list[Motion], tmp_path: Path
) -> None:
    again = train(clips_of(), others, np.random.default_rng(0))
    np.testing.assert_array_equal([j.offset for j in model.classifiers], [j.offset for j in again.classifiers])
    model.save(tmp_path / "model.npz")
    loaded = MotionModel.load(tmp_path / "model.npz")
    assert loaded.labels == model.labels and loaded.examples.names == model.examples.names
    features = relational_features(performed(2, 70))
    assert loaded.annotate(features).segments == model.annotate(features).segments


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("starts", np.array([0, 3, 2])),
        ("columns", np.zeros((2, 40), np.float64)),
        ("offsets", np.zeros(9)),
        ("scale", np.zeros((2, MEASURES))),
        ("header", np.array('{"labels": []}')),
    ],
)
def test_a_damaged_model_is_refused(model: MotionModel, tmp_path: Path, name: str, value: np.ndarray) -> None:
    path = tmp_path / "model.npz"
    model.save(path)
    with np.load(path) as stored:
        arrays = {key: stored[key] for key in stored.files if "sum" not in key.lower()}
    np.savez(path, **{**arrays, name: value})
    with pytest.raises(RetrievalError, match="learn"):
        MotionModel.load(path)


def test_leaving_people_out_estimates_the_accuracy(others: list[Motion]) -> None:
    steps: list[tuple[str, int, int]] = []
    results = leave_one_out(clips_of(), others, np.random.default_rng(0), lambda *step: steps.append(step))
    assert [result.person for result in results] == ["person 0", "person 1", "person 2"]
    assert steps[-1] == ("leaving one person out", 3, 3)
    assert all(scores.recall > 0.5 for result in results for scores in result.segments.values())
    alone = leave_one_out(clips_of(people=1, copies=4), others, np.random.default_rng(0))
    assert [result.person for result in alone] == ["half 1", "half 2"]


def test_classes_of_one_clip_each_are_found_by_their_cost(others: list[Motion]) -> None:
    clips = clips_of(people=1, copies=1)
    assert not folds_of(clips, np.random.default_rng(0)) and not leave_one_out(clips, others, np.random.default_rng(0))
    model = train(clips, others, np.random.default_rng(0))
    np.testing.assert_array_equal(model.classifiers[0].weights, PlaceClassifier.of_cost().weights)
    assert [s.label for s in model.annotate(relational_features(performed(2, 70))).segments] == ["move 2"]


def test_clips_at_several_rates_and_a_class_with_one_clip_are_learned_together(others: list[Motion]) -> None:
    rates = (24, 30, 60, 120) * 3
    clips = [replace(clip, motion=clip.motion.at_rate(rate)) for clip, rate in zip(clips_of(), rates, strict=True)]
    lone = CutClip(performed(3, 1), "move 3", "person 1")
    learned = train([*clips, lone], others, np.random.default_rng(0))
    assert learned.labels == ("move 1", "move 2", "move 3")
    assert [s.label for s in learned.annotate(relational_features(performed(2, 70))).segments] == ["move 2"]


def test_what_teaches_nothing_is_refused(model: MotionModel) -> None:
    with pytest.raises(RetrievalError, match="no labelled clips"):
        train([], [], np.random.default_rng(0))
    with pytest.raises(RetrievalError, match="all clips have the label 'move 1'"):
        train(clips_of(classes=(1,)), [], np.random.default_rng(0))
    with pytest.raises(RetrievalError, match="'1 by 0.*' has 3 frames at 30 Hz"):
        ExampleSet.of([(relational_features(performed(1, 0)).sliced(0, 3), "x")])
    with pytest.raises(RetrievalError, match="the shortest example needs"):
        model.annotate(relational_features(performed(1, 0)).sliced(0, 9))
    with pytest.raises(UsageError, match="belong to motion templates"):
        annotate_motions([], model, "anywhere", threshold=0.1)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["kick_01", "kick_02", "wave_01"], [("kick", ""), ("kick", ""), ("wave", "")]),
        (["walk-1", "walk-2", "run-1"], [("walk", ""), ("walk", ""), ("run", "")]),
        (
            ["HDM_bd_kick_001_120", "HDM_bd_squat_001_120", "HDM_dg_kick_002_120", "HDM_dg_squat_003_120"],
            [("kick", "bd"), ("squat", "bd"), ("kick", "dg"), ("squat", "dg")],
        ),
        (["kick left 1", "kick right 1", "hop_2"], [("kick_left", ""), ("kick_right", ""), ("hop", "")]),
        (["kick1", "kick2", "hop1"], [("kick", ""), ("kick", ""), ("hop", "")]),
    ],
)
def test_a_flat_folder_is_labelled_by_names(names: list[str], expected: list[tuple[str, str]]) -> None:
    files = [Path("clips") / f"{name}.bvh" for name in names]
    assert list(tags_in_names(files).values()) == expected
    assert list(tags_of(files).values()) == expected


def test_people_come_from_a_table(tmp_path: Path) -> None:
    files = [tmp_path / "a" / "x_kick.bvh", tmp_path / "b" / "y_hop.bvh"]
    table = tmp_path / "labels.csv"
    table.write_text("clip,label,person\nx_kick,foot,ann\ny_hop,legs,bob\n")
    assert list(tags_of(files, table=table).values()) == [("foot", "ann"), ("legs", "bob")]
    assert list(tags_of(files).values()) == [("a", ""), ("b", "")]
