"""Names in files of others are displayed unchanged and have no effect; messages have one line."""

import pickle
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.io.display_names import LONGEST_NAME, Place, printable, shown
from toolkit.io.errors import RecordingError

BAD = (
    "[/red]", "[link=x]", r"$\foo$", "a\nb", "a\r\nb", "\x1b[31mred\x1b]0;t\x07", "caf\udce9", "\u202etxt.exe", r"\[b]",
)  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_name_is_one_line_of_what_can_be_printed(name: str) -> None:
    for place in get_args(Place):
        text = shown(name, place)
        assert text.isprintable() and text.encode()


@given(st.text(max_size=400))
def test_a_plain_name_stays_and_a_long_one_loses_its_middle(name: str) -> None:
    text = shown(name)
    assert len(text) <= LONGEST_NAME
    if name.isprintable() and len(name) <= LONGEST_NAME:
        assert text == name
    assert printable(name).isprintable()


@pytest.mark.parametrize("name", [*BAD, "$", "$$", r"\$", "a$b$c", r"$\frac{1}$"])
def test_matplotlib_draws_a_name_and_no_mathematics(name: str) -> None:
    from matplotlib import cbook

    text = shown(name, "plot")
    assert not cbook.is_math_text(text)
    assert text.replace(r"\$", "$") == shown(name)


@pytest.mark.parametrize("name", ["=1+1", "+1", "-1", "@sum", "'=1", "\t=1", "\r=1"])
def test_no_cell_of_a_table_is_a_formula(name: str) -> None:
    assert shown(name, "table")[0] not in "=+-@\t\r"


def test_an_empty_name_stays_empty() -> None:
    assert {shown("", place) for place in get_args(Place)} == {""}


def test_a_line_break_of_a_file_is_none_of_a_message() -> None:
    error = RecordingError("sensor left\nshin\r\nof\u2028a.npz is unknown")
    assert str(error) == "sensor left shin of a.npz is unknown"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
