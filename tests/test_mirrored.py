"""Left and right: mirrored motions, classes and sensors give the mirrored result."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.test_inertial_calibration import take_of
from tests.test_retrieval_priors import BODY, classes_of, example_of, hiding, told_of
from toolkit.body import skeleton
from toolkit.database.canonical import mirrored
from toolkit.inertial import quaternions as quat
from toolkit.inertial.calibrate import Take, calibrate
from toolkit.inertial.places import mirrored_take, other_side
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.class_motion import ANGLES, ClassMotion, Example
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import MIRROR, relational_features
from toolkit.retrieval.priors.expectation import fill
from toolkit.retrieval.priors.gaps import Gap
from toolkit.retrieval.priors.limbs import ENTRIES, LIMBS
from toolkit.retrieval.priors.marks import marks_of_classes, tracking_priors

NAMES = ("knee_to_elbow", "semaphore")


def mirrored_example(example: Example) -> Example:
    poses = mirrored(example.poses)
    return Example(relational_features(from_poses(poses, BODY, 30.0, "mirrored")), poses)


@cache
def mirrored_classes() -> list[MotionClass]:
    examples = {name: [mirrored_example(example_of(name, seed)) for seed in (0, 1)] for name in NAMES}
    return learn_classes(
        {name: [e.features for e in own] for name, own in examples.items()},
        poses={name: [e.poses for e in own] for name, own in examples.items()},
    )


def mirrored_angles(angles: np.ndarray) -> np.ndarray:
    poses = np.zeros((len(angles), skeleton.POSE_SIZE))
    poses[:, ANGLES] = angles
    return mirrored(poses)[:, ANGLES]


def test_a_class_of_mirrored_clips_is_the_mirrored_class():
    for plain, other in zip(classes_of(*NAMES), mirrored_classes(), strict=True):
        np.testing.assert_array_equal(other.templates[0].values, plain.templates[0].values[MIRROR])
        ours: ClassMotion = plain.motions[0]
        np.testing.assert_allclose(other.motions[0].mean, mirrored_angles(ours.mean), atol=1e-9)
        np.testing.assert_allclose(other.motions[0].spread, np.abs(mirrored_angles(ours.spread)), atol=1e-9)


@given(st.sampled_from(LIMBS), st.sampled_from(NAMES), st.integers(5, 40), st.integers(4, 25))
@settings(max_examples=12, deadline=None)
def test_a_mirrored_track_is_filled_with_the_mirrored_motion(limb, name, start, length):
    poses = example_of(name, 2).poses
    segments = [Segment(0.0, len(poses) / 30.0, name)]
    gap, across = Gap(limb, start, start + length), Gap(other_side(limb), start, start + length)
    told = told_of(poses, hiding(len(poses), *gap), classes_of(*NAMES), segments)
    other = told_of(mirrored(poses), hiding(len(poses), *across), mirrored_classes(), segments)
    (ours, source), (theirs, same) = fill(told, gap), fill(other, across)
    assert source == same
    whole = np.zeros((length, skeleton.POSE_SIZE))
    whole[:, ENTRIES[limb]] = ours.mean
    np.testing.assert_allclose(theirs.mean, mirrored(whole)[:, ENTRIES[across.limb]], atol=1e-9)
    whole[:, ENTRIES[limb]] = ours.variance
    np.testing.assert_allclose(theirs.variance, np.abs(mirrored(whole)[:, ENTRIES[across.limb]]), atol=1e-9)
    priors = tracking_priors(told.allocation, told.classes, marks_of_classes(told.classes))
    others = tracking_priors(other.allocation, other.classes, marks_of_classes(other.classes))
    np.testing.assert_array_equal(others, priors[MIRROR])


@given(st.integers(0, 1000))
@settings(max_examples=4, deadline=None)
def test_a_mirrored_take_with_mirrored_sensors_has_the_mirrored_calibration(seed):
    _, take = take_of(noise="mtx", limbs=("left_forearm", "right_shin"), seed=seed)
    flip = np.array([1.0, 1.0, -1.0, -1.0])  # a rotation in a mirror at x = 0
    streams = tuple(
        replace(stream, name=other_side(stream.name), rotations=stream.rotations * flip) for stream in take.sensors
    )
    other: Take = replace(mirrored_take(take), sensors=replace(take.sensors, streams=streams))
    plain, found = calibrate([take]), calibrate([other])
    for stream in take.sensors:
        across = found.mounting(other_side(stream.name))
        assert np.degrees(quat.angle(across, plain.mounting(stream.name) * flip)) < 0.1
