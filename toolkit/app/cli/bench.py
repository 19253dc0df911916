"""The verbs `bench` and `reproduce`, which run the benchmark scripts of a checkout."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from toolkit.app.cli.terminal import print_lines
from toolkit.io.errors import UsageError

FOLDER = Path(__file__).resolve().parents[3] / "benchmarks"

NO_CHECKOUT = "benchmarks need a checkout of the repository, which contains benchmarks/"
CONTEXT = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}


def benchmarks() -> dict[str, Path]:
    """Return the benchmark scripts of the checkout by name."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.py")) if not path.stem.startswith("_")}


def _run_benchmark(name: str, arguments: list[str]) -> None:
    """Run one benchmark script with its own arguments.

    Raises
    ------
    UsageError
        No script has this name; the message lists the available ones.
    DataError
        A data set of the benchmark is missing; the message has the command that fetches it.
    """
    import importlib
    import runpy

    scripts = benchmarks()
    if name not in scripts:
        raise UsageError(f"there is no benchmark {name!r}; there are: {', '.join(scripts)}" if scripts else NO_CHECKOUT)
    sys.argv = [str(scripts[name]), *arguments]
    sys.path.insert(0, str(FOLDER.parent))
    if (FOLDER / "_data.py").exists():
        importlib.import_module("benchmarks._data").check_data([name, *arguments])
    runpy.run_path(str(scripts[name]), run_name="__main__")


def bench(
    context: typer.Context,
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of a script in benchmarks/.", show_default=False)
    ] = "",
) -> None:
    """Measure a figure: run a benchmark script, all of them with --all, or list them without a name."""
    name = "all" if name == "--all" else name
    if name in ("", "-h", "--help"):
        print_lines("\n".join(benchmarks()) or NO_CHECKOUT)
        return
    _run_benchmark(name, context.args)


def reproduce(
    paper: Annotated[str, typer.Argument(help="baak2013, qammaz, lopez2011 or thesis.", show_default=False)],
    listed: Annotated[
        bool, typer.Option("--list", help="Print the pending benchmarks with their minutes; measure nothing.")
    ] = False,
    stored: Annotated[
        bool, typer.Option("--stored", help="Take the stored results, also of older code; measure nothing.")
    ] = False,
) -> None:
    """Measure the tables and figures of a paper, and print them beside the paper's own numbers."""
    _run_benchmark("reproduce", [paper, *(["--list"] if listed else []), *(["--stored"] if stored else [])])
