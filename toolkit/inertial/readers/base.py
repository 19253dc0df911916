"""Shared parts of the readers of sensor files: options, text, tables of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.io.errors import InertialError, os_errors_as
from toolkit.io.safe_open import open_file, read_file
from toolkit.io.yaml_reader import LARGEST_TEXT

DEGREE = np.pi / 180.0


@dataclass(frozen=True)
class SensorOptions:
    """Options of a reader.

    Attributes
    ----------
    columns : CSV only: ours=theirs pairs such as `time_s=t,qw=Q0`, see `readers/table.py`
    units : CSV only: `gyro=deg/s,acceleration=g,time=ms`; default rad/s, m/s2 and s
    sensor : name of the sensor in a file without one
    rate : samples a second in a file without times
    """

    columns: str | None = None
    units: str | None = None
    sensor: str | None = None
    rate: float | None = None


def read_text(path: Path) -> str:
    """Return the file as text.

    Raises
    ------
    InertialError
        The file cannot be read, or it is binary.
    """
    with os_errors_as(InertialError, f"cannot read {path}", "check the path"):
        data = read_file(path, LARGEST_TEXT)
    if b"\0" in data[:4096]:
        raise InertialError(f"{path} is binary and no text; is it the exported file?")
    return data.decode("utf-8-sig", errors="replace")


def head_of(path: Path) -> str:
    """Return the beginning of a file as text; empty for unreadable and binary files."""
    try:
        with open_file(path) as stream:
            data = stream.read(4096)
    except OSError:
        return ""
    return "" if b"\0" in data else data.decode("utf-8-sig", errors="replace")


class Columns:
    """Table of text cells by column; empty cells and cells without a number are NaN."""

    def __init__(self, path: Path, names: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        self.path = path
        self.names = [name.strip() for name in names]
        self._rows = rows
        if not rows:
            raise InertialError(f"{path} holds no row below its header; export the recording again")

    def __len__(self) -> int:
        return len(self._rows)

    def has(self, *names: str) -> bool:
        """Return True if all these columns exist."""
        return all(name in self.names for name in names)

    def numbers(self, *names: str) -> np.ndarray:
        """Return the columns of these names: float64 (N, len(names)).

        Raises
        ------
        InertialError
            A column is missing.
        """
        if missing := [name for name in names if name not in self.names]:
            raise InertialError(f"{self.path} has no column {', '.join(missing)}; it has: {', '.join(self.names)}")
        places = [self.names.index(name) for name in names]
        return np.array([[_number(row[p]) if p < len(row) else np.nan for p in places] for row in self._rows])

    def optional(self, *names: str) -> np.ndarray | None:
        """Return the numbers, or None if a column is missing or has no number."""
        if not self.has(*names):
            return None
        values = self.numbers(*names)
        return values if np.isfinite(values).any() else None

    def texts(self, name: str) -> list[str]:
        """Return the cells of a column."""
        place = self.names.index(name)
        return [row[place].strip() if place < len(row) else "" for row in self._rows]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")
