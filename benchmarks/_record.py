"""Common parts of the benchmarks: parts of a script, results with machine and commit, steady times."""

import argparse
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from toolkit.io.files import save_json

RESULTS = Path(__file__).parent / "results"
CODE = (":/toolkit", ":/database_builder", ":/configs", ":/benchmarks/*.py")
"""Paths whose changes invalidate results."""


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """Return the parser of a benchmark, whose help keeps the lines of the description."""
    return argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)


def run_part(description: str | None, parts: Mapping[str, Callable[[argparse.ArgumentParser], None]]) -> None:
    """Run the part that the first argument names; the part adds its options to the parser."""
    parser = parser_of(description)
    parser.add_argument("part", choices=parts)
    named = " ".join(sys.argv[1:2])
    if named not in parts:
        parser.parse_args(sys.argv[1:2])  # prints the help, or the list of parts
    parts[named](parser)


def part_suffix(parser: argparse.ArgumentParser, options: argparse.Namespace, *names: str) -> str:
    """Return an empty string if these options have their defaults, else `_part`, for the name of a result."""
    return "" if all(getattr(options, name) == parser.get_default(name) for name in names) else "_part"


def show(figures: Mapping[str, Any], name: str = "") -> None:
    """Print nested figures: one line for each mapping with values, under the names of the mappings around it."""
    values = {key: value for key, value in figures.items() if not isinstance(value, Mapping)}
    if values:
        cells = (f"{key} {f'{value:.4g}' if isinstance(value, float) else value}" for key, value in values.items())
        print(f"{name}:" if name else "", ", ".join(cells), flush=True)
    for key, value in figures.items():
        if isinstance(value, Mapping):
            show(value, f"{name} {key}".strip())


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


def save_jpeg(path: Path, picture: np.ndarray) -> None:
    """Write an RGB picture, uint8 (H, W, 3), as a small JPEG of at most 1,600 columns."""
    image = Image.fromarray(picture)
    if image.width > 1600:
        image = image.resize((1600, round(image.height * 1600 / image.width)))
    image.save(path, quality=78, optimize=True)


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
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor()


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


def percentiles(milliseconds: list[float] | np.ndarray) -> dict[str, float]:
    """Return median, 99th and 99.9th percentile of times in milliseconds, with three decimals."""
    values = np.percentile(milliseconds, [50, 99, 99.9])
    return dict(zip(("median_ms", "p99_ms", "p999_ms"), np.round(values, 3).tolist(), strict=True))
