"""`manifest.jsonl`: one JSON line with the outcome of each recording of a batch."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from toolkit.io.errors import OutputError, UsageError, os_errors_as
from toolkit.io.safe_open import open_file

MANIFEST_FILE = "manifest.jsonl"
DONE, FAILED, INTERRUPTED = "done", "failed", "interrupted"
HEAD = b'{"command": "track"}\n'
"""Content of the first line."""


@dataclass(frozen=True)
class ManifestRow:
    """Outcome of one recording.

    Attributes
    ----------
    recording, run : paths
    status : "done", "failed" or "interrupted"
    reason : why it failed, empty otherwise
    text : the summary for people, empty where it failed
    seconds : wall-clock time
    frames : rows of its track
    tracked : frames in which a person is tracked, of all people together
    warnings : reasons to doubt the recording or its track
    """

    recording: str
    run: str
    status: str
    reason: str = ""
    text: str = ""
    seconds: float = 0.0
    frames: int = 0
    tracked: int = 0
    warnings: tuple[str, ...] = ()


class Manifest:
    """Manifest in the output folder of a batch; replaces the manifest of an earlier batch.

    Attributes
    ----------
    path : path of the file, which is written with its first row
    rows : so far, by recording

    Raises
    ------
    UsageError
        The folder holds a manifest of another program.
    """

    def __init__(self, folder: str | Path) -> None:
        self.path = Path(folder) / MANIFEST_FILE
        self.rows: dict[str, ManifestRow] = {}
        if not os.path.lexists(self.path):
            return
        with os_errors_as(UsageError, f"cannot read {self.path}", "choose another output"):
            with open_file(self.path, inside=True) as stream:
                own = HEAD.startswith(stream.readline(len(HEAD)))  # a partially written first line counts as a header
        if not own:
            raise UsageError(f"{self.path} is the manifest of something else; choose another output")

    def append(self, row: ManifestRow) -> None:
        """Append a row; it is on the disk when this returns.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        with os_errors_as(OutputError, f"cannot write {self.path}", "free some space"):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with open_file(self.path, "a+b" if self.rows else "w+b", inside=True) as stream:
                stream.write((b"" if self.rows else HEAD) + json.dumps(asdict(row)).encode() + b"\n")
                stream.flush()
                os.fsync(stream.fileno())
        self.rows[row.recording] = row
