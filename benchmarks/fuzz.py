"""Mutated files of every format that is read: what is refused, what keeps its meaning, and findings.

    python -m benchmarks.fuzz [--mutations 100000] [--format NAME] [--seed 0]

Every format runs in processes of their own, so that a crash or an endless loop is a finding too and ends nothing else.
The files behind findings stay in the work folder.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from benchmarks._record import save_figures

BATCH = 500
"""Mutations that one process reads."""
PATIENCE = 600
"""Seconds after which a process is said to be in an endless loop."""


def run_batch(name: str, folder: Path, mutations: int, seed: int) -> Counter[str]:
    """Outcomes of one batch in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.fuzz", "--child", str(folder), "--format", name]
    command += ["--mutations", str(mutations), "--seed", str(seed)]
    root = Path(__file__).resolve().parents[1]
    try:
        done = subprocess.run(command, capture_output=True, timeout=PATIENCE, cwd=root, check=False)
    except subprocess.TimeoutExpired:
        return Counter({f"FINDING: no end within {PATIENCE} s, seed {seed}": 1})
    if done.returncode != 0:
        return Counter({f"FINDING: exit code {done.returncode}, seed {seed}": 1})
    return Counter(json.loads(done.stdout.decode(errors="replace").splitlines()[-1]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutations", type=int, default=100_000, help="of all formats together")
    parser.add_argument("--format", help="only this one")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    from tests.fuzzing import FORMATS, fuzz

    if options.child is not None:
        print(json.dumps(fuzz(options.format, options.child, options.mutations, options.seed)))
        return
    names = [options.format] if options.format else sorted(FORMATS)
    share = -(-options.mutations // len(names))
    table: dict[str, dict[str, int]] = {}
    work = Path(tempfile.mkdtemp(prefix="fuzz-"))
    for name in names:
        found: Counter[str] = Counter()
        for k, start in enumerate(range(0, share, BATCH)):
            seed = 1000 * options.seed + k
            found += run_batch(name, work / f"{name} {k}", min(BATCH, share - start), seed)
        table[name] = dict(found.most_common())
        findings = sum(count for outcome, count in found.items() if outcome.startswith("FINDING"))
        print(f"{name}: {sum(found.values())} mutations, {findings} findings {dict(found.most_common(5))}", flush=True)
    print(f"files behind findings: {work}")
    save_figures("fuzz", table, {"mutations": options.mutations, "seed": options.seed, "format": options.format})


if __name__ == "__main__":
    main()
