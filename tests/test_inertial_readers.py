"""Readers of sensor files against small handwritten files: a good one and bad ones per format."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.body.rotations import quaternions as quat
from toolkit.inertial.readers import read_file, read_files
from toolkit.inertial.readers.base import SensorOptions
from toolkit.inertial.stream import GRAVITY
from toolkit.io.errors import InertialError, UsageError

TURNED = quat.exponential(np.array([[0.1, 0.2, 0.3], [0.2, 0.2, 0.3], [0.3, 0.2, 0.3], [0.4, 0.2, 0.3]]))
MT_HEADER = "// Start Time: Unknown\n// Update Rate: 100.0Hz\n// Firmware Version: 4.0.2\n"


def cells(values) -> str:
    return "\t".join(f"{value:.6f}" for value in values)


def write(path, text):
    path.write_text(text)
    return path


def mt_matrix_file(folder, counters=(65534, 65535, 0, 2)):
    names = "\t".join(f"Mat[{row}][{column}]" for column in (1, 2, 3) for row in (1, 2, 3))
    rows = [
        f"{counter:05d}\t\tNaN\t{cells([1, 2, 9])}\t{cells([0.1, 0.2, 0.3])}\t{cells(quat.matrices(q).T.ravel())}"
        for counter, q in zip(counters, TURNED, strict=True)
    ]
    header = f"PacketCounter\tSampleTimeFine\tYear\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\t{names}"
    return write(folder / "MT_012005D6_009-001_00B421AF.txt", MT_HEADER + "\n".join([header, *rows]) + "\n")


def test_an_mt_file_is_timed_by_its_counter_which_wraps_and_skips(tmp_path):
    sensors = read_file(mt_matrix_file(tmp_path))
    (stream,) = sensors
    assert stream.name == "00B421AF"
    np.testing.assert_allclose(stream.times - stream.times[0], [0.0, 0.01, 0.02, 0.04], atol=1e-9)
    np.testing.assert_allclose(quat.angle(stream.rotations, TURNED), 0.0, atol=1e-5)
    np.testing.assert_allclose(stream.acceleration[0], [1, 2, 9])
    np.testing.assert_array_equal(sensors.world_up, [0, 0, 1])


def mvnx(frames: str, segments: str = '<segment label="Pelvis" id="1"/><segment label="RightForeArm" id="2"/>') -> str:
    return (
        '<?xml version="1.0" encoding="UTF-8"?><mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">'
        f'<subject label="S" frameRate="60"><segments>{segments}</segments><frames>{frames}</frames></subject></mvnx>'
    )


def mvnx_frame(kind, index, time, first=(1, 0, 0, 0), second=(1, 0, 0, 0)):
    numbers = " ".join(f"{v:.6f}" for v in (*first, *second))
    return f'<frame time="{time}" index="{index}" type="{kind}"><orientation>{numbers}</orientation></frame>'


def test_an_mvnx_file_starts_where_its_calibration_poses_end(tmp_path):
    frames = "".join(mvnx_frame(kind, "", 0) for kind in ("identity", "tpose", "npose"))
    frames += "".join(mvnx_frame("normal", i, 17 * i, second=q) for i, q in enumerate(TURNED))
    sensors = read_file(write(tmp_path / "take.mvnx", mvnx(frames)))
    assert sensors.names == ("Pelvis", "RightForeArm")
    np.testing.assert_allclose(sensors.streams[1].times, [0, 0.017, 0.034, 0.051])
    np.testing.assert_allclose(quat.angle(sensors.streams[1].rotations, TURNED), 0.0, atol=1e-5)


@pytest.mark.parametrize(
    ("text", "message"),
    (
        (mvnx("")[:-20], "no complete XML"),
        (mvnx(mvnx_frame("npose", "", 0) * 3), "holds 0 frames of the type normal"),
        (mvnx(mvnx_frame("normal", 0, 0, (1, 0)) * 2), "6 numbers of orientation for 2 segments"),
        ('<!DOCTYPE x [<!ENTITY a "b">]>' + mvnx(""), "XML entities"),
        (mvnx(mvnx_frame("normal", 0, "G7") * 2), "time of a frame in .* is 'G7' and no number"),
        (mvnx(mvnx_frame("normal", "1p", 0) * 2), "index of a frame in .* is '1p' and no number"),
        (mvnx(mvnx_frame("normal", 0, 0) * 2).replace('"60"', '"6["'), "frameRate of a subject in .* no number"),
    ),
)
def test_a_bad_mvnx_file_is_refused(tmp_path, text, message):
    with pytest.raises(InertialError, match=message):
        read_file(write(tmp_path / "take.mvnx", text))


def save_mat(path, **arrays):
    from scipy.io import savemat

    savemat(path, arrays)
    return path


@pytest.mark.parametrize(("action", "limb"), ((1, "right_forearm"), (21, "right_forearm"), (22, "right_thigh")))
def test_a_utd_mhad_file_is_on_the_wrist_or_the_thigh_by_its_action(tmp_path, action, limb):
    path = save_mat(tmp_path / f"a{action}_s1_t1_inertial.mat", d_iner=np.tile([0, 0, 1, 180, 0, 0], (5, 1)))
    (stream,) = read_file(path)
    assert stream.name == limb
    np.testing.assert_allclose(stream.times, np.arange(5) / 50)
    np.testing.assert_allclose(stream.acceleration[0], [0, 0, GRAVITY])
    np.testing.assert_allclose(stream.gyro[0], [np.pi, 0, 0])


def test_a_czu_mhad_file_has_ten_sensors_on_a_clock_that_may_pass_midnight(tmp_path):
    values = np.column_stack([np.tile([0, 0, 1, 180, 0, 0], (4, 1)), [86399.99, 86399.995, 0.0, 0.005]])
    cells = np.empty((10, 1), dtype=object)
    cells[:, 0] = [values] * 10
    sensors = read_file(save_mat(tmp_path / "a01_s01_e01_sensor.mat", sensor=cells))
    assert sensors.names[:4] == ("chest", "pelvis", "left_upper_arm", "left_forearm")
    np.testing.assert_allclose(np.diff(sensors.streams[0].times), 0.005, atol=1e-6)


def test_a_czu_mhad_text_names_its_sensor_by_its_number(tmp_path):
    (stream,) = read_file(write(tmp_path / "pi03", "0 0 1 0 0 90 100.0\n0 0 1 0 0 90 100.003\n"))
    assert stream.name == "left_forearm"
    np.testing.assert_allclose(stream.gyro[0], [0, 0, np.pi / 2])


def test_any_csv_is_read_with_its_columns_and_units_declared(tmp_path):
    rows = [f"{10 * i},A,{','.join(f'{v:.6f}' for v in q)},90,0,0,0,0,1" for i, q in enumerate(TURNED)]
    path = write(tmp_path / "own.csv", "\n".join(["ms,who,a,b,c,d,u,v,w,x,y,z", *rows]))
    columns = "time_s=ms,sensor=who,qw=a,qx=b,qy=c,qz=d,gx=u,gy=v,gz=w,ax=x,ay=y,az=z"
    (stream,) = read_file(path, SensorOptions(columns=columns, units="time=ms,gyro=deg/s,acceleration=g"))
    assert stream.name == "A"
    np.testing.assert_allclose(stream.times, [0, 0.01, 0.02, 0.03])
    np.testing.assert_allclose(stream.gyro[0], [np.pi / 2, 0, 0])
    np.testing.assert_allclose(stream.acceleration[0], [0, 0, GRAVITY])
    np.testing.assert_allclose(quat.angle(stream.rotations, TURNED), 0.0, atol=1e-5)


@pytest.mark.parametrize(
    ("text", "options", "error", "message"),
    (
        ("", {}, InertialError, "is empty"),
        ("a,b\n1,2\n", {}, InertialError, "has no column time_s; it has: a, b"),
        ("time_s,a\n0,1\n1,1\n", {}, InertialError, "neither orientations nor a gyroscope"),
        ("time_s,a\n0,1\n", {"units": "gyro=turns"}, UsageError, "knows no gyro=turns"),
        ("time_s,a\n0,1\n", {"columns": "when=a"}, UsageError, "--columns names when"),
        ("time_s,a\n0,1\n", {"columns": "nonsense"}, UsageError, "write pairs such as"),
    ),
)
def test_a_bad_table_is_refused(tmp_path, text, options, error, message):
    with pytest.raises(error, match=message):
        read_file(write(tmp_path / "bad.csv", text), SensorOptions(**options))


def test_files_that_are_missing_unknown_or_of_two_worlds_are_refused(tmp_path):
    with pytest.raises(InertialError, match="there is no file"):
        read_file(tmp_path / "nothing.csv")
    with pytest.raises(InertialError, match="has no known sensor format"):
        read_file(write(tmp_path / "notes.md", "hello"))
    with pytest.raises(UsageError, match="unknown sensor format 'wii'"):
        read_file(tmp_path / "notes.md", SensorOptions(format="wii"))
    up = write(tmp_path / "a.txt", MT_HEADER + "PacketCounter\tRoll\tPitch\tYaw\n1\t0\t0\t0\n2\t0\t0\t0")
    down = write(tmp_path / "b.txt", up.read_text().replace("//", "// Coordinate system: NED\n//", 1))
    with pytest.raises(InertialError, match="the vertical of .*b.txt"):
        read_files([up, down])
    with pytest.raises(UsageError, match="no sensor file is named"):
        read_files([])
