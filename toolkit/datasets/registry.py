"""Registry of data sets: source, licence, citation and the SHA-256 of each file."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from urllib.parse import quote

from toolkit.io.errors import DataError, UsageError
from toolkit.io.yaml_reader import read_yaml

ASSETS = Path(__file__).parent / "assets"
TEXT_SUFFIXES = frozenset({".bvh", ".amc", ".asf"})
"""Text formats. Git may store them with either line end, so their digests are those of the file with LF line ends."""
GITHUB = "https://raw.githubusercontent.com/{repository}/{commit}/"
"""Address of a file of a GitHub repository at a commit."""


@dataclass(frozen=True)
class DataFile:
    """File of a data set: path inside the data folder, SHA-256, size in bytes, address (None: no public one)."""

    path: str
    sha256: str
    size: int
    url: str | None

    def is_at(self, folder: Path) -> bool:
        """Return True if the data folder holds this file with its content."""
        path = folder / self.path
        return path.is_file() and digest_of(path) == self.sha256


@dataclass(frozen=True)
class DataSet:
    """Data set with its source.

    Attributes
    ----------
    name : name on the command line
    folder : folder inside the data folder
    about : content in one line
    licence : licence of the source, "none stated" if it has none
    citation : text to cite or to acknowledge
    page : address of the publisher
    users : tests, benchmarks and scripts that read it
    repository, commit : GitHub repository and commit of the files; None where the files have no address of their own
    steps : steps that bring the files into the folder by hand; empty where they are fetched
    assets : folder of the lists of files (`NAME.tsv`: SHA-256, bytes, path, path in the source)
    """

    name: str
    folder: str
    about: str
    licence: str
    citation: str
    page: str
    users: tuple[str, ...]
    repository: str | None = None
    commit: str | None = None
    steps: str = ""
    assets: Path = ASSETS

    @property
    def source(self) -> str | None:
        """Address that the files' paths are appended to."""
        if self.repository is None or self.commit is None:
            return None
        return GITHUB.format(repository=self.repository, commit=self.commit)

    @cached_property
    def files(self) -> tuple[DataFile, ...]:
        """Files, sorted by path."""
        found = []
        for line in (self.assets / f"{self.name}.tsv").read_text(encoding="utf-8").splitlines():
            sha256, size, path, *renamed = line.split("\t")
            url = self.source and self.source + quote(renamed[0] if renamed else path)
            found.append(DataFile(f"{self.folder}/{path}", sha256, int(size), url))
        return tuple(found)

    @property
    def megabytes(self) -> float:
        """Size of all files in MB."""
        return sum(file.size for file in self.files) / 1e6

    def missing(self, folder: Path) -> list[DataFile]:
        """Return the files that the data folder does not hold with their content."""
        return [file for file in self.files if not file.is_at(folder)]

    def is_present(self, folder: Path) -> bool:
        """Return True if the data folder has a file of each name; contents are not read."""
        return all((folder / file.path).is_file() for file in self.files)


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal digits; of a text format, with LF line ends."""
    content = path.read_bytes()
    if path.suffix in TEXT_SUFFIXES:
        content = content.replace(b"\r\n", b"\n")
    return hashlib.sha256(content).hexdigest()


def _registered() -> dict[str, DataSet]:
    """Return the data sets of `assets/registry.yaml` by name."""
    found = read_yaml(ASSETS / "registry.yaml", "the registry of data sets", DataError, "install the package again")
    return {name: DataSet(name, **{**entry, "users": tuple(entry["users"])}) for name, entry in found.items()}


DATA_SETS = _registered()
"""Data sets by name."""


def data_set_of(name: str) -> DataSet:
    """Return a data set by its name.

    Raises
    ------
    UsageError
        The registry has no such name.
    """
    if name not in DATA_SETS:
        raise UsageError(f"there is no data set {name!r}; the registry has: {', '.join(DATA_SETS)}")
    return DATA_SETS[name]
