"""A first track's kernels, compiled by a second process beside the one that tracks.

Compiling takes most of a first track. The one that tracks compiles a kernel when it needs it, from the first on; the
second process goes through the same kernels from the last one back. Each finds in Numba's cache what the other has
done. Which kernels those are, in the order of their first use, is written in `first_track.txt`, a line each: the
function and the types of its arguments (`scripts/write_first_track.py`). A kernel that is not listed is compiled when
it is needed, as ever.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from toolkit.io.workers import Task, usable_processors

LIST = Path(__file__).with_name("first_track.txt")
KERNELS = "toolkit.kernels."
FEW = 8
"""Kernels that one process compiles sooner than a second one has started."""

_TOKEN = re.compile(r"[^\s()]+|[()]")


@cache
def compile_beside() -> None:
    """Have a second process compile what a first track lacks, where there is a processor for it; returns at once."""
    if usable_processors() > 1 and sum(not _is_kept(kernel) for kernel, _ in listed()) > FEW:
        work = multiprocessing.get_context("spawn").Process(target=Task.of(compile_listed), daemon=True)
        with suppress(OSError):  # there is no other process to be had
            work.start()


def listed(path: Path = LIST) -> list[tuple[Any, tuple[Any, ...]]]:
    """The kernels of a first track in the order of their first use, each with Numba's types of its arguments."""
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        name, arguments = line.split(" ", 1)
        found.append((_named(name), _types(iter(_TOKEN.findall(arguments)))))
    return found


def _named(name: str) -> Any:
    module, _, member = name.rpartition(".")
    return getattr(import_module(KERNELS + module), member)


def _types(tokens: Iterator[str]) -> tuple[Any, ...]:
    """Numba's types: `float64:2` is a C-contiguous array, `!` one only read; a tuple's members are in brackets."""
    from numba import types

    found: list[Any] = []
    for token in tokens:
        name, is_array, form = token.partition(":")
        if token == ")":
            break
        if token == "(":
            found[-1] = types.BaseTuple.from_types(_types(tokens), found[-1])
        elif "." in name:
            found.append(_named(name))
        elif is_array:
            found.append(types.Array(getattr(types, name), int(form.rstrip("!")), "C", readonly=form.endswith("!")))
        else:
            found.append(getattr(types, name))
    return tuple(found)


def _is_kept(kernel: Any) -> bool:
    """Whether code of the kernel, for any types, lies in the cache."""
    file = getattr(kernel._cache, "_cache_file", None)  # there is none where nothing is kept
    return file is not None and os.path.exists(file._index_path)


def compile_listed() -> None:
    """Compile the listed kernels from the last one back."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides when its work ends
    for kernel, types in reversed(listed()):
        kernel.compile(types)
