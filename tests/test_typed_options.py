"""Options as typed at the command line: results, and messages for impossible ones."""

import numpy as np
import pytest

from toolkit.app.cli.reading import Joints, Reading, intrinsics_of, people_of, size_of
from toolkit.inertial.readers.table import UNITS, factors_of
from toolkit.inertial.stream import GRAVITY
from toolkit.io.errors import UsageError
from toolkit.recordings.reader_options import ReaderOptions


def test_typed_options_reach_the_reader() -> None:
    typed = Reading(
        format="raw", intrinsics="570,571,320,240", mirrored=False, radial=True, depth_unit="0.0005", size="640,480",
        frame_rate=15.0, up="0,-1,0.1", rotate=90, track="/depth",
    )  # fmt: skip
    told = ReaderOptions.from_mapping(typed.options())
    assert told.intrinsics == (570.0, 571.0, 320.0, 240.0) and told.size == (640, 480)
    assert (told.depth_unit, told.frame_rate, told.rotate, told.track) == (0.0005, 15.0, 90, "/depth")
    assert told.mirrored is False and told.radial is True
    np.testing.assert_allclose(np.asarray(told.up_camera), [0.0, -1.0, 0.1])


def test_intrinsics_are_numbers_or_a_file() -> None:
    assert intrinsics_of(None) is None and intrinsics_of("camera.json") == "camera.json"
    assert intrinsics_of("1,2,3,4") == (1.0, 2.0, 3.0, 4.0)


def test_people_are_a_number_or_all() -> None:
    assert people_of("all") is None and people_of("1") == 1 and people_of("12") == 12
    for text in ("0", "-1", "two", "1.5", ""):
        with pytest.raises(UsageError, match="give a number of people, or all"):
            people_of(text)


def test_a_size_is_a_width_and_a_height() -> None:
    assert size_of("640,480", "--size") == (640, 480)
    choice = Joints(joints="folder", joints_size="1920,1080").choice()
    assert (choice.source, choice.size) == ("folder", (1920, 1080))
    with pytest.raises(UsageError, match="--joints-size belongs to a folder of joints"):
        Joints(joints="colour", joints_size="1920,1080").choice()
    with pytest.raises(UsageError, match="--joints-size is '640'"):
        Joints(joints="folder", joints_size="640").choice()


# Columns and units of sensor tables.


def test_units_are_ours_unless_others_are_chosen() -> None:
    assert factors_of(None) == {"gyro": 1.0, "acceleration": 1.0, "time": 1.0}
    found = factors_of("time=us,acceleration=g")
    assert found == {"gyro": 1.0, "acceleration": GRAVITY, "time": 1e-6}
    assert factors_of("gyro=deg/s")["gyro"] * 180 == pytest.approx(np.pi)
    assert all(next(iter(units.values())) == 1.0 for units in UNITS.values()), "the first is ours"
