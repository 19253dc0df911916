"""Every call of the file system of a command fails once: how often each outcome, by command and kind of failure.

    python -m benchmarks.failures [--command NAME ...] [--how NAME ...] [--points N]

Commands and kinds of failure are those of `tests/failing_commands.py` and `tests/failing_calls.py`. Needs Linux and a C
compiler.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks._record import save_figures


def main() -> None:
    from tests.failing_calls import HOWS, build_library
    from tests.failing_commands import COMMANDS

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--command", action="append", choices=[*COMMANDS])
    parser.add_argument("--how", action="append", choices=[*HOWS])
    parser.add_argument("--points", type=int, help="so many of a command's calls, evenly spread; all by default")
    options = parser.parse_args()
    work = Path(tempfile.mkdtemp(prefix="failures-"))
    library = build_library(work)
    if library is None:
        raise SystemExit("needs Linux and a C compiler")
    table, points = {}, [] if options.points is None else ["--points", str(options.points)]
    for command in options.command or COMMANDS:
        words = [word for how in options.how or HOWS for word in ("--how", how)]
        place = work / command.replace(" ", "_")
        done = subprocess.run(
            [sys.executable, "-m", "tests.failing_calls", command, place, *points, *words],
            env={**os.environ, "LD_PRELOAD": str(library)},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        *findings, found = done.stdout.splitlines()
        print(command, found, *findings, sep="\n", flush=True)
        table[command] = json.loads(found)
    save_figures("failures", table, {"points": options.points, "how": options.how, "command": options.command})


if __name__ == "__main__":
    main()
