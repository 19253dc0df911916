"""Writes the list of kernels that a first track uses: `python scripts/write_first_track.py RECORDING...`.

Each recording is tracked once, with all people in it. A kernel stands where it was first called, with the types of its
arguments, as `toolkit/kernels/precompile.py` reads them. An old list costs a first track time and nothing else.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba import types
from numba.core.dispatcher import Dispatcher

import depthmocap
from toolkit.io.files import save_text
from toolkit.kernels.precompile import KERNELS, LIST


def text_of(type_: Any) -> str:
    """A type of Numba as a word of the list, what a named tuple holds in brackets after its name."""
    if isinstance(type_, types.Array):
        if type_.layout != "C":
            raise ValueError(f"{type_} is not contiguous: kernels of a first track take C order")
        return f"{type_.dtype}:{type_.ndim}{'' if type_.mutable else '!'}"
    if isinstance(type_, types.BaseNamedTuple):
        cls = type_.instance_class
        return f"{cls.__module__.removeprefix(KERNELS)}.{cls.__name__} ( {' '.join(map(text_of, type_))} )"
    return str(type_)


@contextmanager
def called() -> Iterator[dict[str, None]]:
    """Lines of the kernels that Python code calls for the first time with such types, in order, inside the block."""
    lines: dict[str, None] = {}
    usual = Dispatcher._compile_for_args

    def noted(kernel: Any, *arguments: Any, **named: Any) -> Any:
        before = set(kernel.overloads)
        result = usual(kernel, *arguments, **named)
        name = f"{kernel.py_func.__module__.removeprefix(KERNELS)}.{kernel.py_func.__name__}"
        for new in set(kernel.overloads) - before:
            lines[" ".join([name, *map(text_of, new)])] = None
        return result

    Dispatcher._compile_for_args = noted
    try:
        yield lines
    finally:
        Dispatcher._compile_for_args = usual


def main() -> None:
    """Track the recordings and write the list."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", nargs="+", type=Path)
    recordings = parser.parse_args().recordings
    with called() as lines:
        for recording in recordings:
            depthmocap.track(recording, people="all")
    save_text(LIST, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
