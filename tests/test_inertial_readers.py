"""Readers of sensor files against small handwritten files: a good one and bad ones per format."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from toolkit.inertial.sensor_files import read_file, read_files
from toolkit.inertial.stream import GRAVITY
from toolkit.io.errors import InertialError, UsageError

TURNS = Rotation.from_rotvec([[0.1, 0.2, 0.3], [0.2, 0.2, 0.3], [0.3, 0.2, 0.3], [0.4, 0.2, 0.3]])
TURNED = TURNS.as_quat(scalar_first=True)


def cells(values) -> str:
    return "\t".join(f"{value:.6f}" for value in values)


def write(path, text):
    path.write_text(text)
    return path


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


def test_any_csv_is_read_with_its_columns_and_units_declared(tmp_path):
    rows = [f"{10 * i},A,{','.join(f'{v:.6f}' for v in q)},90,0,0,0,0,1" for i, q in enumerate(TURNED)]
    path = write(tmp_path / "own.csv", "\n".join(["ms,who,a,b,c,d,u,v,w,x,y,z", *rows]))
    columns = "time_s=ms,sensor=who,qw=a,qx=b,qy=c,qz=d,gx=u,gy=v,gz=w,ax=x,ay=y,az=z"
    (stream,) = read_file(path, columns=columns, units="time=ms,gyro=deg/s,acceleration=g")
    assert stream.name == "A"
    np.testing.assert_allclose(stream.times, [0, 0.01, 0.02, 0.03])
    np.testing.assert_allclose(stream.gyro[0], [np.pi / 2, 0, 0])
    np.testing.assert_allclose(stream.acceleration[0], [0, 0, GRAVITY])
    assert (stream.rotations.inv() * TURNS).magnitude().max() < 1e-5


@pytest.mark.parametrize(
    ("text", "options", "error", "message"),
    (
        ("", {}, InertialError, "is empty"),
        ("a,b\n1,2\n", {}, InertialError, "has no column time_s; it has: a, b"),
        ("time_s,a\n0,1\n1,1\n", {}, InertialError, "neither orientations nor a gyroscope"),
        ("time_s,a\n0,1\n", {"units": "gyro=turns"}, UsageError, "has no gyro=turns"),
        ("time_s,a\n0,1\n", {"columns": "when=a"}, UsageError, "--columns names when"),
        ("time_s,a\n0,1\n", {"columns": "nonsense"}, UsageError, "write pairs such as"),
    ),
)
def test_a_bad_table_is_refused(tmp_path, text, options, error, message):
    with pytest.raises(error, match=message):
        read_file(write(tmp_path / "bad.csv", text), **options)


def test_files_that_are_missing_or_unknown_are_refused(tmp_path):
    with pytest.raises(InertialError, match="there is no file"):
        read_file(tmp_path / "nothing.csv")
    with pytest.raises(InertialError, match="has no known sensor format"):
        read_file(write(tmp_path / "notes.md", "hello"))
    with pytest.raises(UsageError, match="no sensor file is named"):
        read_files([])
