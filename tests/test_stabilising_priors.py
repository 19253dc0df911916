"""Priors of labels for hidden limbs: alignments, class motions, gaps, bridges as conditioned Gaussians."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.archives import load_archive, save_archive
from toolkit.io.errors import RetrievalError
from toolkit.mocap.procedural import procedural_clips
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.class_motion import ANGLES, Example, learn_motion
from toolkit.retrieval.annotation.classes import learn_classes, load_classes, save_classes
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.priors.allocation import Allocation, allocate, best_end, unknown_rows
from toolkit.retrieval.priors.expectation import End, GapContext, bridge, fill
from toolkit.retrieval.priors.gaps import Gap, find_gaps
from toolkit.retrieval.priors.limb_entries import ENTRIES, LIMBS
from toolkit.retrieval.templates import MotionTemplate, QuantisedTemplate

BODY = load_body("neutral")


def document_of(rng: np.random.Generator, columns: int) -> np.ndarray:
    return rng.integers(0, 64, columns).astype(np.uint64)


def template_of(rng: np.random.Generator, columns: int) -> QuantisedTemplate:
    values = rng.choice([-1, 0, 1], size=(40, columns), p=[0.3, 0.4, 0.3]).astype(np.int8)
    return QuantisedTemplate(values, np.ones(columns))


def cheapest_by_hand(template: QuantisedTemplate, words: np.ndarray, unknown: np.ndarray) -> float:
    """Return the cheapest alignment that ends in the last column, by trying every path."""
    bits, mask, scale = template.packed

    def cell(i: int, j: int) -> float:
        known = int(mask[i]) & ~int(unknown[j])
        share = max(int(mask[i]).bit_count(), 1) / max(known.bit_count(), 1)
        return float(scale[i]) * share * ((int(words[j]) ^ int(bits[i])) & known).bit_count()

    def to(i: int, j: int) -> float:
        if i == 0:
            return cell(0, j)
        ways = [to(i - 1, j - 1)] if j >= 1 else []
        ways += [to(i - 1, j - 2)] if j >= 2 else []
        ways += [to(i - 2, j - 1) + cell(i, j)] if i >= 2 and j >= 1 else []
        return min(ways, default=np.inf) + cell(i, j)

    return to(len(template) - 1, len(words) - 1)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("hidden", (False, True))
def test_a_segment_is_aligned_as_the_cheapest_of_all_paths_to_its_end(seed, hidden):
    rng = np.random.default_rng(seed)
    template, words = template_of(rng, 5), document_of(rng, 7)
    unknown = document_of(rng, 7) if hidden else np.zeros(7, dtype=np.uint64)
    cost, columns = best_end(template, words, unknown)
    by_hand = [cheapest_by_hand(template, words[:stop], unknown) for stop in (6, 7)]
    assert cost == pytest.approx(min(by_hand))
    if not hidden:
        assert cost == min(template.distance(words)[0][-2:])
    inside = columns[columns >= 0]
    assert inside[0] == 0 and inside[-1] == len(template) - 1
    assert (np.diff(inside) >= 0).all() and (np.diff(inside) <= 2).all()


def gaussian_bridge(times: np.ndarray, memory: float, offsets: list[tuple[float, float, float]], spread: float):
    """Return mean and variance of an Ornstein-Uhlenbeck process with values at some times, by conditioning a
    Gaussian.
    """
    known = np.array([time for time, _, _ in offsets])
    values = np.array([value for _, value, _ in offsets])
    across = spread**2 * np.exp(-np.abs(times[:, None] - known[None]) / memory)
    gain = across @ np.linalg.inv(spread**2 * np.exp(-np.abs(known[:, None] - known[None]) / memory))
    own = np.array([variance for _, _, variance in offsets])
    return gain @ values, spread**2 - (gain * across).sum(axis=1) + gain**2 @ own


@pytest.mark.parametrize("ends", ("both", "start", "end"))
@pytest.mark.parametrize("memory", (0.2, 1.5))
def test_a_bridge_is_a_gaussian_conditioned_on_the_ends(ends, memory):
    times, length, spread = np.arange(1, 12) / 30.0, 12 / 30.0, 0.3
    first, last = End(np.array([0.4]), np.array([0.01])), End(np.array([-0.2]), np.array([0.02]))
    start, end = (first if ends != "end" else None), (last if ends != "start" else None)
    offsets = [(0.0, 0.4, 0.01)] * (start is not None) + [(length, -0.2, 0.02)] * (end is not None)
    found = bridge(np.ones((11, 1)), np.full((11, 1), spread), memory, times, length, start, end)
    mean, variance = gaussian_bridge(times, memory, offsets, spread)
    np.testing.assert_allclose(found.mean[:, 0], 1.0 + mean, atol=1e-12)
    np.testing.assert_allclose(found.variance[:, 0], variance, atol=1e-12)


@given(st.floats(0.05, 3.0), st.floats(0.1, 20.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_a_bridge_passes_through_both_ends_and_forgets_them_far_away(memory, length, left, right):
    sure = np.zeros(1)
    u = np.array([0.0, length / 2, length])
    found = bridge(
        np.full((3, 1), 0.7), np.full((3, 1), 0.5), memory, u, length, End(np.array([left]), sure),
        End(np.array([right]), sure),
    )  # fmt: skip
    np.testing.assert_allclose(found.mean[[0, 2], 0], [0.7 + left, 0.7 + right], atol=1e-9)
    assert (found.variance <= 0.25 + 1e-12).all() and (found.variance >= 0.0).all()
    assert abs(found.mean[1, 0] - 0.7) <= 2.0 * np.exp(-0.5 * length / memory) * max(abs(left), abs(right)) + 1e-9


@cache
def example_of(name: str, seed: int = 0, rate: float = 30.0, frames: int | None = None) -> Example:
    poses = procedural_clips([name], rate=rate, body=BODY, seed=seed)[0].poses[:frames]
    return Example(relational_features(from_poses(poses, BODY, 30.0, name)), poses)


def test_a_class_of_equal_clips_has_that_clip_as_its_motion():
    example = example_of("knee_to_elbow")
    example = Example(example.features.sliced(0, 60), example.poses[:60])
    template = MotionTemplate.of([example.features] * 3)
    motion = learn_motion(template, [example] * 3)
    assert len(motion) == 60
    np.testing.assert_allclose(motion.mean, example.poses[:, ANGLES], atol=1e-9)
    np.testing.assert_allclose(motion.covariance, 0.0, atol=1e-12)


def test_a_class_motion_lies_between_clips_of_different_speeds():
    slow, fast = example_of("knee_to_elbow", rate=36.0), example_of("knee_to_elbow", rate=30.0)
    template = MotionTemplate.of([slow.features, fast.features])
    motion = learn_motion(template, [slow, fast])
    knee = skeleton.POSE_NAMES.index("left_knee_rx")
    reach = [np.ptp(e.poses[:, knee]) for e in (slow, fast)]
    assert np.ptp(motion.mean[:, knee - 6]) > 0.8 * min(reach)
    assert motion.spread.max() < 0.6


@cache
def classes_of(*names: str, frames: int | None = None) -> list[MotionClass]:
    examples = {name: [example_of(name, seed, frames=frames) for seed in (0, 1)] for name in names}
    return learn_classes(
        {name: [e.features for e in found] for name, found in examples.items()},
        poses={name: [e.poses for e in found] for name, found in examples.items()},
    )


def test_classes_keep_their_motions_in_their_file(tmp_path):
    classes = classes_of("knee_to_elbow", "semaphore")
    save_classes(tmp_path / "classes.npz", classes)
    for before, after in zip(classes, load_classes(tmp_path / "classes.npz"), strict=True):
        for name in ("mean", "spread", "covariance", "memory"):
            np.testing.assert_array_equal(getattr(after.motion, name), getattr(before.motion, name))


def test_classes_of_another_body_are_refused(tmp_path):
    save_classes(tmp_path / "classes.npz", classes_of("knee_to_elbow"))
    arrays = load_archive(tmp_path / "classes.npz", RetrievalError, "")
    header = json.loads(str(arrays["header"])) | {"body": "0123"}
    save_archive(tmp_path / "other.npz", arrays | {"header": np.array(json.dumps(header))})
    with pytest.raises(RetrievalError, match=r"learned with another body \(0123, here .*\); learn it with"):
        load_classes(tmp_path / "other.npz")


def confidence_of(frames: int, limb: str, *gaps: tuple[int, int]) -> np.ndarray:
    confidence = np.full((frames, 20), 0.9)
    for start, stop in gaps:
        confidence[start:stop, skeleton.OUTER[limb]] = 0.3
    return confidence


def test_gaps_are_where_a_limb_has_no_support():
    confidence = confidence_of(60, "left_arm", (20, 40))
    (gap,) = find_gaps(confidence, np.ones(60, bool))
    assert gap.limb == "left_arm" and abs(gap.start - 20) <= 2 and abs(gap.stop - 40) <= 2


def test_a_gap_ends_where_no_person_is_there():
    present = np.ones(60, dtype=bool)
    present[30:35] = False
    found = find_gaps(confidence_of(60, "left_arm", (20, 50)), present, 1)
    assert found == [Gap("left_arm", 20, 30), Gap("left_arm", 35, 50)]


def told_of(poses: np.ndarray, hidden: dict[str, np.ndarray], classes=(), segments=()) -> GapContext:
    features = relational_features(from_poses(poses, BODY, 30.0, "take"))
    allocation = allocate(features, segments, classes, unknown_rows(hidden, len(features)))
    return GapContext(poses, np.arange(len(poses)) / 30.0, hidden, allocation, classes)


def hiding(frames: int, limb: str, start: int, stop: int) -> dict[str, np.ndarray]:
    flags = {name: np.zeros(frames, dtype=bool) for name in LIMBS}
    flags[limb][start:stop] = True
    return flags


def test_a_labelled_limb_is_predicted_by_its_class():
    classes = classes_of("knee_to_elbow", "semaphore")
    poses = example_of("semaphore", 2).poses
    wrong = poses.copy()
    gap = Gap("left_arm", 20, len(poses) - 20)
    rows, entries = slice(gap.start, gap.stop), ENTRIES["left_arm"]
    wrong[rows, entries] = wrong[19, entries]
    hidden = hiding(len(poses), *gap)
    told = told_of(wrong, hidden, classes, [Segment(0.0, len(poses) / 30.0, "semaphore")])
    (by_class, source), (straight, plain) = fill(told, gap), fill(told_of(wrong, hidden), gap)
    assert source == "class" and plain == "interpolation"

    def error(angles: np.ndarray) -> float:
        return float(np.abs(angles - poses[rows, entries]).mean())

    assert error(by_class.mean) < 0.6 * min(error(straight.mean), error(wrong[rows, entries]))


def test_repetitions_alone_tell_a_limb_where_it_was_seen_before():
    one = example_of("semaphore", 2).poses
    poses = np.concatenate([one, one])
    gap = Gap("right_arm", len(one) + 20, 2 * len(one) - 20)
    wrong = poses.copy()
    wrong[gap.start : gap.stop, ENTRIES["right_arm"]] = 0.0
    half = len(one) / 30.0
    segments = [Segment(0.0, half, "semaphore"), Segment(half, 2 * half, "semaphore")]
    plain = [replace(c, motion=None) for c in classes_of("semaphore")]
    found, source = fill(told_of(wrong, hiding(len(poses), *gap), plain, segments), gap)
    assert source == "repetitions"
    away = np.abs(found.mean - poses[gap.start : gap.stop, ENTRIES["right_arm"]])
    assert np.median(away) < 0.15


def test_a_label_of_no_class_cannot_be_allocated():
    features = FeatureMatrix("x", np.zeros((40, 30), dtype=bool))
    with pytest.raises(RetrievalError, match="'jump' is not one of the classes"):
        allocate(features, [Segment(0, 1, "jump")], classes_of("semaphore"))
    assert (Allocation.nothing(3).label == -1).all()
