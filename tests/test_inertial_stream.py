"""Sensor streams: marked, omitted and rejected rows; round trip of the canonical file."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.inertial_scenes import sensors_of
from tests.sample_files import write_csv
from toolkit.inertial.placement import limb_named, load_placement, placed
from toolkit.inertial.sensor_files import read_file
from toolkit.inertial.stream import Sensors, checked_stream
from toolkit.io.errors import InertialError

TIMES = np.arange(10) / 100


def turning(count: int = 10) -> np.ndarray:
    return Rotation.from_rotvec(np.arange(count)[:, None] * [0.01, 0.02, 0.03]).as_quat(scalar_first=True)


def degrees_between(first: Rotation, second: Rotation) -> np.ndarray:
    return np.degrees((first.inv() * second).magnitude())


def test_the_canonical_file_there_and_back(tmp_path):
    sensors = sensors_of(noise="mtx").sensors
    sensors.save(tmp_path / "sensors.npz")
    again = Sensors.load(tmp_path / "sensors.npz")
    assert again.names == sensors.names
    assert again.devices == sensors.devices
    for ours, theirs in zip(sensors, again, strict=True):
        np.testing.assert_array_equal(ours.times, theirs.times)
        assert degrees_between(ours.rotations, theirs.rotations).max() < 1e-12
        np.testing.assert_array_equal(ours.gyro, theirs.gyro)
        np.testing.assert_array_equal(ours.valid, theirs.valid)


def test_a_csv_has_the_same_content(tmp_path):
    sensors = sensors_of(noise="mtx").sensors
    write_csv(tmp_path / "sensors.csv", sensors)
    again = read_file(tmp_path / "sensors.csv")
    assert again.names == sensors.names
    for ours, theirs in zip(sensors, again, strict=True):
        np.testing.assert_allclose(ours.times, theirs.times, atol=1e-6)
        assert degrees_between(ours.rotations, theirs.rotations).max() < 1e-4
        np.testing.assert_allclose(ours.acceleration, theirs.acceleration, rtol=1e-5, atol=1e-5)


def test_rows_of_zeros_and_of_nan_are_marked_and_not_used():
    rotations = turning()
    rotations[3], rotations[6] = 0.0, np.nan
    stream = checked_stream("left_shin", TIMES, rotations=rotations)
    assert np.flatnonzero(~stream.valid).tolist() == [3, 6]
    found, known = stream.at(TIMES)
    assert known.all()
    assert degrees_between(found, Rotation.from_quat(turning(), scalar_first=True)).max() < 0.01


def test_duplicate_packets_are_left_out():
    rows = [0, 1, 2, 2, 2, 3, 4]
    stream = checked_stream("left_shin", TIMES[rows], rotations=turning()[rows])
    np.testing.assert_array_equal(stream.times, TIMES[:5])


def test_nothing_is_interpolated_over_more_than_a_tenth_of_a_second():
    times = np.array([0.0, 0.1, 0.2, 0.5, 0.6])
    stream = checked_stream("left_shin", times, rotations=turning(5))
    _, known = stream.at(np.array([0.05, 0.2, 0.3, 0.45, 0.55, 0.7, -0.1]))
    assert known.tolist() == [True, False, False, False, True, False, False]
    assert stream.gaps == 1


def test_single_flips_of_sign_change_nothing():
    rotations = turning()
    rotations[4] *= -1
    found, _ = checked_stream("left_shin", TIMES, rotations=rotations).at(TIMES[:-1] + 0.005)
    expected, _ = checked_stream("left_shin", TIMES, rotations=turning()).at(TIMES[:-1] + 0.005)
    assert degrees_between(found, expected).max() < 1e-5


def test_a_stream_of_nothing_usable_is_refused():
    with pytest.raises(InertialError, match="0 usable rows"):
        checked_stream("left_shin", TIMES, gyro=np.full((10, 3), np.nan))
    with pytest.raises(InertialError, match="neither orientations nor a gyroscope"):
        checked_stream("left_shin", TIMES, acceleration=np.ones((10, 3)))
    with pytest.raises(InertialError, match="expected \\(10, 4\\)"):
        checked_stream("left_shin", TIMES, rotations=np.ones((10, 3)))


@pytest.mark.parametrize(
    ("foreign", "ours"),
    (
        ("L_LowArm", "left_forearm"), ("R_UpLeg", "right_thigh"), ("RightForeArm", "right_forearm"),
        ("LeftUpperArm", "left_upper_arm"), ("femur_r_imu", "right_thigh"), ("tibia_l_imu", "left_shin"),
        ("calcn_r_imu", "right_foot"), ("pelvis_imu", "pelvis"), ("torso_imu", "chest"), ("Sternum", "chest"),
        ("T8", "chest"), ("left_shin", "left_shin"), ("Head", "head"), ("ulna_r_imu", "right_forearm"),
        ("00B421AF", None), ("wrist", None), ("left", None), ("L5", None),
    ),
)  # fmt: skip
def test_foreign_names_of_parts_of_the_body_are_known(foreign, ours):
    assert limb_named(foreign) == ours


def test_a_placement_gives_limbs_and_selected_sensors(tmp_path):
    streams = tuple(checked_stream(name, TIMES, rotations=turning()) for name in ("00A1", "00B2", "00C3"))
    (tmp_path / "placement.yaml").write_text("00A1: left_shin\n00C3: pelvis\n")
    sensors = placed(Sensors(streams), load_placement(tmp_path / "placement.yaml"))
    assert sensors.names == ("left_shin", "pelvis")
    assert sensors.devices == {"left_shin": "00A1", "pelvis": "00C3"}


@pytest.mark.parametrize(
    ("text", "message"),
    (
        ("00A1: left_tail", "no part of the body is called 'left_tail'"),
        ("00A1: left_shin\n00B2: left_shin", "two sensors are placed on left_shin"),
        ("- 00A1", "no table of sensors"),
        ("{", "the placement .* is no YAML"),
    ),
)
def test_a_placement_that_cannot_be_is_refused(tmp_path, text, message):
    (tmp_path / "placement.yaml").write_text(text)
    with pytest.raises(InertialError, match=message):
        load_placement(tmp_path / "placement.yaml")


def test_a_sensor_on_no_limb_is_refused_with_the_line_to_write():
    sensors = Sensors((checked_stream("00A1", TIMES, rotations=turning()),))
    with pytest.raises(InertialError, match="--placement with a line such as 00A1: left_shin"):
        placed(sensors)
    with pytest.raises(InertialError, match="names 00B2, but the sensors are 00A1"):
        placed(sensors, {"00B2": "left_shin"})
