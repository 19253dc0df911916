"""Kernels compiled by a second process: the list says what a track calls, and the process keeps it for the others."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from scripts.write_first_track import called, text_of
from toolkit.io.workers import Task
from toolkit.kernels import linear
from toolkit.kernels import precompile as ahead


class Started(NamedTuple):
    """What `compile_beside` would have started."""

    target: Any
    daemon: bool


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[Started]:
    """Processes that are started, which do nothing here."""
    found: list[Started] = []

    class Context:
        def Process(self, **named: Any) -> Any:
            return type("Process", (), {"start": lambda self: found.append(Started(**named))})()

    monkeypatch.setattr(ahead.multiprocessing, "get_context", lambda method: Context())
    monkeypatch.setattr(ahead, "usable_processors", lambda: 2)
    ahead.compile_beside.cache_clear()
    return found


def test_every_line_of_the_list_names_a_kernel_and_comes_back_as_it_is_written() -> None:
    lines = ahead.LIST.read_text(encoding="utf-8").splitlines()
    kernels = ahead.listed()
    assert len(kernels) == len(set(lines)) > 50
    for line, (kernel, types) in zip(lines, kernels, strict=True):
        name = f"{kernel.py_func.__module__.removeprefix(ahead.KERNELS)}.{kernel.py_func.__name__}"
        assert line == " ".join([name, *map(text_of, types)])
        assert len(types) == kernel.py_func.__code__.co_argcount


def test_calls_are_noted_once_with_the_types_that_numba_sees() -> None:
    fresh = numba.njit(linear.substitute.py_func)
    factor, read = np.eye(3), np.eye(3)
    read.setflags(write=False)
    with called() as lines:
        for argument in (factor, factor, read):
            fresh(argument, np.ones(3))
    assert list(lines) == ["linear.substitute float64:2 float64:1", "linear.substitute float64:2! float64:1"]


def test_the_list_is_compiled_from_its_end_and_kept(tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_text("linear._dot float64:1 float64:1\nlinear._lengths float64:2 float64:1\n")
    program = (
        "import pathlib, toolkit.kernels.precompile as ahead\n"
        "kernels = ahead.listed(pathlib.Path('list.txt'))\n"
        "done = []\n"
        "ahead.listed = lambda: [(type('Kernel', (), {'compile': lambda self, types, of=kernel: "
        "(of.compile(types), done.append(of.py_func.__name__))})(), types) for kernel, types in kernels]\n"
        "assert not any(ahead._is_kept(kernel) for kernel, _ in kernels)\n"
        "ahead.compile_listed()\n"
        "assert all(ahead._is_kept(kernel) for kernel, _ in kernels)\n"
        "print(*done)"
    )
    root = str(Path(__file__).parents[1])
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels"), "PYTHONPATH": root}
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert result.stdout.split() == ["_lengths", "_dot"], result.stderr


def test_a_second_process_is_started_once_where_much_is_missing(
    started: list[Started], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ahead, "_is_kept", lambda kernel: False)
    ahead.compile_beside()
    ahead.compile_beside()
    assert started == [Started(Task(ahead.compile_listed, os.getpid()), True)]


@pytest.mark.parametrize(("processors", "kept"), [(1, False), (2, True)])
def test_no_process_is_started_where_none_is_needed(
    processors: int, kept: bool, started: list[Started], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ahead, "usable_processors", lambda: processors)
    monkeypatch.setattr(ahead, "_is_kept", lambda kernel: kept)
    ahead.compile_beside()
    assert not started
