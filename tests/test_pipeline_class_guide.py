"""Classes that guide the tracker while it runs: live alignments, hidden limbs alone, the command line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.test_retrieval_priors import BODY, classes_of, example_of
from toolkit.cli.main import main
from toolkit.errors import RetrievalError, SettingsError
from toolkit.pipeline.class_guide import ClassGuide, ClassGuideSettings
from toolkit.pipeline.rows import Watchers
from toolkit.retrieval.annotation.annotator import PreparedTemplate
from toolkit.retrieval.annotation.classes import save_classes
from toolkit.retrieval.priors.limbs import ENTRIES, OUTER
from toolkit.retrieval.priors.live import LiveAlignment
from toolkit.track import EMPTY, TRACKED, FrameResult

NAMES = ("knee_to_elbow", "semaphore")
FRAMES = 100
HIDDEN = 60


def test_a_motion_that_goes_on_is_known_by_its_beginning():
    classes = classes_of(*NAMES)
    features = example_of("semaphore").features
    live = LiveAlignment(classes, 0.1)
    told = [live.push(word) for word in features.words]
    assert told[0] is None
    late = [going for going in told[len(told) // 2 :] if going is not None]
    assert late and np.mean([classes[going.label].label == "semaphore" for going in late]) > 0.9


def test_the_cost_of_a_whole_template_is_that_of_its_alignment():
    (motion_class,) = classes_of("semaphore")
    features = example_of("semaphore").features
    live = LiveAlignment([motion_class], 1.0)
    told = [live.push(word) for word in features.words]
    template = PreparedTemplate(motion_class.templates[0])
    whole, _ = template.distance(features.words)
    for going, cost in zip(told, whole, strict=True):
        if np.isfinite(cost):
            assert going is not None and going.cost <= cost + 1e-12


def result_of(pose: np.ndarray, *, hidden: bool = False, state: int = TRACKED) -> FrameResult:
    confidence = np.full(20, 0.9, dtype=np.float32)
    if hidden:
        confidence[OUTER["left_arm"]] = 0.4
    return FrameResult(pose, BODY.joint_positions(pose).astype(np.float32), confidence, state, 0, np.zeros(1))


def guided(frames: int = FRAMES, hidden: int = HIDDEN) -> tuple[ClassGuide, np.ndarray]:
    """A guide that saw a semaphore of which the left arm was held from frame `hidden` on, and the true poses."""
    poses = example_of("semaphore", 2).poses
    guide = ClassGuide(classes_of(*NAMES))
    guide.begin(30.0, None, np.empty(0))
    for frame in range(frames):
        pose = poses[frame].copy()
        gone = frame >= hidden
        if gone:
            pose[ENTRIES["left_arm"]] = poses[hidden - 1, ENTRIES["left_arm"]]
        guide.row(result_of(pose, hidden=gone), frame / 30.0, BODY)
    return guide, poses


def test_only_a_hidden_limb_is_proposed():
    guide, _ = guided()
    assert list(guide.expected(FRAMES / 30.0)) == ["left_arm"]
    assert guided(frames=HIDDEN)[0].expected(HIDDEN / 30.0) == {}
    assert guide.priors(FRAMES / 30.0) == ()


def test_what_is_proposed_is_nearer_than_the_limb_held_on():
    guide, poses = guided()
    angles = guide.expected(FRAMES / 30.0)["left_arm"]
    true, held = (poses[frame, ENTRIES["left_arm"]] for frame in (FRAMES, HIDDEN - 1))
    assert np.abs(angles - true).mean() < np.abs(held - true).mean()
    (proposed,) = guide.poses(FRAMES / 30.0, poses[FRAMES])
    np.testing.assert_array_equal(proposed[ENTRIES["left_arm"]], angles)
    others = np.setdiff1d(np.arange(len(proposed)), ENTRIES["left_arm"])
    np.testing.assert_array_equal(proposed[others], poses[FRAMES, others])


def test_who_was_away_is_told_nothing_at_first():
    guide, poses = guided()
    guide.row(result_of(poses[FRAMES], state=EMPTY), FRAMES / 30.0, BODY)
    assert guide.expected((FRAMES + 1) / 30.0) == {}


def test_a_guide_that_goes_on_knows_what_it_knew():
    guide, _ = guided()
    poses = example_of("semaphore", 2).poses
    kinds = [("pose", "f8", (43,)), ("confidence", "f4", (20,)), ("state", "u1"), ("timestamps", "f8")]
    past = np.zeros(FRAMES, dtype=kinds)
    for frame in range(FRAMES):
        row = result_of(poses[frame], hidden=frame >= HIDDEN)
        pose = poses[frame].copy()
        if frame >= HIDDEN:
            pose[ENTRIES["left_arm"]] = poses[HIDDEN - 1, ENTRIES["left_arm"]]
        past[frame] = (pose, row.confidence, TRACKED, frame / 30.0)
    again = ClassGuide(classes_of(*NAMES))
    again.begin(30.0, BODY, past)
    one, other = (g.expected(FRAMES / 30.0)["left_arm"] for g in (guide, again))
    np.testing.assert_array_equal(one, other)


def test_guides_without_motions_and_impossible_ones_are_refused():
    with pytest.raises(RetrievalError, match="holds no class motions"):
        ClassGuide([replace(c, motions=()) for c in classes_of("semaphore")])
    with pytest.raises(SettingsError, match="at least 2 frames"):
        ClassGuideSettings(remembered=1)


def test_watchers_are_told_one_after_the_other():
    told: list[str] = []

    class Watcher:
        def __init__(self, name):
            self.name = name

        def begin(self, frame_rate, body, past):
            told.append(f"{self.name} begins")

        def row(self, result, timestamp, body):
            told.append(f"{self.name} sees")

        def end(self):
            told.append(f"{self.name} ends")

    both = Watchers(Watcher("a"), Watcher("b"))
    both.begin(30.0, None, np.empty(0))
    both.row(result_of(np.zeros(43)), 0.0, BODY)
    both.end()
    assert told == ["a begins", "b begins", "a sees", "b sees", "a ends", "b ends"]


def test_priors_need_classes_and_one_recording(tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["track", "take.npz", "--output", str(tmp_path / "run"), "--priors"])
    assert stopped.value.code == 2 and "name it, and --classes" in capsys.readouterr().err
    save_classes(tmp_path / "plain.npz", [replace(c, motions=()) for c in classes_of("semaphore")])
    words = ("take.npz", "--output", tmp_path / "run", "--priors", "--classes", tmp_path / "plain.npz")
    with pytest.raises(SystemExit) as stopped:
        main(["track", *map(str, words)])
    assert stopped.value.code == 1 and "holds no class motions" in capsys.readouterr().err
