"""Live motion events: one JSON line per recognised motion, written during the first pass."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from toolkit.body.body import Body
from toolkit.io.errors import OutputError, os_errors_as
from toolkit.io.files import save_text
from toolkit.io.safe_open import open_file
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.online import Event, OnlineAnnotator
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.tracks import EMPTY, FrameResult

STANDARD_OUTPUT = "-"


class EventStream:
    """Writer of live motion events.

    A resumed run writes the events of the earlier rows again, into an empty file.

    Parameters
    ----------
    classes, queries : see `OnlineAnnotator`
    output : file of the lines, `-` for the standard output
    """

    def __init__(
        self,
        classes: Sequence[MotionClass],
        queries: Sequence[KeyframeQuery] = (),
        output: str | Path = STANDARD_OUTPUT,
    ) -> None:
        self._classes, self._queries = tuple(classes), tuple(queries)
        self._output = str(output)
        self._frame_rate = 30.0
        self._annotator: OnlineAnnotator | None = None

    def begin(self, frame_rate: float, body: Body | None, past: np.ndarray) -> None:
        """Start a run, or resume one after the given rows (records with pose, state and timestamps)."""
        self._frame_rate, self._annotator = frame_rate, None
        if self._output != STANDARD_OUTPUT:
            save_text(self._output, "")
        for row in past if body is not None else ():
            self._append(self._push(row["pose"], int(row["state"]), float(row["timestamps"]), body))

    def row(self, result: FrameResult, timestamp: float, body: Body) -> None:
        """Process one row and write the motions that have ended."""
        self._append(self._push(result.pose, result.state, timestamp, body))

    def end(self) -> None:
        """Write the remaining motions after the last row."""
        if self._annotator is not None:
            self._append(self._annotator.finish())

    def _push(self, pose: np.ndarray, state: int, timestamp: float, body: Body | None) -> list[Event]:
        if state == EMPTY or body is None:
            return []
        if self._annotator is None:
            self._annotator = OnlineAnnotator(self._classes, body, self._frame_rate, self._queries)
        return self._annotator.push(pose, timestamp)

    def _append(self, events: Sequence[Event]) -> None:
        if self._output == STANDARD_OUTPUT:
            for event in events:
                print(event.to_json(), flush=True, file=sys.stdout)
            return
        if not events:
            return
        with os_errors_as(OutputError, f"cannot write events to {self._output}", "choose another file"):
            with open_file(self._output, "a+b") as stream:
                stream.writelines(f"{event.to_json()}\n".encode() for event in events)
