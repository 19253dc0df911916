"""Signals that end the process: after a block of code that has to be done whole, or with its files cleaned up."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

ENDING = (signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []))
"""Signals besides Ctrl-C that end a process: by a service or a batch system, and by a closed terminal."""


@contextmanager
def signals_handled(numbers: Iterable[int], handle: Callable[[int], object]) -> Iterator[dict[int, Any]]:
    """Call `handle` for these signals while the block runs; yield the usual handlers by their signals.

    Signals that are ignored stay ignored, as by nohup. In other threads than the main one no signal arrives.
    """
    usual: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        usual = {number: signal.getsignal(number) for number in numbers}
        usual = {n: handler for n, handler in usual.items() if handler not in (signal.SIG_IGN, None)}
    for number in usual:
        signal.signal(number, lambda number, frame: handle(number))
    try:
        yield usual
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Hold back Ctrl-C (SIGINT) until the block ends; it is delivered then."""
    pending: list[int] = []
    try:
        with signals_handled([signal.SIGINT], pending.append):
            yield
    finally:
        if pending:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def endings_as_exits() -> Iterator[None]:
    """Turn the signals of `ENDING` into SystemExit while the block runs, so that temporary files are removed.

    The exit code is 128 plus the signal's number, as a shell reports it. Other handlers than the default stay.
    """

    def leave(number: int) -> None:
        raise SystemExit(128 + number)

    with signals_handled([number for number in ENDING if signal.getsignal(number) is signal.SIG_DFL], leave):
        yield
