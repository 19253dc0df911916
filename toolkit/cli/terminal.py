"""What the verbs show: results on the standard output, progress on the standard error."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress
    from rich.table import Table

TABLE_WIDTH = 200
"""Columns of a table that goes into a file or a pipe."""


class Bars:
    """One progress bar per thing that is being done."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._tasks: dict[str, object] = {}

    def __call__(self, doing: str, done: int, total: int) -> None:
        """Show that `done` of `total` steps of `doing` are over."""
        if doing not in self._tasks:
            self._tasks[doing] = self._progress.add_task(doing, total=total)
        self._progress.update(self._tasks[doing], completed=done, total=total)  # type: ignore[arg-type]

    def of_recording(self, name: str, doing: str, done: int, total: int) -> None:
        """The same for a recording, whose name is shown; compilation is named as such."""
        words = "compiling, the first time only" if doing == "compiling" else doing
        self(f"{name}: {words}", done, total)


@contextmanager
def progress_bars() -> Iterator[Bars]:
    """Progress bars on the standard error while the block runs."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), refresh_per_second=4) as progress:
        yield Bars(progress)


def print_table(table: Table) -> None:
    """A table on the standard output."""
    from rich.console import Console

    Console(width=None if sys.stdout.isatty() else TABLE_WIDTH).print(table)
