"""Tables and figures of a paper beside the paper's own numbers: `depthmocap reproduce PAPER`.

Results that are missing or of other code are measured first, as by `bench --all`, so the same command resumes;
`--stored` takes the stored ones, of any code. Figures that are curves are drawn into `benchmarks/results/`. `--list`
prints the pending benchmarks with the CPU time of their last run. `benchmarks/papers.yaml` has the papers' numbers,
each with its table, figure or section.
"""

import sys
from itertools import groupby

from benchmarks._papers import compared, papers, plots, results_of
from benchmarks._record import add_option, parser_of
from benchmarks._rows import DATABASE, poses_of
from benchmarks.all import list_pending, measure
from toolkit.datasets.folder import data_folder


def print_tables(paper: str) -> None:
    """Print the numbers of a paper beside the last results, draw its curves, and print the paths of the pictures."""
    rows = list(compared(paper))
    width = max(len(one.name) for one in rows)
    for (source, figure), group in groupby(rows, lambda one: (one.source, one.figure)):
        print(f"{source}: {figure}\n  {'':<{width}} {'paper':>8} {'here':>12}")
        for one in group:
            print(f"  {one.name:<{width}} {one.cells()[0]:>8} {one.cells()[1]:>12}")
    for source, path in plots(paper):
        print(f"{source}: {path}")


def main() -> None:
    """Measure what is pending, then print the tables."""
    parser = parser_of(__doc__)
    parser.prog = "depthmocap reproduce"
    parser.add_argument("paper", choices=papers())
    for name, default in ({"data": data_folder(), "list": False, "stored": False} | DATABASE).items():
        add_option(parser, name, default)
    options = parser.parse_args()
    names = results_of(options.paper)
    if options.list:
        list_pending(names)
        return
    failed = [] if options.stored else measure(names, options.data, lambda: poses_of(options))
    print_tables(options.paper)
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
