"""Write the tables of README and docs from `benchmarks/results/`: `python scripts/write_tables.py [--check]`.

A table is between `<!-- table: NAME -->` and `<!-- end -->`; its rows are those of the macro NAME in `tables.jinja`.
`--check` only compares and fails for a stale page. A result is valid only if its commit is in the history of the
checkout; others are listed, and must be measured again or dropped.
"""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from benchmarks._data import needed
from benchmarks._papers import compared as compared_numbers
from benchmarks.all import COMMANDS
from tests.support.bootstrap import paired_bootstrap

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
MARKED = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def results(name: str = "*") -> dict[str, Any]:
    """Return the last complete results by name, each with figures, commit, machine and processor time."""
    paths = [path for path in sorted(RESULTS.glob(f"{name}.json")) if not path.stem.endswith("_part")]
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in paths}


def figures(name: str) -> Any:
    """Return the last figures of a benchmark."""
    return results(name)[name]["figures"]


def fixed(value: float | Iterable[float], digits: int = 1) -> str:
    """Format a number with a fixed number of decimals; several numbers are joined by commas."""
    return ", ".join(fixed(v, digits) for v in value) if isinstance(value, Iterable) else f"{value:.{digits}f}"


def percent(share: float | Iterable[float], digits: int = 1) -> str:
    """Format a fraction as per cent without the sign, 1 without decimals; several as `fixed`."""
    if isinstance(share, Iterable):
        return ", ".join(percent(one, digits) for one in share)
    return "100" if share == 1 else f"{100 * share:.{digits}f}"


def share(counts: Sequence[int]) -> float:
    """Return the first of two counts over the second."""
    return counts[0] / counts[1]


def column(rows: Mapping[str, Any], names: Sequence[str], figure: str = "") -> list[float]:
    """Return the rows of these names, or one figure of each."""
    return [rows[name][figure] if figure else rows[name] for name in names]


def in_colour(line: Mapping[str, Any]) -> str:
    """Format a line of scenes tracked with colour: error, fraction within 100 mm; switches, misses, false people."""
    counts = ", ".join(str(line[name]) for name in ("switches", "misses", "false"))
    return f"{fixed(line['error_mm'])} mm, {percent(line['a100'])} %; {counts}"


def compared(group: str, other: str) -> dict[str, Any]:
    """Return mean errors of the hybrid tracker and of another row in a group of the suite, with a paired bootstrap."""
    found = figures("accuracy_report")["rows"] | figures("baak2013_report")["rows"]
    names = [name for name in found["hybrid"]["recordings"] if name.startswith(group)]
    own, theirs = (np.array([found[row]["recordings"][n]["error_mm"] for n in names]) for row in ("hybrid", other))
    gain = vars(paired_bootstrap(theirs, own, np.random.default_rng(0)))
    return gain | {"own": own.mean(), "theirs": theirs.mean(), "better": int((own < theirs).sum()), "count": len(names)}


def listed() -> list[dict[str, Any]]:
    """Return command, data sets, processor minutes and file of each result of `bench --all`."""
    found = results()
    return [
        {
            "command": command.format(database="POSES", data="DATA"),
            "data": ", ".join(f"`{name}`" for name in needed(shlex.split(command))) or "none",
            "minutes": found[name].get("processor_seconds", 0.0) / 60 if name in found else None,
            "name": name,
        }
        for name, command in COMMANDS.items()
    ]


def numbers(paper: str) -> list[dict[str, str]]:
    """Return source, figure with names, the paper's numbers and ours of each figure with at most five numbers."""
    groups = (list(group) for _, group in groupby(compared_numbers(paper), lambda one: (one.source, one.figure)))
    return [
        {
            "source": group[0].source,
            "figure": f"{group[0].figure}: {'; '.join(one.name for one in group)}",
            "paper": ", ".join(one.cells()[0] for one in group),
            "here": ", ".join(one.cells()[1] for one in group),
        }
        for group in groups
        if len(group) <= 5
    ]


ENVIRONMENT = Environment(
    loader=FileSystemLoader(Path(__file__).parent), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
)
ENVIRONMENT.filters |= {"f": fixed, "pct": percent}
ENVIRONMENT.globals |= {
    "figures": figures, "results": results, "share": share, "column": column, "compared": compared,
    "in_colour": in_colour, "listed": listed, "numbers": numbers,
}  # fmt: skip
TABLES: dict[str, Any] = {
    name: macro for name, macro in vars(ENVIRONMENT.get_template("tables.jinja").module).items() if callable(macro)
}


def written(page: str) -> str:
    """Return the text of a page with current tables."""

    def table(found: re.Match[str]) -> str:
        head, *rows = re.sub(r" +\|", " |", TABLES[found[2]]()).strip().splitlines()
        line = "|---" * (head.count("|") - 1) + "|"
        return found[1] + "\n".join([head, line, *rows]) + "\n" + found[3]

    return MARKED.sub(table, page)


def pages() -> list[Path]:
    """Return the pages with tables."""
    return [ROOT / "README.md", ROOT / "benchmarks" / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def strangers() -> list[str]:
    """Return the results whose commit is missing or not in the history."""
    found = []
    for name, measured in results().items():
        commit = measured.get("commit", "").rstrip("+") or "none"
        command = ["git", "-C", str(ROOT), "merge-base", "--is-ancestor", commit, "HEAD"]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            found.append(f"{name}.json (commit {commit})")
    return found


def main() -> None:
    """Write the tables, or check them."""
    stale = [path for path in pages() if written(text := path.read_text(encoding="utf-8")) != text]
    if "--check" in sys.argv:
        lost = strangers()
        for path in stale:
            print(f"{path.relative_to(ROOT)} differs from benchmarks/results; run scripts/write_tables.py")
        for name in lost:
            print(f"{name} is not in this history; measure again or drop it")
        sys.exit(1 if stale or lost else 0)
    for path in stale:
        path.write_text(written(path.read_text(encoding="utf-8")), encoding="utf-8")
        print("written:", path.relative_to(ROOT))


if __name__ == "__main__":
    main()
