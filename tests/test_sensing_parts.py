"""Parts of recordings: correction of raw depth, array checks, rows inside NPZ files."""

from pathlib import Path

import numpy as np
import pytest

from toolkit.io.errors import RecordingError
from toolkit.sensing.camera import Camera
from toolkit.sensing.conversion import FARTHEST_MEDIAN_MM, DepthConverter
from toolkit.sensing.recording import check_joints, check_timestamps

CAMERA = Camera(40.0, 44.0, 9.5, 7.5, 20, 16)
FILE = Path("recording.npz")


def raw(kind: type = np.uint16, scale: float = 1.0) -> np.ndarray:
    rng = np.random.default_rng(0)
    return (rng.integers(800, 4000, CAMERA.shape) * scale).astype(kind)


@pytest.mark.parametrize(
    ("unit", "kind", "scale"), [("mm", np.uint16, 1.0), ("m", np.float64, 1e-3), (2e-4, np.uint16, 5.0)]
)
def test_every_unit_becomes_millimetres(unit: str | float, kind: type, scale: float) -> None:
    converted = DepthConverter(unit).convert(raw(kind, scale), CAMERA, "frame 0")
    assert converted.dtype == np.uint16
    np.testing.assert_array_equal(converted, raw())


def test_distances_to_the_camera_become_depths_along_z() -> None:
    z = raw() * 1e-3
    rays = CAMERA.rays()
    points = np.dstack([rays * z[..., None], z])
    distances = np.linalg.norm(points, axis=2)
    converted = DepthConverter("m", radial=True).convert(distances, CAMERA, "frame 0")
    assert np.abs(converted.astype(int) - raw()).max() <= 1


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 70.0])
def test_what_is_no_depth_is_no_measurement(value: float) -> None:
    frame = raw(np.float64, 1e-3)
    frame[3, 4] = value
    converted = DepthConverter("m").convert(frame, CAMERA, "frame 0")
    assert converted[3, 4] == 0 and np.count_nonzero(converted) == converted.size - 1


def test_an_absurd_median_is_refused_with_the_unit_that_fits() -> None:
    with pytest.raises(RecordingError, match="give --depth-unit m$"):
        DepthConverter("mm").convert(raw(np.float32, 1e-3), CAMERA, "frame 0")
    with pytest.raises(RecordingError, match="give --depth-unit mm"):
        DepthConverter("m").convert(raw(), CAMERA, "frame 0")
    nothing = np.zeros(CAMERA.shape, dtype=np.uint16)
    converter = DepthConverter("mm")
    converter.convert(nothing, CAMERA, "frame 0")
    with pytest.raises(RecordingError):  # the first frame that holds a measurement is the one that is checked
        converter.convert(np.full(CAMERA.shape, FARTHEST_MEDIAN_MM + 1).astype(np.uint16), CAMERA, "frame 1")


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([0.0, 1.0], "one per frame"),
        ([0.0, 0.2, 0.1], "backwards"),
        ([0.0, np.nan, 1.0], "not finite"),
        ([5.0, 5.0, 5.0], "all timestamps"),
        ([0.0, 33.0, 66.0], "not milliseconds"),
    ],
)
def test_timestamps_that_cannot_be_are_named(times: list[float], words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        check_timestamps(np.array(times), 3, FILE)


@pytest.mark.parametrize("shape", [(5, 20, 3), (2, 5, 20, 3)])
def test_joints_are_copied_and_what_is_not_finite_is_unknown(shape: tuple[int, ...]) -> None:
    given = np.zeros(shape)
    given[..., 0, 0] = np.inf
    checked = check_joints(given, 5, "joints", FILE)
    assert checked is not None and np.isnan(checked[..., 0, 0]).all() and np.isfinite(checked[..., 1:, :]).all()
    checked[:] = 1.0
    assert given[..., 1:, :].max() == 0.0
    with pytest.raises(RecordingError, match="joints of recording.npz"):
        check_joints(given[..., :19, :], 5, "joints", FILE)
    assert check_joints(None, 5, "joints", FILE) is None
