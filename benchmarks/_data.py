"""Commands of the benchmarks and the data sets that they read, from `commands.yaml`."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from toolkit.datasets.folder import data_folder
from toolkit.datasets.registry import data_set_of
from toolkit.io.errors import DataError
from toolkit.io.yaml_reader import read_yaml

COMMANDS = Path(__file__).parent / "commands.yaml"


@cache
def commands() -> dict[str, Any]:
    """Return the entries of `commands.yaml`."""
    found: dict[str, Any] = read_yaml(COMMANDS, COMMANDS.name, DataError, "restore it from the repository")
    return found


def needed(words: Sequence[str]) -> tuple[str, ...]:
    """Return the data sets of a benchmark as it is typed behind `depthmocap bench`; the longest key decides."""
    part = " ".join(words[:2])
    real = " --real" if "--real" in words else ""
    keys = (part + real, words[0] + real, part, words[0])
    needs = commands()["data"]
    return next((tuple(needs[key]) for key in keys if key in needs), ())


def check_data(words: Sequence[str]) -> None:
    """Raise DataError with the command that fetches the data sets of a benchmark, if any are missing."""
    folder = data_folder()
    missing = [name for name in needed(words) if not data_set_of(name).is_present(folder)]
    if missing and not {"-h", "--help"} & set(words):
        raise DataError(
            f"the benchmark {words[0]} needs data sets that are not in {folder}; "
            f"type: depthmocap data fetch {' '.join(missing)}"
        )
