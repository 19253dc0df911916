"""The papers' own numbers (`papers.yaml`) beside the results of the benchmarks."""

import json
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks._record import RESULTS, drawn
from benchmarks.all import COMMANDS
from toolkit.io.errors import DataError
from toolkit.io.yaml_reader import read_yaml

NUMBERS = Path(__file__).parent / "papers.yaml"


class Comparison(NamedTuple):
    """One number of a paper, None where it is drawn, beside ours in its unit, None where it is not measured."""

    source: str
    figure: str
    name: str
    paper: float | None
    here: float | None
    digits: int

    def cells(self) -> tuple[str, str]:
        """Return the paper's number and ours as text."""
        paper = "drawn" if self.paper is None else f"{self.paper:g}"
        here = "not measured" if self.here is None else f"{self.here:.{self.digits}f}"
        return paper, here


@cache
def papers() -> dict[str, list[dict[str, Any]]]:
    """Return the groups of numbers of each paper."""
    found: dict[str, list[dict[str, Any]]] = read_yaml(
        NUMBERS, NUMBERS.name, DataError, "restore it from the repository"
    )
    return found


def published(paper: str, source: str) -> dict[str, float]:
    """Return the numbers that a table, figure or section of a paper gives, by name."""
    groups = [group["values"] for group in papers()[paper] if group["source"] == source]
    return {name: number for values in groups for name, number in values.items()}


def results_of(paper: str) -> list[str]:
    """Return the results that the numbers of a paper need, in the order of `COMMANDS`."""
    needed = {group["result"] for group in papers()[paper] if "result" in group}
    return [name for name in COMMANDS if name in needed]


def value_at(figures: Any, keys: str) -> Any:
    """Return the entry of nested figures at keys with slashes between them, or None if there is none."""
    for key in keys.split("/"):
        if isinstance(figures, list):
            figures = figures[int(key)] if int(key) < len(figures) else None
        else:
            figures = figures.get(key) if isinstance(figures, Mapping) else None
    return figures


def compared(paper: str, results: Path | None = None) -> Iterator[Comparison]:
    """Yield the numbers of a paper beside those of the results in a folder."""
    for group in papers()[paper]:
        figures = _figures(group, results)
        for name, number in group["values"].items():
            here = value_at(figures, group["here"].format(name)) if "here" in group else None
            unit = f", {group['unit']}" if group["unit"] else ""
            yield Comparison(
                group["source"],
                f"{group['says']}{unit}",
                name.replace("/", ", "),
                number,
                None if here is None else group.get("scale", 1) * here,
                group.get("digits", 1),
            )


def plots(paper: str, results: Path | None = None) -> Iterator[tuple[str, Path]]:
    """Yield source and path of each picture of a paper's figures; those that are curves are drawn first."""
    for group in papers()[paper]:
        path = (results or RESULTS) / group.get("plot", "")
        if "curves" in group:
            _draw(group, _figures(group, results), path)
        if path.is_file():
            yield group["source"], path


def _draw(group: Mapping[str, Any], figures: Any, path: Path) -> None:
    """Draw the curves of a group into a file, if the results have all of them."""
    curves = group["curves"]
    x, lines = value_at(figures, curves["x"]), {name: value_at(figures, keys) for name, keys in curves["y"].items()}
    if x is None or None in lines.values():
        return
    with drawn(path, (7.0, 4.2)) as (axes,):
        for name, values in lines.items():
            axes.plot(x, values, lw=1.4, label=name)
        axes.set(xlabel=curves["xlabel"], ylabel=curves["ylabel"], title=group["source"])
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)


def _figures(group: Mapping[str, Any], results: Path | None) -> Any:
    path = (results or RESULTS) / f"{group.get('result')}.json"
    return json.loads(path.read_text(encoding="utf-8"))["figures"] if path.is_file() else None
