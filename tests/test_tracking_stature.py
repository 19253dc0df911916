"""Size of a person whose body is not known yet."""

import numpy as np
import pytest

from toolkit.body import skeleton
from toolkit.body.shape import ShapeSpace
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.tracking.stature import likeliest_size

SPACE = ShapeSpace.load()
BODIES = [SPACE.body(SPACE.typical(stature)) for stature in (1.84, 1.71, 1.58, 1.28, 0.85)]


@pytest.mark.parametrize("number", range(len(BODIES)))
def test_the_size_is_that_of_the_estimated_bones(number: int) -> None:
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[skeleton.POSE_NAMES.index("left_elbow_ry")] = 1.0
    points, reliability = BODIES[number].joint_positions(pose), np.ones(20)
    hidden = skeleton.REPORTED.index("right_foot")
    points[hidden] += 1.0
    reliability[hidden] = 0.0
    assert likeliest_size(BODIES, JointEstimate(points, reliability, reliability=reliability)) is BODIES[number]


def test_without_joints_it_is_the_most_probable_one() -> None:
    assert likeliest_size(BODIES, None) is BODIES[1]
