"""Mutated files of every format that is read: what is refused, what keeps its meaning, and findings.

    python -m benchmarks.fuzz [--mutations 100000] [--format NAME] [--seed 0] [--work FOLDER]

Every format is read in a process of its own that tells the outcome of each mutation as it comes; a crash, an endless
loop or memory without end is a finding, and the next process goes on behind it. A folder named with --work keeps what
is done: the same command goes on there. The files behind findings stay in it.
"""

from __future__ import annotations

import argparse
import json
import select
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from benchmarks._record import save_figures
from toolkit.files import save_json

PATIENCE = 120.0
"""Seconds without an outcome after which a process is said to be in an endless loop; the first one takes compiling."""
MEMORY = 8 << 30
"""Bytes of addresses that a process may ask for."""
KEPT_EVERY = 500
"""Mutations after which the counts are written."""


def child(name: str, folder: Path, first: int, end: int, seed: int) -> None:
    """Print the outcome of each mutation, one a line."""
    import resource

    from tests.fuzz_formats import FORMATS
    from tests.fuzzing import outcomes

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    for came in outcomes(name, FORMATS[name], folder, range(first, end), seed):
        print(came, flush=True)


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
        command = [sys.executable, "-m", "benchmarks.fuzz", "--child", str(folder), "--format", name]
        command += ["--first", str(counts.done), "--mutations", str(mutations), "--seed", str(seed)]
        before = counts.done
        with (folder.with_suffix(".log")).open(
            "wb"
        ) as log:  # libraries complain there, and a full pipe would stop them
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, cwd=Path(__file__).parents[1])
            try:
                wrong = _listen(process, counts)
            finally:
                process.kill()
                process.wait()
        if wrong and counts.done == before == 0:
            raise SystemExit(f"{name} cannot begin: {wrong}; see {log.name}")
        if wrong:
            counts.add(f"FINDING: {wrong}, mutation {counts.done}")
    counts.keep()
    return counts.found


def _listen(process: subprocess.Popen[bytes], counts: Counts) -> str:
    """Count what a process tells until it ends; what was wrong with its end, or nothing."""
    assert process.stdout is not None
    rest = b""
    while True:
        ready, _, _ = select.select([process.stdout], [], [], PATIENCE)
        if not ready:
            return f"no end within {PATIENCE:.0f} s"
        data = process.stdout.read1(1 << 16)  # type: ignore[attr-defined]
        if not data:
            return f"exit code {process.wait()}" if process.wait() else ""
        *lines, rest = (rest + data).split(b"\n")
        for line in lines:
            counts.add(line.decode(errors="replace"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutations", type=int, default=100_000, help="of all formats together")
    parser.add_argument("--format", help="only this one")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", type=Path, help="folder to go on in")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--first", type=int, default=0, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child is not None:
        child(options.format, options.child, options.first, options.mutations, options.seed)
        return
    from tests.fuzz_formats import FORMATS

    names = [options.format] if options.format else sorted(FORMATS)
    share = -(-options.mutations // len(names))
    work = options.work or Path(tempfile.mkdtemp(prefix="fuzz-"))
    work.mkdir(parents=True, exist_ok=True)
    table: dict[str, dict[str, int]] = {}
    for name in names:
        found = run_format(name, work, share, options.seed)
        table[name] = dict(found.most_common())
        findings = sum(count for outcome, count in found.items() if outcome.startswith("FINDING"))
        print(f"{name}: {sum(found.values())} mutations, {findings} findings {dict(found.most_common(5))}", flush=True)
    print(f"files behind findings: {work}")
    save_figures("fuzz", table, {"mutations": options.mutations, "seed": options.seed, "format": options.format})


if __name__ == "__main__":
    main()
