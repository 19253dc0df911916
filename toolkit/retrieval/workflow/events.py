"""Events of a run that is over, as if it were going on."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from toolkit.files import save_text
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.online import Event, OnlineAnnotator
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.track import EMPTY, RunInfo, Track

STANDARD_OUTPUT = "-"


def replay(
    run: str | Path,
    classes: Sequence[MotionClass],
    queries: Sequence[KeyframeQuery] = (),
) -> Iterator[Event]:
    """Events in the order in which they would have been told while the run was tracked.

    Frames in which no person was there are left out.

    Raises
    ------
    TrackError
        There is no finished run.
    """
    track, info = Track.load(run), RunInfo.load(run)
    steps = np.diff(track.timestamps)
    rate = 1.0 / float(np.median(steps)) if len(steps) and np.median(steps) > 0 else 30.0
    annotator = OnlineAnnotator(classes, info.body(), rate, queries)
    for pose, state, time in zip(track.pose, track.state, track.timestamps, strict=True):
        if state != EMPTY:
            yield from annotator.push(pose, float(time))
    yield from annotator.finish()


def write_events(events: Iterator[Event], output: str | Path) -> int:
    """One JSON line per event: flushed one by one to the standard output (`-`), else to a file, whole or not at all.

    Returns
    -------
    Number of events.
    """
    if str(output) == STANDARD_OUTPUT:
        count = 0
        for event in events:
            print(event.to_json(), flush=True, file=sys.stdout)
            count += 1
        return count
    lines = [event.to_json() for event in events]
    save_text(output, "".join(f"{line}\n" for line in lines))
    return len(lines)
