"""Breaks the toolkit in named ways, one at a time, and tells which of them the tests notice.

    python scripts/mutants.py [--only TEXT] [--jobs 2]

Every mutant of `mutants.yaml` is a small change of one file. It is made in a copy of the tree, whose compiled kernels
are its own, and the tests that are named beside it run until the first one fails. Printed is a table; the exit code is
1 if a mutant survived, or if the tests fail without any.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Queue

import yaml

ROOT = Path(__file__).resolve().parents[1]
MUTANTS = Path(__file__).with_suffix(".yaml")
COPIED = ("toolkit", "database_builder", "configs", "tests", "benchmarks", "scripts", "pyproject.toml")
TIMEOUT = 900
"""Seconds after which a mutant that never ends counts as noticed."""


@dataclass(frozen=True)
class Mutant:
    """One way to break the toolkit.

    Attributes
    ----------
    name : what is broken
    file : which file, from the root of the project
    old, new : its text, which stands there once, and what takes its place
    tests : what runs, as pytest takes it
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def applied(self, source: str) -> str:
        """The broken source.

        Raises
        ------
        ValueError
            The text does not stand there exactly once.
        """
        if source.count(self.old) != 1:
            raise ValueError(f"{self.name!r}: {self.old!r} stands {source.count(self.old)} times in {self.file}")
        return source.replace(self.old, self.new)


def load_mutants(path: Path = MUTANTS) -> list[Mutant]:
    """All mutants, in the order of the file."""
    rows = yaml.safe_load(path.read_text(encoding="utf-8"))
    return [Mutant(**(row | {"tests": tuple(row["tests"].split())})) for row in rows]


def copy_tree(folder: Path) -> Path:
    """Copy the project into `folder`, without compiled code, and return the copy."""
    tree = folder / "project"
    tree.mkdir(parents=True)
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            left_out = shutil.ignore_patterns("__pycache__", ".work", "results", "node_modules")
            shutil.copytree(source, tree / name, ignore=left_out)
        else:
            shutil.copy(source, tree / name)
    return tree


def run_tests(tree: Path, tests: Sequence[str]) -> str | None:
    """The first test that fails there, None if all pass."""
    # Files change within one second and keep their size, which is all that Python looks at: so it writes no bytecode.
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    arguments = ["-x", "-q", "--no-header", "-p", "no:cacheprovider", "--hypothesis-seed=0", *tests]
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *arguments],
            env=environment, cwd=tree, capture_output=True, text=True, timeout=TIMEOUT,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"no end within {TIMEOUT} s"
    if done.returncode == 0:
        return None
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return failed.group(1) if failed else f"pytest ended with code {done.returncode}: {done.stdout[-200:].strip()}"


def judge(mutant: Mutant, tree: Path) -> str | None:
    """The test that notices a mutant in a copy of the tree, which is left as it was; None if it survives."""
    path = tree / mutant.file
    source = path.read_text(encoding="utf-8")
    path.write_text(mutant.applied(source), encoding="utf-8")
    try:
        return run_tests(tree, mutant.tests)
    finally:
        path.write_text(source, encoding="utf-8")


def row(number: int, mutant: Mutant, noticed: str | None) -> str:
    """A line of the table."""
    verdict = "**survived** |" if noticed is None else f"killed | `{noticed}`"
    return f"| {number} | {mutant.name} | `{mutant.file}` | {verdict} |"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="mutants whose name or file holds this text")
    parser.add_argument("--jobs", type=int, default=1, help="copies of the tree that are tested side by side")
    options = parser.parse_args()
    mutants = [mutant for mutant in load_mutants() if options.only in f"{mutant.name} {mutant.file}"]
    for mutant in mutants:
        mutant.applied((ROOT / mutant.file).read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as temporary:
        trees: Queue[Path] = Queue()
        for job in range(options.jobs):
            trees.put(copy_tree(Path(temporary) / str(job)))

        def in_some_tree(mutant: Mutant) -> str | None:
            tree = trees.get()
            try:
                return judge(mutant, tree)
            finally:
                trees.put(tree)

        def sound(tests: tuple[str, ...]) -> None:
            tree = trees.get()
            try:
                if broken := run_tests(tree, tests):
                    sys.exit(f"the tests fail without any mutant: {broken}")
            finally:
                trees.put(tree)

        survivors = 0
        print("| # | what is broken | where | verdict | noticed by |\n|---:|---|---|---|---|", flush=True)
        with ThreadPoolExecutor(options.jobs) as pool:
            number = 0
            for tests in dict.fromkeys(mutant.tests for mutant in mutants):
                sound(tests)
                group = [mutant for mutant in mutants if mutant.tests == tests]
                for mutant, noticed in zip(group, pool.map(in_some_tree, group), strict=True):
                    number += 1
                    survivors += noticed is None
                    print(row(number, mutant, noticed), flush=True)
        print(f"\n{len(mutants)} mutants, {survivors} survived")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
