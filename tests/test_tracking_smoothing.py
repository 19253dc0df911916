"""Smoothing of reported poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.io.errors import SettingsError
from toolkit.tracking.smoothing import PoseSmoother


def test_no_time_constant_means_no_smoothing() -> None:
    smoother, rng = PoseSmoother(0.0), np.random.default_rng(0)
    for frame in range(5):
        pose = rng.normal(size=skeleton.POSE_SIZE)
        assert smoother.update(pose, frame / 30) is pose


@pytest.mark.parametrize("rate", [15.0, 30.0, 120.0])
def test_a_steady_motion_lags_by_the_time_constant_at_any_frame_rate(rate: float) -> None:
    smoother, time, speed = PoseSmoother(0.2), 0.2, 0.7
    for frame in range(int(4 * rate)):
        pose = np.full(skeleton.POSE_SIZE, speed * frame / rate)
        pose[skeleton.ROOT_ROTATION] = 0.0
        smoothed = smoother.update(pose, frame / rate)
    lag = (pose[0] - smoothed[0]) / speed
    assert abs(lag - time) < 0.6 / rate


def test_one_long_step_equals_two_short_ones_towards_a_resting_pose() -> None:
    target = np.random.default_rng(1).normal(0.0, 0.5, skeleton.POSE_SIZE)
    outcomes = []
    for times in ([0.1], [0.03, 0.1]):
        smoother = PoseSmoother(0.15)
        smoother.update(np.zeros(skeleton.POSE_SIZE), 0.0)
        for at in times:
            result = smoother.update(target, at)
        outcomes.append(result)
    np.testing.assert_allclose(outcomes[0], outcomes[1], atol=1e-12)


def test_the_root_turns_the_short_way_through_the_back() -> None:
    smoother = PoseSmoother(0.1)
    before, after = np.zeros(skeleton.POSE_SIZE), np.zeros(skeleton.POSE_SIZE)
    before[skeleton.ROOT_ROTATION] = (0.0, np.pi - 0.1, 0.0)
    after[skeleton.ROOT_ROTATION] = (0.0, -np.pi + 0.1, 0.0)
    smoother.update(before, 0.0)
    smoothed = Rotation.from_rotvec(smoother.update(after, 0.05)[skeleton.ROOT_ROTATION])
    back = Rotation.from_rotvec((0.0, np.pi, 0.0))
    assert (smoothed * back.inv()).magnitude() < 0.1


def test_after_a_reset_the_next_pose_is_taken_as_it_is() -> None:
    smoother = PoseSmoother(0.5)
    smoother.update(np.zeros(skeleton.POSE_SIZE), 0.0)
    smoother.last = None
    pose = np.ones(skeleton.POSE_SIZE)
    np.testing.assert_array_equal(smoother.update(pose, 0.1), pose)


def test_a_negative_time_is_refused() -> None:
    with pytest.raises(SettingsError, match="-1"):
        PoseSmoother(-1.0)
