"""Worker processes that end together with their parent process."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

_watching: set[int] = set()


def end_with(parent: int) -> None:
    """End this process when its parent, the process `parent`, ends; any other process is not watched."""
    known = multiprocessing.parent_process()
    if parent in _watching or parent not in (os.getppid(), known.pid if known is not None else 0):
        return
    _watching.add(parent)
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    known = multiprocessing.parent_process()
    poll_seconds = 0.5  # seconds between two checks of the parent process
    if os.name == "posix":
        while os.getppid() == parent:  # an orphan gets another parent
            time.sleep(poll_seconds)
    elif known is not None:
        known.join()
    os._exit(1)


def usable_processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def task_of(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function for a worker process, which then ends together with this process."""
    return partial(_run, os.getpid(), function)


def _run(parent: int, function: Callable[..., Any], *arguments: Any) -> Any:
    end_with(parent)
    return function(*arguments)
