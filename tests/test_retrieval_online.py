"""Online annotation: features, costs, events, against those of whole motions."""

from functools import lru_cache

import numpy as np
import pytest

from tests.inertial_scenes import RATE
from toolkit.body.shape import ShapeSpace
from toolkit.mocap.procedural import procedural_clips
from toolkit.retrieval.annotation.annotator import Annotator
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.annotation.online import Event, OnlineAnnotator
from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion, from_poses
from toolkit.retrieval.features.relational import quantities_in, quantities_of, relational_features
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery

MOTIONS = {"kick": "knee_to_elbow", "bow": "half_squat_reach", "draw": "archery"}


@lru_cache(maxsize=1)
def body():
    return ShapeSpace.load().body([])


@lru_cache(maxsize=1)
def parts() -> dict[str, np.ndarray]:
    """Return cut stretches of bundled motions, poses (T, P)."""
    cuts = {"kick": (20, 60), "bow": (20, 80), "draw": (30, 90)}
    return {
        label: procedural_clips([name], rate=RATE, body=body(), seed=0)[0].poses[slice(*cuts[label])]
        for label, name in MOTIONS.items()
    }


@lru_cache(maxsize=1)
def classes():
    return learn_classes(
        {label: [relational_features(from_poses(poses, body(), RATE, label))] for label, poses in parts().items()}
    )


@lru_cache(maxsize=1)
def document() -> np.ndarray:
    """Return kick, draw, bow, kick, with eased joins."""
    pieces = [parts()[label] for label in ("kick", "draw", "bow", "kick")]
    out = [pieces[0]]
    for piece in pieces[1:]:
        share = np.linspace(0, 1, 14)[1:-1, None]
        out += [out[-1][-1] + share * (piece[0] - out[-1][-1]), piece]
    return np.concatenate(out)


def told(poses: np.ndarray) -> list[Event]:
    annotator = OnlineAnnotator(classes(), body(), RATE)
    events = [event for i, pose in enumerate(poses) for event in annotator.push(pose, i / RATE)]
    return events + annotator.finish()


@pytest.mark.parametrize("rate", (30.0, 55.0, 18.7))
def test_features_one_by_one_are_those_of_the_whole(rate):
    annotator = OnlineAnnotator(classes(), body(), rate)
    for i, pose in enumerate(document()):
        annotator.push(pose, i / rate)
    annotator.finish()
    whole = relational_features(from_poses(document(), body(), rate, "whole")).values
    found = np.stack(annotator.columns, axis=1)
    np.testing.assert_array_equal(found, whole[:, : found.shape[1]])
    assert whole.shape[1] - found.shape[1] <= 1


@pytest.mark.parametrize("rate", (30.0, 55.0, 8.0))
@pytest.mark.parametrize("frames", (1, 2, 12))
def test_every_quantity_of_a_frame_is_that_of_the_whole_motion(rate, frames):
    rng = np.random.default_rng(frames)
    motion = Motion("any", rng.normal(size=(frames, len(NAMED_JOINTS), 3)), rate, rng.normal(size=(frames, 3)))
    whole = quantities_of(motion)
    for frame in range(frames):
        found = quantities_in(motion.joints, motion.root_axis, frame, rate)
        np.testing.assert_allclose(found, whole[:, frame], rtol=1e-9, atol=1e-6)


def test_an_alignment_that_ends_in_a_column_needs_twice_the_columns_of_its_template():
    words = relational_features(from_poses(document(), body(), RATE, "whole")).words
    for template in (motion_class.template for motion_class in classes()):
        costs, starts = template.distance(words)
        for column in range(len(words)):
            first = max(0, column + 1 - 2 * len(template.packed[0]))
            cost, start = (part[-1] for part in template.distance(words[first : column + 1]))
            assert (cost, first + start) == (costs[column], starts[column]) or cost == costs[column] == np.inf


def test_each_motion_is_reported_once_soon_after_its_end():
    events = told(document())
    assert [event.label for event in events] == ["kick", "draw", "bow", "kick"]
    offline = Annotator(classes()).annotate(relational_features(from_poses(document(), body(), RATE, "whole")))
    for event, segment in zip(events, offline.segments, strict=True):
        assert event.label == segment.label
        assert abs(event.end - segment.end) < 0.3
        assert event.delay == pytest.approx(event.time - event.end)
        assert event.delay < 0.5


def test_a_hit_without_its_keyframes_does_not_count():
    impossible = KeyframeQuery((Keyframe.of({"F1": 1}), Keyframe.of({"F1": 0})), ((0, 0),), label="kick")
    annotator = OnlineAnnotator(classes(), body(), RATE, queries=[impossible])
    events = [e for i, pose in enumerate(document()) for e in annotator.push(pose, i / RATE)] + annotator.finish()
    assert "kick" not in {event.label for event in events}
    assert {"draw", "bow"} <= {event.label for event in events}
