"""Error classes."""

from __future__ import annotations

import pickle

from toolkit.io.errors import RecordingError


def test_a_line_break_of_a_file_is_none_of_a_message() -> None:
    error = RecordingError("sensor left\nshin\r\nof\u2028a.npz is unknown")
    assert str(error) == "sensor left shin of a.npz is unknown"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
