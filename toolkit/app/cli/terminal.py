"""Terminal output of the verbs: results on the standard output, progress on the standard error."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from toolkit.io.display_names import printable
from toolkit.io.progress import Progress

if TYPE_CHECKING:
    from rich.table import Table

MINUTE = 60.0
"""Seconds between two lines of progress in a pipe or a log."""


def print_lines(*texts: object, sep: str = " ", file: TextIO | None = None) -> None:
    """Print lines with control characters escaped, because file names may contain them."""
    lines = sep.join(map(str, texts)).split("\n")
    print("\n".join(map(printable, lines)), file=file or sys.stdout, flush=True)


def log_lines(every: float = MINUTE) -> Progress:
    """Return progress as at most one line per minute, for a pipe or a log; short work prints nothing."""
    begun = last = time.monotonic()

    def show(doing: str, done: int, total: int) -> None:
        nonlocal last
        if time.monotonic() - last >= every:
            last = time.monotonic()
            minutes = (last - begun) / MINUTE
            print(f"{doing}: {done} of {total} after {minutes:.0f} min", file=sys.stderr, flush=True)

    return show


def doing_words(doing: str) -> str:
    """Describe the current stage of the pipeline for users; compilation has its own text."""
    words = {"compiling": "preparing", "learning": "learning the body"}
    return f"{words[doing]} (compiles for a while the first time)" if doing in words else doing


@contextmanager
def progress_bars() -> Iterator[Progress]:
    """Show progress on the standard error: a bar per task in a terminal, else one line per minute."""
    if not sys.stderr.isatty():
        yield log_lines()
        return
    from rich import progress
    from rich.console import Console

    columns = (
        progress.TextColumn("{task.description}", markup=False), progress.BarColumn(), progress.MofNCompleteColumn(),
        progress.TimeElapsedColumn(),
    )  # fmt: skip
    tasks: dict[str, progress.TaskID] = {}
    with progress.Progress(*columns, console=Console(stderr=True), refresh_per_second=4) as bars:

        def show(doing: str, done: int, total: int) -> None:
            if doing not in tasks:
                tasks[doing] = bars.add_task(doing, total=total)
            bars.update(tasks[doing], completed=done, total=total)

        yield show


def next_commands(commands: dict[tuple[str, ...], str]) -> None:
    """Print the next commands on the standard error: the words behind `depthmocap` and their purpose."""
    lines = {_line(program() + words): purpose for words, purpose in commands.items()}
    width = max(map(len, lines))
    print("next:", file=sys.stderr)
    for line, purpose in lines.items():
        print(f"  {line:<{width}}   # {purpose}", file=sys.stderr)


def program() -> tuple[str, ...]:
    """Return the words that call this program: its name if it is on the path, its own path, or its module."""
    beside = Path(sys.executable).with_name("depthmocap.exe" if sys.platform == "win32" else "depthmocap")
    found = shutil.which("depthmocap")
    if found is not None and os.path.realpath(found) == os.path.realpath(beside):
        return ("depthmocap",)
    return (_short(beside),) if beside.is_file() else (_short(Path(sys.executable)), "-m", "depthmocap")


def _line(words: tuple[str, ...]) -> str:
    """Quote words for the shell of this system."""
    return subprocess.list2cmdline(words) if sys.platform == "win32" else shlex.join(words)


def _short(path: Path) -> str:
    """Return a path relative to the current folder if it lies in it, else the absolute path."""
    try:
        here = Path.cwd()
    except OSError:  # it has been removed
        return str(path)
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


def print_rows(head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print rows of cells under their headings, see `print_table`."""
    from rich.table import Table

    table = Table(*head)
    for row in rows:
        table.add_row(*row)
    print_table(table)


def print_table(table: Table) -> None:
    """Print a table; brackets and escape sequences in cells, titles and names are printed literally."""
    from rich.console import Console

    for column in table.columns:
        column._cells = [printable(cell) if isinstance(cell, str) else cell for cell in column._cells]
    if isinstance(table.title, str):
        table.title = printable(table.title)
    console = Console(markup=False)
    widest = 400  # maximum width of a table in characters
    natural = console.measure(table, options=console.options.update(width=widest)).maximum
    # In a narrow terminal long lines break; the alternative is columns of single letters.
    Console(width=max(natural, console.width), markup=False).print(table, crop=False, soft_wrap=True)
