"""Common parts of the benchmarks: options, printed figures, results with machine and commit, steady times."""

import argparse
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.files import save_json

RESULTS = Path(__file__).parent / "results"
CODE = (":/toolkit", ":/database_builder", ":/configs", ":/benchmarks/*.py", ":/benchmarks/commands.yaml")
"""Paths whose changes invalidate results."""


NARROWING = ("clips", "every", "frames", "groups", "names", "sequences", "set", "starts", "stride", "takes", "views")
"""Options that select a part of a benchmark, or change it: with another value the result ends in `_part`."""
SINGLE = ("confusion", "frames", "recordings", "sequences", "starts", "takes")
"""Keys of figures by recording or frame, which are stored and not printed."""


@dataclass(frozen=True)
class Benchmark:
    """Measurement that returns name and figures of its result, with its options, see `add_option`."""

    measure: Callable[[argparse.Namespace], tuple[str, Any]]
    options: Mapping[str, Any]

    def run(self, parser: argparse.ArgumentParser) -> None:
        """Parse the command line, measure, print and write the figures."""
        for name, default in self.options.items():
            add_option(parser, name, default)
        options = parser.parse_args()
        settings = {name: value for name, value in vars(options).items() if name != "part"}
        narrowed = [name for name in NARROWING if name in settings and settings[name] != parser.get_default(name)]
        name, figures = self.measure(options)
        show(figures)
        print("written:", save_figures(name + "_part" * bool(narrowed), figures, settings))


def benchmark(*groups: Mapping[str, Any], **options: Any) -> Callable[[Callable[..., tuple[str, Any]]], Benchmark]:
    """Return a decorator that makes a benchmark with groups of options and its own ones."""
    return lambda measure: Benchmark(
        measure, {name: value for each in (*groups, options) for name, value in each.items()}
    )


def add_option(parser: argparse.ArgumentParser, name: str, default: Any) -> None:
    """Add an option by its default; a type makes an argument, False a flag, a tuple choices, a mapping its settings."""
    flag = f"--{name.replace('_', '-')}"
    if isinstance(default, type):
        parser.add_argument(name, type=default)
    elif isinstance(default, Mapping):
        parser.add_argument(flag, **default)
    elif default is False:
        parser.add_argument(flag, action="store_true")
    elif isinstance(default, tuple):
        parser.add_argument(flag, choices=default, default=default[0])
    else:
        parser.add_argument(flag, type=type(default), default=default, help="default: %(default)s")


def script(module: str, description: str | None, parts: Benchmark | Mapping[str, Benchmark]) -> Callable[[], None]:
    """Return the main function of a script, and call it if the script, `module`, is the program.

    `parts` is the benchmark, or those of which the first argument names one.
    """

    def main() -> None:
        parser = parser_of(description)
        chosen = parts
        if not isinstance(chosen, Benchmark):
            parser.add_argument("part", choices=chosen)
            named = " ".join(sys.argv[1:2])
            if named not in chosen:
                parser.parse_args(sys.argv[1:2])  # prints the help, or the list of parts
            chosen = chosen[named]
        chosen.run(parser)

    if module == "__main__":
        main()
    return main


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """Return the parser of a benchmark, whose help keeps the lines of the description."""
    return argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)


def show(figures: Any, name: str = "") -> None:
    """Print nested figures: one line for each mapping with values, under the names of the mappings around it."""
    if isinstance(figures, list):
        figures = {str(number): row for number, row in enumerate(figures)}
    groups = {key: value for key, value in figures.items() if _has_names(value)}
    cells = [
        f"{key} {f'{value:.4g}' if isinstance(value, float) else value}"
        for key, value in figures.items()
        if key not in groups
    ]
    if cells:
        print(f"{name}:" if name else "", ", ".join(cells), flush=True)
    for key, value in groups.items():
        if key not in SINGLE:
            show(value, f"{name} {key}".strip())


def _has_names(value: Any) -> bool:
    return isinstance(value, Mapping) or (isinstance(value, list) and bool(value) and isinstance(value[0], Mapping))


