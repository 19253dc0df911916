"""The second pass over one person of a recording, in this process or in a worker process."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.app.pipeline.trackers import TrackerRecipe, worker_tracker
from toolkit.app.pipeline.watch import stop_request
from toolkit.body.body import Body
from toolkit.io.checkpoint import check_state, load_checkpoint, save_checkpoint
from toolkit.sensing.camera import Camera
from toolkit.tracking.planning import Plan
from toolkit.tracking.sightings import PersonSightings, SightingFile
from toolkit.tracking.tracker_protocol import TwoPassTracker
from toolkit.tracking.trajectory_choice import TrajectoryStore

BEFORE_FOUND = "before"
"""Folder within that of the second pass: sightings of frames before people were found."""
STOP_FILE = "stop"
"""File in the folder of the second pass that ends the worker processes."""
MEMORY_SECONDS = 2.0
"""Interval between two stored states, seconds; a killed run loses at most this much work."""


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

    @property
    def state_file(self) -> Path:
        """File of the plan and of the steps so far."""
        return self.folder / f"person_{self.person}.npz"

    def trajectory(self, tracker: TwoPassTracker) -> TrajectoryStore:
        """Return the store of the person's steps."""
        path = self.folder / f"trajectory_{self.person}"
        return TrajectoryStore(path, len(tracker.stage_names), len(tracker.source_names))

    def sightings(self, stack: ExitStack) -> PersonSightings:
        """Return the sightings of the person, open until the stack is closed."""
        folders = self.folder, self.folder / BEFORE_FOUND
        frames = len(self.timestamps)
        both = [stack.enter_context(closing(SightingFile(folder, self.camera, frames))) for folder in folders]
        return both[0].of(self.person, both[1].of(self.person))

    def run(self, tracker: TwoPassTracker) -> Iterator[tuple[int, Plan | None]]:
        """Plan and follow, from where an unfinished run stopped; yield the frames done with the plan after each step.

        The caller may stop between two steps. Without a plan at the end too little was seen.
        """
        kind, plan, steps = tracker.settings.tracker, None, None
        camera, rotation, times = self.camera, self.level_rotation, self.timestamps
        with ExitStack() as stack:
            seen = self.sightings(stack)
            if self.state_file.exists():
                state = load_checkpoint(self.state_file, kind)
                check_state(state, {}, ("plan", "steps"), "person")
                plan, steps = Plan.restore(state["plan"], len(times)), state["steps"]
            else:
                planner = tracker.planner(camera, rotation, seen, times, self.body, self.first_pass, self.floor)
                for _ in planner.run():
                    yield 0, None
                plan = planner.plan
            if plan is None:
                return
            trajectory = stack.enter_context(closing(self.trajectory(tracker)))
            both = tracker.bidirectional(camera, rotation, seen, times, trajectory, plan, self.first_pass)
            if steps is not None:
                both.restore_state(steps)
            kept = time.monotonic()
            for done, must in enumerate(both.run()):
                if must or time.monotonic() - kept > MEMORY_SECONDS:
                    save_checkpoint(self.state_file, kind, {"plan": plan.export(), "steps": both.export_state()})
                    kept = time.monotonic()
                yield min(done, len(times) - 1), plan
            yield len(times) - 1, plan


def follow_in_worker(task: PersonTask, recipe: TrackerRecipe) -> tuple[Plan | None, bool]:
    """Follow a person in a worker process; return the plan, and whether the person is done."""
    tracker, plan = worker_tracker(recipe), None
    assert isinstance(tracker, TwoPassTracker), "only trackers with two passes have tasks"
    with stop_request() as stop:
        for step in task.run(tracker):
            plan = step[1]
            if stop.is_set() or (task.folder / STOP_FILE).exists():
                return None, False
    return plan, True
