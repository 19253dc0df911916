"""Plain values and options as typed: the type determines the accepted values."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest

from toolkit.app.cli.options import Joints, Reading, people_of
from toolkit.inertial.sensor_files import UNITS, factors_of
from toolkit.inertial.stream import GRAVITY
from toolkit.io import typed_values as typed
from toolkit.io.errors import TrackError, UsageError
from toolkit.io.typed_values import Range, TypedReader
from toolkit.recordings.reader_options import ReaderOptions


@dataclass(frozen=True)
class Person:
    name: str
    height: Annotated[float, Range(0.3, 3.0)]
    joints: tuple[float, float] | None = None
    kind: Literal["adult", "child"] = "adult"
    takes: dict[str, list[int]] = field(default_factory=dict)
    fast: bool = False


READER = TypedReader(TrackError, "write it again")


def test_what_fits_is_made() -> None:
    value = {"name": "a", "height": 2, "joints": [1, 2.5], "kind": "child", "takes": {"x": [1, 2]}}
    assert READER.read(value, Person, "p") == Person("a", 2.0, (1.0, 2.5), "child", {"x": [1, 2]})
    assert READER.read({"name": "a", "height": 1.0, "joints": None}, Person, "p") == Person("a", 1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"height": "1.8"}, "p.height is '1.8'; it must be a number"),
        ({"height": True}, "p.height is True; it must be a number"),
        ({"height": None}, "p.height is empty"),
        ({"fast": 1}, "p.fast is 1; it must be true or false"),
        ({"height": 5}, "p.height is 5, outside 0.3 to 3"),
        ({"height": float("nan")}, "p.height is nan, outside"),
        ({"name": 3}, "p.name is 3; it must be text"),
        ({"joints": [1]}, "p.joints has 1 values; it must have 2"),
        ({"joints": [1, "a"]}, r"p.joints\[1\] is 'a'"),
        ({"kind": "dog"}, "p.kind is 'dog'; it can be: adult, child"),
        ({"kind": []}, "p.kind is a list"),
        ({"takes": {"x": [1.5]}}, r"p.takes.x\[0\] is 1.5; it must be a whole number"),
        ({"takes": {3: [1]}}, "a name in p.takes is 3; it must be text"),
        ({"takes": []}, "p.takes is a list; it must be names with values"),
        ({"size": 1}, "unknown entry p.size; there are: name"),
    ],
)
def test_what_does_not_fit_is_one_sentence_that_names_it(change: dict[Any, Any], words: str) -> None:
    with pytest.raises(TrackError, match=words) as error:
        READER.read({"name": "a", "height": 1.8} | change, Person, "p")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("value", [None, [], 3, "text", {}])
def test_what_is_no_table_or_an_empty_one_is_refused(value: Any) -> None:
    with pytest.raises(TrackError, match="write it again"):
        READER.read(value, Person, "p")


def test_a_later_version_may_have_added_names() -> None:
    reader = TypedReader(TrackError, loose=True)
    assert reader.read({"name": "a", "height": 1.8, "size": 1}, Person, "p") == Person("a", 1.8)


def test_numbers_written_by_hand_may_be_text() -> None:
    assert TypedReader(TrackError, written_by_hand=True).read("1e-3", float, "x") == 1e-3
    assert READER.read("a/b", Path, "x") == Path("a/b")


def test_a_list_without_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(typed, "MOST_ITEMS", 2)
    with pytest.raises(TrackError, match="x has 3 entries, more than 2"):
        READER.read([1, 2, 3], list[int], "x")


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
    assert Reading().options() == {}
    for text, told in (("camera.json", "camera.json"), ("1,2,3,4", (1.0, 2.0, 3.0, 4.0))):
        assert Reading(intrinsics=text).options() == {"intrinsics": told}


def test_people_are_a_number_or_all() -> None:
    assert people_of("all") is None and people_of("1") == 1 and people_of("12") == 12
    for text in ("0", "-1", "two", "1.5", ""):
        with pytest.raises(UsageError, match="give a number of people, or all"):
            people_of(text)


def test_a_size_is_a_width_and_a_height() -> None:
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
