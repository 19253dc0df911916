"""What the verbs show: results on the standard output, progress on the standard error."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress
    from rich.table import Table

WIDEST = 400
"""Characters: no table is wider."""


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
        self(f"{name}: {doing_words(doing)}", done, total)


def doing_words(doing: str) -> str:
    """What the pipeline is doing, in words for people."""
    words = {"compiling": "preparing", "learning": "learning the body"}
    return f"{words[doing]} (compiles for a minute the first time)" if doing in words else doing


@contextmanager
def progress_bars() -> Iterator[Bars]:
    """Progress bars on the standard error while the block runs."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), refresh_per_second=4) as progress:
        yield Bars(progress)


def next_commands(commands: dict[str, str]) -> None:
    """What to do next, on the standard error: command and what it is for."""
    width = max(map(len, commands))
    print("next:", file=sys.stderr)
    for command, purpose in commands.items():
        print(f"  {command:<{width}}   # {purpose}", file=sys.stderr)


def print_table(table: Table) -> None:
    """A table on the standard output."""
    from rich.console import Console

    console = Console()
    natural = console.measure(table, options=console.options.update(width=WIDEST)).maximum
    # A narrow terminal breaks long lines, which is better than columns of single letters.
    Console(width=max(natural, console.width)).print(table, crop=False, soft_wrap=True)
