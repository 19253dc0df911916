"""Left and right: mirrored motions, classes and sensors give the mirrored result."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.retrieval_motions import MIRROR
from tests.test_inertial_calibration import take_of
from tests.test_stabilising_priors import BODY, example_of
from toolkit.body import skeleton
from toolkit.database.canonical import mirrored
from toolkit.inertial.calibrate import CalibrationSequence, calibrate
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.class_motion import ANGLE_COUNT, ANGLES, ClassMotion
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import relational_features

NAMES = ("knee_to_elbow", "semaphore")


def other_side(name: str) -> str:
    """Return the limb of the other side; the same name for the trunk."""
    sides = {"left": "right", "right": "left"}
    side, _, part = name.partition("_")
    return f"{sides[side]}_{part}" if side in sides else name


def mirrored_take(take: CalibrationSequence) -> CalibrationSequence:
    """Return the sequence mirrored at x = 0: left and right exchanged."""
    rows = [skeleton.JOINT_NAMES.index(other_side(name)) for name in skeleton.JOINT_NAMES]
    rotations = take.motion.rotations[:, rows] * np.outer([-1.0, 1.0, 1.0], [-1.0, 1.0, 1.0])
    origins = take.motion.origins[:, rows] * (-1.0, 1.0, 1.0)
    return replace(take, motion=replace(take.motion, rotations=rotations, origins=origins))


def mirrored_angles(angles: np.ndarray) -> np.ndarray:
    """Return joint angles (N, A) mirrored."""
    poses = np.zeros((len(angles), skeleton.POSE_SIZE))
    poses[:, ANGLES] = angles
    return mirrored(poses)[:, ANGLES]


def mirrored_class(plain: MotionClass) -> MotionClass:
    """Return the class of the mirrored motion: features and angles of the other side."""
    turn, motion = mirrored_angles(np.eye(ANGLE_COUNT)), plain.motion
    assert motion is not None
    return replace(
        plain,
        template=replace(plain.template, values=plain.template.values[MIRROR]),
        motion=ClassMotion(
            motion.mean @ turn, np.abs(motion.spread @ turn), turn.T @ motion.covariance @ turn, motion.memory
        ),
    )


def test_a_class_learnt_from_a_mirrored_clip_is_the_mirrored_class():
    for name in NAMES:
        example = example_of(name, 2)
        poses = mirrored(example.poses)
        features = relational_features(from_poses(poses, BODY, 30.0, name))
        (plain,) = learn_classes({name: [example.features]}, poses={name: [example.poses]})
        (learnt,), wanted = learn_classes({name: [features]}, poses={name: [poses]}), mirrored_class(plain)
        # "hand moving forwards" is measured against the left hip for both sides (F1, F2): it has no exact mirror image
        np.testing.assert_array_equal(learnt.template.values[2:], wanted.template.values[2:])
        np.testing.assert_allclose(learnt.motion.mean, wanted.motion.mean, atol=1e-9)


def flipped(rotation: Rotation) -> Rotation:
    """Return a rotation mirrored at x = 0."""
    return Rotation.from_rotvec(rotation.as_rotvec() * [1.0, -1.0, -1.0])


@given(st.integers(0, 1000))
@settings(max_examples=4, deadline=None)
def test_a_mirrored_take_with_mirrored_sensors_has_the_mirrored_calibration(seed):
    _, take = take_of(noise="mtx", limbs=("left_forearm", "right_shin"), seed=seed)
    streams = tuple(
        replace(stream, name=other_side(stream.name), rotations=flipped(stream.rotations)) for stream in take.sensors
    )
    other: CalibrationSequence = replace(mirrored_take(take), sensors=replace(take.sensors, streams=streams))
    plain, found = calibrate([take]), calibrate([other])
    for stream in take.sensors:
        across = found.mounting(other_side(stream.name))
        assert np.degrees((across.inv() * flipped(plain.mounting(stream.name))).magnitude()) < 0.1
