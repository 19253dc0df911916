"""Every call of the file system fails once: a command says one sentence, loses nothing and is right the next time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.failing_calls import build_library

HOWS = ("full disk", "killed")
COMMANDS, POINTS = ("track --people all", "index"), 2
"""Whose calls fail here, so many each; `bench failures` has all fail, and those of every other command."""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What makes calls fail."""
    made = build_library(tmp_path_factory.mktemp("library"))
    if made is None:
        pytest.skip("needs a C compiler and Linux")
    return made


@pytest.mark.parametrize("command", COMMANDS)
def test_a_call_that_fails_loses_nothing(command: str, library: Path, tmp_path: Path) -> None:
    how = [word for name in HOWS for word in ("--how", name)]
    done = subprocess.run(
        [sys.executable, "-m", "tests.failing_calls", command, tmp_path, "--points", str(POINTS), *how],
        env={**os.environ, "LD_PRELOAD": str(library)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert not [outcome for table in found.values() for outcome in table if outcome.startswith("FINDING")], done.stdout
    assert found["killed"]["killed"] >= POINTS and sum(found["full disk"].values()) >= POINTS
