"""Commands one of whose calls of the file system fails, each call in turn: what they say, what they lose, what is next.

    LD_PRELOAD=failing_calls.so python -m tests.failing_calls COMMAND FOLDER [--how HOW ...] [--points N]

Every point runs in a forked process in which the call of that number fails (`failing_calls.c`). Afterwards nothing of
the user's is gone, nothing is half written, and the same command makes the same arrays.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import errno
import io
import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.app.pipeline import second

KILL = -1
HOWS = {
    "full disk": (errno.ENOSPC, 1),
    "input or output error": (errno.EIO, 0),
    "interrupted": (errno.EINTR, 0),
    "killed": (KILL, 0),
}
"""Name -> error of the call, and whether all later ones fail too."""
LONGEST = 120
"""Seconds after which a command is said to hang."""


@dataclass(frozen=True)
class Command:
    """One command.

    Attributes
    ----------
    prepare : writes what it reads into a folder
    run : runs it on a folder `in`, into a folder `out`; twice is once
    """

    prepare: Callable[[Path], None]
    run: Callable[[Path, Path], None]


def build_library(folder: Path) -> Path | None:
    """The library to preload, compiled; None without a compiler or on another system than Linux."""
    compiler = shutil.which("cc")
    if compiler is None or sys.platform != "linux":
        return None
    made, source = folder / "failing_calls.so", Path(__file__).with_suffix(".c")
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", made, source, "-ldl"], check=True)
    return made


def failing_points(
    command: Command, folder: Path, hows: Sequence[str], points: int | None = None
) -> dict[str, Counter[str]]:
    """What became of the command at each of its calls, or at so many of them, evenly spread; how often each outcome.

    Outcomes that must not be begin with FINDING.
    """
    given, out = folder / "in", folder / "out"
    given.mkdir(parents=True)
    command.prepare(given)
    before = contents(given)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        command.run(given, out)  # whose children compile and import nothing
    _only_the_users(out)
    attempt(command, folder, -1, hows[0])
    expected, total = arrays(out), json.loads((folder / "said.json").read_text())[1]
    found: dict[str, Counter[str]] = {how: Counter() for how in hows}
    for how, point in itertools.product(hows, range(0, total, 1 if points is None else max(1, total // points))):
        _only_the_users(out)
        outcome = attempt(command, folder, point, how)
        if outcome is None:
            continue
        if contents(given) != before or (out / "thesis.txt").read_text() != "years":
            outcome = "FINDING: something of the user's is gone"
        elif left := [name for name, value in arrays(out).items() if value != expected.get(name)]:
            outcome = f"FINDING: {left[0]} is half written"
        else:
            attempt(command, folder, -1, how)
            if arrays(out) != expected:
                outcome = f"FINDING: other arrays the next time, after: {outcome}"
        if outcome.startswith("FINDING"):
            print(f"{how}, call {point}: {outcome}", flush=True)
        found[how][outcome] += 1
    return found


def _only_the_users(out: Path) -> None:
    """Leave nothing in the folder but a file that the command does not know."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    (out / "thesis.txt").write_text("years")


def attempt(command: Command, folder: Path, point: int, how: str) -> str | None:
    """How the command ends whose call of this number fails; None where it makes fewer calls."""
    said = folder / "said.json"
    said.unlink(missing_ok=True)
    child = os.fork()
    if child == 0:
        code = 1
        try:
            signal.alarm(LONGEST)
            library = ctypes.CDLL(None)
            library.failing_counted.restype = ctypes.c_long
            number, ever_after = HOWS[how]
            words = io.StringIO()
            with contextlib.redirect_stdout(words), contextlib.redirect_stderr(words):
                library.failing_begin(f"{folder}/".encode(), ctypes.c_long(point), number, ever_after)
                ended = _ending(command, folder, words)
                counted = library.failing_counted()
                library.failing_begin(b"", ctypes.c_long(-1), 0, 0)
            said.write_text(json.dumps([ended, counted]))
            code = 0
        finally:
            os._exit(code)
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return "killed" if number == signal.SIGKILL else f"FINDING: signal {number}"
    if not said.exists():
        return "FINDING: it ended without a word"
    ended, counted = json.loads(said.read_text())
    return ended if counted > point else None


def _ending(command: Command, folder: Path, words: io.StringIO) -> str:
    try:
        command.run(folder / "in", folder / "out")
    except SystemExit:
        said = [line for line in words.getvalue().splitlines() if line.startswith("depthmocap: ")]
        return "one sentence" if len(said) == 1 else f"FINDING: {words.getvalue()}"
    except BaseException as error:
        trace = "".join(traceback.format_tb(error.__traceback__)[-2:])
        return f"FINDING: {type(error).__name__}: {error} {trace}"
    return "done" if "Traceback" not in words.getvalue() else f"FINDING: {words.getvalue()}"


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, by its name."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


IGNORED = (".txt", ".partial", ".html", ".json", ".jsonl", ".yaml", "state.npz")
"""What is no result, or tells the time."""
UNFINISHED = (".work", second.FOLDER)
"""Folders of work that goes on."""
TIMES = ("stage_ms", "checksum")


def arrays(folder: Path) -> dict[str, str]:
    """The arrays of every result below a folder; temporary files and those of work that goes on are none."""
    found = {}
    for path in sorted(folder.rglob("*")):
        hidden = any(part.startswith(".") or part.endswith(UNFINISHED) for part in path.relative_to(folder).parts)
        if path.is_dir() or hidden or path.name.endswith(IGNORED):
            continue
        if path.suffix != ".npz":
            found[str(path.relative_to(folder))] = str(hash(path.read_bytes()))
            continue
        try:
            with np.load(path) as stored:
                values = {name: stored[name].tobytes() for name in sorted(stored.files) if name not in TIMES}
            found[str(path.relative_to(folder))] = str(hash(tuple(values.items())))
        except Exception as error:
            found[str(path.relative_to(folder))] = f"unreadable: {error}"
    return found


def main() -> None:
    from tests.failing_commands import COMMANDS

    parser = argparse.ArgumentParser()
    parser.add_argument("command", choices=[*COMMANDS])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--how", action="append", choices=[*HOWS])
    parser.add_argument("--points", type=int)
    options = parser.parse_args()
    hows = options.how or [*HOWS]
    print(json.dumps(failing_points(COMMANDS[options.command], options.folder.resolve(), hows, options.points)))


if __name__ == "__main__":
    main()
