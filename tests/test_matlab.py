"""MATLAB files: SciPy's reader is the reference for whole files; a damaged file is an error."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from toolkit.io.errors import RecordingError
from toolkit.io.matlab import read_matlab

ARRAYS = {
    "depth": np.random.default_rng(0).integers(0, 4000, (6, 5, 3)).astype(np.uint16),
    "x": np.linspace(0, 1, 7).reshape(1, 7),
    "a_name_that_is_longer": np.array([[-3]], np.int8),
    "nothing": np.zeros((0, 4), np.float32),
}


@pytest.mark.parametrize("compressed", [False, True])
def test_arrays_are_those_that_scipy_reads(tmp_path: Path, compressed: bool) -> None:
    path = tmp_path / "a.mat"
    savemat(path, ARRAYS, do_compression=compressed)
    found, expected = read_matlab(path, RecordingError), loadmat(path)
    assert set(found) == set(ARRAYS)
    for name in ARRAYS:
        assert found[name].dtype == expected[name].dtype
        np.testing.assert_array_equal(found[name], expected[name])


def test_what_holds_no_numbers_is_left_out(tmp_path: Path) -> None:
    cells = np.empty((1, 2), object)
    cells[0, 0], cells[0, 1] = np.zeros((2, 3)), np.ones((4, 1))
    savemat(tmp_path / "a.mat", {"sensor": cells, "text": "hello", "z": np.array([1j]), "s": {"a": 1.0}})
    found = read_matlab(tmp_path / "a.mat", RecordingError)
    assert not found


@pytest.mark.data("utd-mhad", "utd-mhad-inertial")
@pytest.mark.parametrize("folder", ["depth/utd_mhad", "inertial/utd_mhad"])
def test_files_of_matlab_itself_are_read_as_scipy_reads_them(data_folder: Path, folder: str) -> None:
    for path in sorted((data_folder / folder).glob("*.mat"))[::60]:
        found, expected = read_matlab(path, RecordingError), loadmat(path)
        (name,) = found
        assert found[name].dtype == expected[name].dtype
        np.testing.assert_array_equal(found[name], expected[name])


@pytest.mark.parametrize("compressed", [False, True])
def test_a_changed_byte_is_an_error_or_another_number(tmp_path: Path, compressed: bool) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"d": np.arange(24.0).reshape(2, 3, 4)}, do_compression=compressed)
    whole, refused = path.read_bytes(), 0
    for at in range(126, len(whole)):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        try:
            found = read_matlab(path, RecordingError)
        except RecordingError as problem:
            refused += 1
            assert "\n" not in str(problem)
        else:
            assert not compressed or found.keys() != {"d"}, f"the checksum forbids it, at {at}"
    assert refused > (len(whole) - 134 if compressed else 40)
