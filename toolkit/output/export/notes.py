"""Notes on frames without a person, inside a file or, if its format has no field for them, beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.files import save_json
from toolkit.io.spans import spans
from toolkit.output.export.origin import Origin
from toolkit.tracks import LOST
from toolkit.tracks.runs import Person


def notes_of(origin: Origin, people: Sequence[Person]) -> dict[str, Any]:
    """Return the axes, and for each person the intervals (frames from 0) without the person or with a lost one."""
    return {
        "axes": origin.note(),
        "people": [
            {
                "name": person.name,
                "nobody_there": _ranges(~person.there),
                "lost": _ranges(person.track.state == LOST),
            }
            for person in people
        ],
        "meaning": "The nearest pose is held in frames without the person and is no measurement; in lost frames "
        "the pose is predicted.",
    }


def write_notes(path: Path, origin: Origin, people: Sequence[Person]) -> None:
    """Write `<file>.notes.json` beside a file of a format without room for notes.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    save_json(path.with_name(f"{path.name}.notes.json"), notes_of(origin, people))


def _ranges(flags: np.ndarray) -> list[list[int]]:
    return [[span.start, span.stop - 1] for span in spans(flags)]
