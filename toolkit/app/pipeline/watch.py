"""Signals that stop a run, and its log file."""

from __future__ import annotations

import io
import logging
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from toolkit.io.errors import OutputError, os_errors_as
from toolkit.io.interrupts import ENDING, signals_handled
from toolkit.io.safe_open import open_file

LOG_FILE = "log.txt"


@contextmanager
def stop_request() -> Iterator[threading.Event]:
    """Return an event that Ctrl-C, a termination signal or a closed terminal sets; a second one has its usual effect.

    Signals can only be handled in the main thread; in others the event is never set.
    """
    stop = threading.Event()

    def request(number: int) -> None:
        stop.set()
        signal.signal(number, usual[number])

    with signals_handled((signal.SIGINT, *ENDING), request) as usual:
        yield stop


class _Quiet(logging.StreamHandler):
    """Log handler that ignores a full disk, because the rows report it."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Do nothing; the default prints a traceback."""


@contextmanager
def log_file(folder: Path) -> Iterator[None]:
    """Copy all log messages of the toolkit to `log.txt` while the block runs."""
    with os_errors_as(OutputError, f"cannot write {folder / LOG_FILE}", "choose a folder that can be written"):
        stream = io.TextIOWrapper(open_file(folder / LOG_FILE, "a+b", inside=True), "utf-8", "backslashreplace")
    handler = _Quiet(stream)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    root = logging.getLogger("toolkit")
    level = root.level
    root.addHandler(handler)
    root.setLevel(logging.INFO)
    try:
        yield
    finally:
        root.setLevel(level)
        root.removeHandler(handler)
        with suppress(OSError):  # ignore a full disk, because the rows report it
            stream.close()
