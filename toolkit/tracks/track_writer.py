"""Track written row by row; appended rows survive the death of the process.

While a run lasts its rows stand in `track.partial`: one line of JSON that names the columns' meanings, then one binary
record of fixed size per frame, so that a killed process loses at most the record it was writing.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import OutputError, TrackError, UsageError, os_errors_as
from toolkit.io.files import atomic_path
from toolkit.io.safe_open import open_file
from toolkit.tracks.track import PARTIAL_FILE, ROW, FrameResult, Track, check_rows, row_of, row_type

RESUME = "free some space and continue with --resume"


class TrackWriter:
    """Writer of a track, row by row; appended rows survive the death of the process.

    Parameters
    ----------
    run : the run folder, made if it is missing
    stage_names, source_names : the tracker's
    resume : continue the rows of an unfinished track in this folder, if there is one

    Raises
    ------
    UsageError
        The folder holds an unfinished track and `resume` is not set.
    TrackError
        The unfinished track was written by a tracker with other stages, sources or pose entries, or by none.
    OutputError
        The folder cannot be written.
    """

    def __init__(
        self, run: str | Path, stage_names: tuple[str, ...], source_names: tuple[str, ...], *, resume: bool = False
    ) -> None:
        self.run = Path(run)
        self.stage_names, self.source_names = stage_names, source_names
        self._path = self.run / PARTIAL_FILE
        self._record = row_type(len(stage_names))
        names = {
            "columns": list(ROW),
            "joint_names": skeleton.REPORTED,
            "pose_names": skeleton.POSE_NAMES,
            "stage_names": stage_names,
            "source_names": source_names,
        }
        self._header = json.dumps(names).encode() + b"\n"
        self.rows = 0
        with os_errors_as(OutputError, f"cannot write {self._path}", "choose a folder that can be written"):
            self.run.mkdir(parents=True, exist_ok=True)
            if self._path.exists() and self._path.stat().st_size > 0:
                self._stream = self._reopen(resume)
            else:
                self._stream = self._begin()

    def _begin(self) -> BinaryIO:
        self._stream = open_file(self._path, "w+b", inside=True, buffering=0)
        self._write(self._header)
        return self._stream

    def _reopen(self, resume: bool) -> BinaryIO:
        size = self._path.stat().st_size - len(self._header)
        rows = max(0, size) // self._record.itemsize
        if not resume and rows:
            raise UsageError(
                f"{self.run} holds an unfinished track of {rows} frames; "
                f"add --resume to continue it, or remove {self._path}"
            )
        stream = open_file(self._path, "r+b", inside=True, buffering=0)
        if stream.readline(len(self._header)) != self._header:
            if not rows:  # it was begun and nothing was found yet: so it is begun again
                stream.close()
                return self._begin()
            stream.close()
            raise TrackError(f"{self._path} was begun by another tracker or version; remove it and track again")
        self._stream = stream
        self.cut(rows)
        check_rows(self.past(), len(self.source_names), str(self._path))
        return stream

    def _write(self, data: bytes) -> None:
        if self._stream.write(data) != len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def cut(self, rows: int) -> None:
        """Keep only the first `rows` rows.

        Raises
        ------
        OutputError
            The file cannot be cut.
        """
        end = len(self._header) + rows * self._record.itemsize
        with os_errors_as(OutputError, f"cannot write {self._path}", "free some space"):
            self._stream.truncate(end)
            self._stream.seek(end)
        self.rows = rows

    def append(self, result: FrameResult, timestamp: float) -> None:
        """Append the next frame's row.

        Raises
        ------
        OutputError
            The row cannot be written, for example because the disk is full; the rows before it stay.
        """
        with os_errors_as(OutputError, f"cannot write frame {self.rows} to {self._path}", RESUME):
            self._write(row_of(result, timestamp, self._record).tobytes())
        self.rows += 1

    def keep(self) -> None:
        """Flush the rows to the disk, so that they survive a loss of power.

        Raises
        ------
        OutputError
            The disk does not take them.
        """
        with os_errors_as(OutputError, f"cannot write {self._path}", RESUME):
            os.fsync(self._stream.fileno())

    def replace(self, rows: Iterable[tuple[FrameResult, float]]) -> None:
        """Replace all rows, with their timestamps, or none where that fails.

        Raises
        ------
        OutputError
            The rows cannot be written.
        """
        with atomic_path(self._path) as beside:
            with beside.open("wb") as stream:
                stream.write(self._header)
                count = 0
                for result, timestamp in rows:
                    stream.write(row_of(result, timestamp, self._record).tobytes())
                    count += 1
        self._stream.close()
        self._stream = self._path.open("r+b", buffering=0)
        self.cut(count)

    def past(self) -> np.ndarray:
        """Return the rows so far, as records with the track's columns."""
        if not self.rows:
            return np.empty(0, dtype=self._record)
        return np.memmap(self._path, dtype=self._record, mode="r", offset=len(self._header), shape=(self.rows,))

    def finish(self, *, complete: bool = True, contacts: Callable[[Track], np.ndarray] | None = None) -> Path:
        """Rename the complete file to `track.npz` and return its path.

        With `complete=False` (an interrupted run) the partial file stays until `forget`, so that the run can still be
        resumed. `contacts` returns the foot contacts (T, 2), which need the whole track.
        """
        track = Track.of_rows(self.past(), self.stage_names, self.source_names)
        if contacts is not None:
            track = replace(track, contact=contacts(track))
        path = track.save(self.run)
        self._stream.close()
        if complete:
            self.forget()
        return path

    def forget(self) -> None:
        """Remove the partial file of a finished track."""
        self._path.unlink(missing_ok=True)

    def abandon(self) -> None:
        """Close the partial file, which stays unless it holds no row."""
        self._stream.close()
        if self.rows == 0:
            self._path.unlink(missing_ok=True)
