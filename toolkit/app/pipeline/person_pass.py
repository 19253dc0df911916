"""The second pass over one person of a recording, in this process or in a worker process."""

from __future__ import annotations

from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.app.pipeline.trackers import TrackerRecipe, worker_tracker
from toolkit.app.pipeline.watch import stop_request
from toolkit.body.body import Body
from toolkit.io.parts import Parts
from toolkit.sensing.camera import Camera
from toolkit.tracking.passes import Followed
from toolkit.tracking.searching import SearchingTracker
from toolkit.tracking.sightings import PersonSightings, SightingFile

BEFORE_FOUND = "before"
"""Folder within that of the second pass: sightings of frames before people were found."""
STOP_FILE = "stop"
"""File in the folder of the second pass that ends the worker processes."""


@dataclass(frozen=True, eq=False)
class PersonTask:
    """Input of the second pass over one person.

    Attributes
    ----------
    folder : folder of the second pass, with the sightings of all people
    person : number of the person
    camera, level_rotation : those of the sightings
    timestamps : float64 (T,), seconds, of all frames
    floor : y of the floor, metres, level frame, None where it is not known
    body : the person's body from the first pass
    first_pass : rows (T,) of the first pass, with the track's columns
    """

    folder: Path
    person: int
    camera: Camera
    level_rotation: np.ndarray
    timestamps: np.ndarray
    floor: float | None
    body: Body
    first_pass: np.ndarray

    def sightings(self, stack: ExitStack) -> PersonSightings:
        """Return the sightings of the person, open until the stack is closed."""
        folders = self.folder, self.folder / BEFORE_FOUND
        frames = len(self.timestamps)
        both = [stack.enter_context(closing(SightingFile(folder, self.camera, frames))) for folder in folders]
        return both[0].of(self.person, both[1].of(self.person))

    def run(self, tracker: SearchingTracker) -> Parts[Followed | None]:
        """Plan and follow, a frame at a time; return None if too little was seen."""
        with ExitStack() as stack:
            return (
                yield from tracker.second_pass(
                    self.camera, self.level_rotation, self.sightings(stack), self.timestamps, self.body,
                    self.first_pass, self.floor,
                )
            )  # fmt: skip


def follow_in_worker(task: PersonTask, recipe: TrackerRecipe) -> tuple[Followed | None, bool]:
    """Follow a person in a worker process; return the result, and whether the person is done."""
    tracker = worker_tracker(recipe)
    assert isinstance(tracker, SearchingTracker), "only trackers with two passes have tasks"
    parts = task.run(tracker)
    with stop_request() as stop:
        while not (stop.is_set() or (task.folder / STOP_FILE).exists()):
            try:
                next(parts)
            except StopIteration as ended:
                return ended.value, True
    return None, False