def save_figures(name: str, figures: Any, settings: dict[str, Any]) -> Path:
    """Write `benchmarks/results/<name>.json` and return its path."""
    path = RESULTS / f"{name}.json"
    save_json(
        path,
        {
            "figures": figures,
            "settings": {name: portable(value) for name, value in settings.items()},
            "command": " ".join([Path(sys.argv[0]).name, *map(portable, sys.argv[1:])]),
            "machine": {
                "processor": _processor(),
                "processors": os.cpu_count(),
                "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
                "python": platform.python_version(),
                "system": platform.system(),
            },
            "processor_seconds": round(processor_seconds(), 1),
            "commit": commit(),
            "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        },
    )
    return path


@contextmanager
def drawn(path: Path, size: tuple[float, float], rows: int = 1, columns: int = 1, **grid: Any) -> Iterator[list[Any]]:
    """Yield the axes of a new plot of `size` inches, row by row, and write it; `grid` are options of `subplots`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    yield figure.subplots(rows, columns, squeeze=False, **grid).ravel().tolist()
    figure.savefig(path, dpi=110)


def processor_seconds() -> float:
    """Return user and system time of this process and its finished children, seconds."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def portable(value: Any) -> Any:
    """Return the name of an absolute path, so that results contain no machine paths; other values unchanged."""
    return Path(value).name if isinstance(value, (str, Path)) and Path(value).is_absolute() else value


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    named = [line for line in info.read_text().splitlines() if line.startswith("model name")] if info.exists() else []
    return named[0].split(":", 1)[1].strip() if named else platform.processor()


def commit() -> str:
    """Return the newest commit on `main` that changes `CODE`, with a plus if the checkout has changes since.

    Commits of pages and results do not invalidate results. Commits of a branch can be rebased, so they do not count.
    """
    shared = _git("merge-base", "HEAD", "main") or _git("rev-parse", "HEAD")
    base = _git("rev-list", "-1", shared, "--", *CODE) if shared else ""
    changed = _git("diff", "--stat", base, "--", *CODE)
    return f"{base[:7]}{'+' if changed else ''}" if base else "unknown"


def _git(*words: str) -> str:
    command = ["git", "-C", str(Path(__file__).parent), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def pin_to_one_processor() -> None:
    """Keep this process on one processor, so that the scheduler does not move it between samples (Linux only)."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


MEASURED = """
import contextlib, os, resource, subprocess, sys
with contextlib.suppress(AttributeError, OSError):  # needs a privilege, and Linux
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
ended = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_maxrss, used.ru_utime + used.ru_stime)
sys.exit(ended)
"""
"""Script that runs a command and prints its peak memory in kilobytes (Linux) and processor time in seconds. It has its
own process, because Linux counts the memory of the parent process too.
"""


def command_cost(words: Sequence[Any], **environment: str) -> tuple[float, float]:
    """Return peak memory, megabytes, and processor time, seconds, of a `depthmocap` command in its own process."""
    typed = [sys.executable, "-c", MEASURED, sys.executable, "-m", "depthmocap", *map(str, words)]
    variables = {**os.environ, **environment}
    variables.pop("PYTHONDONTWRITEBYTECODE", None)  # else each command compiles all sources
    ended = subprocess.run(typed, env=variables, stdout=subprocess.PIPE, text=True, check=False)
    if ended.returncode:
        raise SystemExit(f"depthmocap {' '.join(typed[5:])} ended with {ended.returncode}")
    peak, seconds = map(float, ended.stdout.split())
    return peak / 1024.0, seconds


def percentiles(milliseconds: list[float] | np.ndarray) -> dict[str, float]:
    """Return median, 99th and 99.9th percentile of times in milliseconds, with three decimals."""
    values = np.percentile(milliseconds, [50, 99, 99.9])
    return dict(zip(("median_ms", "p99_ms", "p999_ms"), np.round(values, 3).tolist(), strict=True))


def milliseconds_of(
    call: Callable[[], Any], repeats: int = 1, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Return the milliseconds of some calls."""
    spent = []
    for _ in range(repeats):
        begun = clock()
        call()
        spent.append(1000.0 * (clock() - begun))
    return spent
