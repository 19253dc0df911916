"""All results of README and docs: `depthmocap bench --all [--database POSES] [--data FOLDER]`.

Times per frame are measured first and alone; then each core runs one benchmark, with its output in
`.work/logs/RESULT.txt`. Results of the current code are skipped, so the same command resumes. A failed benchmark is
reported, the others continue, and the exit code is 1. `--list` prints the pending benchmarks with their last CPU time.
Those of the swarm need the extra `joints` and `depthmocap joints --fetch`.
"""

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from benchmarks._data import check_data, commands
from benchmarks._record import RESULTS, add_option, commit, parser_of
from benchmarks._rows import DATABASE, poses_of
from tests.support.suite import ROOT, WORK
from toolkit.database import DEFAULT_DATABASE
from toolkit.datasets.folder import data_folder

COMMANDS: dict[str, str] = {
    name: command.replace("{packaged}", DEFAULT_DATABASE.relative_to(ROOT).as_posix())
    for name, command in commands()["results"].items()
}
"""Result -> arguments of `depthmocap bench` that write it."""


def stored(name: str) -> dict[str, Any]:
    """Return the last result of a benchmark, empty if there is none."""
    path = RESULTS / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def left(names: Sequence[str]) -> dict[str, str]:
    """Return the commands of those results that are missing or of other code."""
    return {name: COMMANDS[name] for name in names if stored(name).get("commit") != commit()}


def measured(name: str, words: list[str]) -> bool:
    """Run a benchmark in its own process; return whether it succeeded."""
    log = WORK / "logs" / f"{name}.txt"
    log.parent.mkdir(parents=True, exist_ok=True)
    print(f"{name}: bench {shlex.join(words)}", flush=True)
    with log.open("w", encoding="utf-8") as lines:
        command = [sys.executable, "-m", f"benchmarks.{words[0]}", *words[1:]]
        done = subprocess.run(command, cwd=ROOT, stdout=lines, stderr=subprocess.STDOUT, check=False).returncode == 0
    print(f"{name}: {'done' if done else f'failed, see {log}'}", flush=True)
    return done


def list_pending(names: Sequence[str]) -> None:
    """Print the pending benchmarks of these results with the CPU time of their last run."""
    spent = {name: stored(name).get("processor_seconds", 0.0) / 60 for name in names}
    for name, command in left(names).items():
        print(f"{name:20} {spent[name]:>6.1f} min  bench {command}")
    together = sum(spent.values())
    print(f"{len(names)} results: {together:.1f} min together, {together / 120:.1f} hours on two processors")


def measure(names: Sequence[str], data: Path, poses: Callable[[], Path]) -> list[str]:
    """Measure those of the results that are missing or of other code; return the names of the failed ones.

    `poses` returns the database of the benchmarks; it is called only if there is something to measure. If a data set is
    missing, a DataError is raised and nothing is measured.
    """
    due = left(names)
    for command in due.values():
        check_data(shlex.split(command))
    database = poses() if due else None
    typed = {name: shlex.split(command.format(database=database, data=data)) for name, command in due.items()}
    timed = {name: words for name, words in typed.items() if words[0] in ("speed", "lookup")}
    failed = [name for name, words in timed.items() if not measured(name, words)]
    rest = {name: words for name, words in typed.items() if name not in timed}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        failed += [name for name, done in zip(rest, pool.map(measured, rest, rest.values()), strict=True) if not done]
    print(f"{len(due) - len(failed)} measured, {len(names) - len(due)} left as they are")
    return failed


def main() -> None:
    """Run the pending benchmarks."""
    parser = parser_of(__doc__)
    parser.add_argument("--only", nargs="+", choices=COMMANDS, metavar="RESULT", default=list(COMMANDS))
    for name, default in ({"data": data_folder(), "list": False} | DATABASE).items():
        add_option(parser, name, default)
    options = parser.parse_args()
    if options.list:
        list_pending(options.only)
    elif failed := measure(options.only, options.data, lambda: poses_of(options)):
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
