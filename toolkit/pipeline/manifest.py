"""`manifest.jsonl`: what became of every recording of a batch, one line of JSON each, written as results arrive."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from toolkit.door import open_file
from toolkit.errors import OutputError, UsageError
from toolkit.plain import parse_json, read_text

MANIFEST_FILE = "manifest.jsonl"
COMMAND = "track"
DONE, FAILED, INTERRUPTED = "done", "failed", "interrupted"
LONGEST_LINE = 1 << 20
"""Bytes at the end of the file that are looked at for a line that was cut short."""


@dataclass(frozen=True)
class ManifestRow:
    """What became of one recording.

    Attributes
    ----------
    recording, run : paths
    status : "done", "failed" or "interrupted"
    reason : why it failed, empty otherwise
    text : the summary for people, empty where it failed
    seconds : wall-clock time
    frames : rows of its track
    """

    recording: str
    run: str
    status: str
    reason: str = ""
    text: str = ""
    seconds: float = 0.0
    frames: int = 0


KINDS: dict[str, tuple[type, ...]] = {
    f.name: {"str": (str,), "int": (int,), "float": (float, int)}[str(f.type)] for f in fields(ManifestRow)
}
"""Field of a row -> the types that JSON gives it."""


class Manifest:
    """The manifest of a batch's output folder; rows are appended, the last one of a recording counts.

    Raises
    ------
    UsageError
        The folder holds a manifest of something else.
    """

    def __init__(self, folder: str | Path) -> None:
        self.path = Path(folder) / MANIFEST_FILE
        self.rows: dict[str, ManifestRow] = {}
        for number, line in enumerate(self._lines()):
            value = parse_json(line, f"line {number + 1} of {self.path}", UsageError, "choose another output")
            if number == 0 and value == {"command": COMMAND}:
                continue
            self._remember(value, number)

    def _lines(self) -> list[str]:
        if not os.path.lexists(self.path):
            return []
        text = read_text(self.path, UsageError, "choose another output", inside=True)
        # A line without an end was cut short by a kill: its recording is tracked again.
        lines = text.split("\n")[:-1]
        if lines and lines[0] != json.dumps({"command": COMMAND}):
            raise UsageError(f"{self.path} is the manifest of something else; choose another output")
        return lines

    def _remember(self, value: object, number: int) -> None:
        if not (isinstance(value, dict) and {"recording", "run", "status"} <= value.keys() <= KINDS.keys()) or not all(
            type(value[name]) in KINDS[name] for name in value
        ):
            raise UsageError(f"line {number + 1} of {self.path} is no row of a manifest; choose another output")
        row = ManifestRow(**value)
        self.rows[row.recording] = row

    def append(self, row: ManifestRow) -> None:
        """Add a row; it is on disk when this returns.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        self.rows[row.recording] = row
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with open_file(self.path, "a+b", inside=True) as stream:
                end = stream.seek(0, os.SEEK_END)
                stream.seek(-min(end, LONGEST_LINE), os.SEEK_END)
                torn = len(stream.read().rpartition(b"\n")[2])  # of a last line that was cut short
                stream.truncate(end - torn)
                lines = [] if end > torn else [{"command": COMMAND}]
                stream.write("".join(json.dumps(line) + "\n" for line in [*lines, asdict(row)]).encode())
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {error.strerror or error}; free some space") from error
