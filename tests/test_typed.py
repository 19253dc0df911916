"""Reader of plain values: the type determines the accepted values."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest

from toolkit.io import typed_values as typed
from toolkit.io.errors import TrackError
from toolkit.io.typed_values import Range, TypedReader


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
