"""Mutated files of every format: nothing but our own errors, and no silent change where a checksum forbids it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.fuzz_formats import FORMATS
from tests.fuzzing import FINDING, fuzz, meaning, mutated

MUTATIONS = 20
"""Per format, fewer where each takes long; `depthmocap bench fuzz` does as many as one likes."""


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_a_mutated_file_is_refused_or_read(name: str, tmp_path: Path) -> None:
    mutations = int(MUTATIONS * FORMATS[name].share)
    found = fuzz(name, FORMATS[name], tmp_path, mutations, seed=0)
    assert sum(found.values()) == mutations
    assert not [outcome for outcome in found if outcome.startswith(FINDING)], dict(found)


def test_mutations_are_seeded_and_change_something() -> None:
    data = bytes(range(200))
    first, again = (mutated(data, np.random.default_rng(3)) for _ in range(2))
    assert first == again != data


def test_meaning_tells_values_apart() -> None:
    values = [np.zeros(3), np.zeros(3, np.float32), np.ones(3), {"a": 1}, {"a": "1"}, (1, 2), (1, (2,)), None]
    assert len({meaning(value) for value in values}) == len(values)
