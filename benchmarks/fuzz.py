"""Mutated files of every format that is read: what is refused, what keeps its meaning, and findings.

    python -m benchmarks.fuzz [--mutations 100000] [--format NAME ...] [--seed 0] [--work FOLDER]

Every format is read in a forked process of its own that tells the outcome of each mutation as it comes; a crash, an
endless loop or memory without end is a finding, and so is a kernel that reads or writes beyond an array, for kernels
are compiled with checks of their bounds; the next process goes on behind it. A folder named with --work
keeps what is done: the same command goes on there. The files behind findings stay in it. What was found
in chosen formats is kept apart from the table of all.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import select
import signal
import sys
import tempfile
import traceback
from collections import Counter
from pathlib import Path

from benchmarks._record import save_figures
from toolkit.io.files import save_json

PATIENCE, FIRST_PATIENCE = 120.0, 1200.0
"""Seconds without an outcome after which a process is said to be in an endless loop; the first one takes compiling."""
MEMORY = 8 << 30
"""Bytes of addresses that a process may ask for."""
KEPT_EVERY = 500
"""Mutations after which the counts are written."""


def _start(name: str, folder: Path, numbers: range, seed: int) -> tuple[int, int]:
    """Fork a process that tells the outcome of each mutation, one a line: its id, and the pipe that it writes to."""
    import resource

    from tests.fuzz_formats import FORMATS
    from tests.fuzzing import outcomes

    read, write = os.pipe()
    process = os.fork()
    if process:
        os.close(write)
        return process, read
    code = 1
    try:
        log = os.open(folder.with_suffix(".log"), os.O_WRONLY | os.O_CREAT, 0o666)  # libraries complain there
        os.dup2(log, sys.stderr.fileno())
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        for came in outcomes(name, FORMATS[name], folder, numbers, seed):
            os.write(write, came.encode(errors="replace") + b"\n")
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


class Counts:
    """Outcomes of one format so far, on disk where they can be gone on from."""

    def __init__(self, path: Path) -> None:
        self.path = path
        kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        self.found: Counter[str] = Counter(kept)

    @property
    def done(self) -> int:
        """How many mutations have an outcome."""
        return sum(self.found.values())

    def add(self, came: str) -> None:
        """Count one outcome."""
        self.found[came] += 1
        if self.done % KEPT_EVERY == 0:
            self.keep()

    def keep(self) -> None:
        """Write what was counted."""
        save_json(self.path, dict(self.found.most_common()))


def run_format(name: str, work: Path, mutations: int, seed: int) -> Counter[str]:
    """Outcomes of so many mutations of one format; those that an earlier call counted in `work` are not done again."""
    counts = Counts(work / f"{name}.json")
    while counts.done < mutations:
        folder = Path(tempfile.mkdtemp(prefix=f"{name} {counts.done} ", dir=work))
        before = counts.done
        process, pipe = _start(name, folder, range(counts.done, mutations), seed)
        try:
            wrong = _listen(process, pipe, counts, before)
        finally:
            os.close(pipe)
        if wrong and counts.done == before == 0:
            raise SystemExit(f"{name} cannot begin: {wrong}; see {folder.with_suffix('.log')}")
        if wrong:
            counts.add(f"FINDING: {wrong}, mutation {counts.done}")
    counts.keep()
    return counts.found


def _listen(process: int, pipe: int, counts: Counts, before: int) -> str:
    """Count what a process tells until it ends; what was wrong with its end, or nothing."""
    rest = b""
    while True:
        patience = PATIENCE if counts.done > before else FIRST_PATIENCE
        ready, _, _ = select.select([pipe], [], [], patience)
        data = os.read(pipe, 1 << 16) if ready else b""
        if data:
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                counts.add(line.decode(errors="replace"))
            continue
        if not ready:
            os.kill(process, signal.SIGKILL)
        status = os.waitpid(process, 0)[1]
        if not ready:
            return f"no end within {patience:.0f} s"
        return f"exit code {os.waitstatus_to_exitcode(status)}" if status else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutations", type=int, default=100_000, help="of all formats together")
    parser.add_argument("--format", action="append", help="only this one, and any other named so")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", type=Path, help="folder to go on in")
    options = parser.parse_args()
    work = options.work or Path(tempfile.mkdtemp(prefix="fuzz-"))
    work.mkdir(parents=True, exist_ok=True)
    os.environ["NUMBA_BOUNDSCHECK"] = "1"  # read when kernels are imported
    from tests.fuzz_formats import FORMATS

    names = options.format or sorted(FORMATS)
    one = options.mutations / sum(FORMATS[name].share for name in names)
    table: dict[str, dict[str, int]] = {}
    for name in names:
        found = run_format(name, work, math.ceil(one * FORMATS[name].share), options.seed)
        table[name] = dict(found.most_common())
        findings = sum(count for outcome, count in found.items() if outcome.startswith("FINDING"))
        print(f"{name}: {sum(found.values())} mutations, {findings} findings {dict(found.most_common(5))}", flush=True)
    print(f"files behind findings: {work}")
    save_figures(
        "fuzz_chosen" if options.format else "fuzz",
        table,
        {"mutations": options.mutations, "seed": options.seed, "format": options.format},
    )


if __name__ == "__main__":
    main()
