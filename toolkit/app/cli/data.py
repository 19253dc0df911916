"""`depthmocap data list`, `fetch` and `where`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.app.cli.terminal import print_lines, print_table, progress_bars

if TYPE_CHECKING:
    from toolkit.datasets.registry import DataSet

app = typer.Typer(help="List, fetch and find recordings and motion capture of others.", no_args_is_help=True)

Folder = Annotated[
    Path | None,
    typer.Option("--data", help="Data folder.", show_default="DEPTHMOCAP_DATA, else a folder of the user"),
]


@app.command("list")
def list_data(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME...", help="Show these in full; a table of all without.")
    ] = None,
    data: Folder = None,
) -> None:
    """List the data sets: size, licence, files that are there; with names, source, citation and missing files too."""
    from toolkit.datasets.folder import data_folder
    from toolkit.datasets.registry import DATA_SETS, data_set_of

    root = data or data_folder()
    if names:
        print_lines("\n\n".join(_described(data_set_of(name), root) for name in names))
        return
    from rich.table import Table

    table = Table("data set", "MB", "files there", "how", "licence", "content", title=f"data folder: {root}")
    for data_set in DATA_SETS.values():
        total = len(data_set.files)
        there = total - len(data_set.missing(root))
        how = "fetch" if data_set.source else "by hand"
        table.add_row(
            data_set.name, f"{data_set.megabytes:.1f}", f"{there} of {total}", how, data_set.licence, data_set.about
        )
    print_table(table)


@app.command()
def fetch(
    names: Annotated[list[str], typer.Argument(metavar="NAME...", help="Data sets.", show_default=False)],
    data: Folder = None,
) -> None:
    """Download data sets from their publishers and check every file; files that are there are not fetched again."""
    from toolkit.datasets.fetch import fetch_data_set
    from toolkit.datasets.registry import data_set_of

    data_sets = [data_set_of(name) for name in names]  # an unknown name is refused before anything is fetched
    for data_set in data_sets:
        with progress_bars() as bars:
            place = fetch_data_set(data_set, data, progress=bars)
        print_lines(place)
        print_lines(f"licence: {data_set.licence}; cite: {data_set.citation}")


@app.command()
def where(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Data set.", show_default=False)] = None,
    data: Folder = None,
) -> None:
    """Print the data folder, or the folder of a data set whose files are all there."""
    from toolkit.datasets.folder import data_folder
    from toolkit.datasets.registry import data_set_of
    from toolkit.io.errors import DataError

    root = data or data_folder()
    if name is None:
        print_lines(root)
        return
    data_set = data_set_of(name)
    if missing := data_set.missing(root):
        raise DataError(
            f"{len(missing)} of the {len(data_set.files)} files of {name} are not in {root}, or are others; "
            f"type: depthmocap data fetch {name}"
        )
    print_lines(root / data_set.folder)


def _described(data_set: DataSet, root: Path) -> str:
    """Return all that the registry has about a data set, in lines."""
    missing = data_set.missing(root)
    lines = {
        "data set": f"{data_set.name}: {data_set.about}",
        "folder": root / data_set.folder,
        "files": f"{len(data_set.files)}, {data_set.megabytes:.1f} MB, {len(missing)} missing",
        "licence": data_set.licence,
        "cite": data_set.citation,
        "page": data_set.page or "none",
        "source": data_set.source or f"by hand. {data_set.steps}",
        "used by": ", ".join(data_set.users) or "nothing yet",
    }
    text = [f"{key:9} {value}" for key, value in lines.items()]
    return "\n".join([*text, *(f"missing   {file.path}" for file in missing)])
