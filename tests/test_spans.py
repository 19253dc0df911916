"""Stretches of frames in which something holds."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from toolkit.io.spans import spans


@given(st.lists(st.booleans(), max_size=30))
def test_stretches_hold_every_frame_that_is_true_and_end_before_one_that_is_not(flags: list[bool]) -> None:
    values = np.array(flags, dtype=bool)
    found = spans(values)
    covered = [frame for span in found for frame in range(span.start, span.stop)]
    assert covered == np.flatnonzero(values).tolist()
    assert all(before.stop < after.start for before, after in zip(found, found[1:], strict=False))
