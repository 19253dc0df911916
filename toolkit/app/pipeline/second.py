"""Second pass over a recording: all people are tracked backwards, with detections in keyframes."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np

from toolkit.app.pipeline.run_writer import RunSink
from toolkit.app.pipeline.trackers import TrackerRecipe, worker_tracker
from toolkit.app.pipeline.watch import stop_request
from toolkit.body.body import Body
from toolkit.io.checkpoint import load_checkpoint, restore, save_checkpoint
from toolkit.io.files import is_folder
from toolkit.io.parts import Parts
from toolkit.io.workers import task_of
from toolkit.people.evidence import Evidence, furniture
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.recording import Recording
from toolkit.tracking.passes import Followed
from toolkit.tracking.person import PREDICTED
from toolkit.tracking.searching import SearchingTracker
from toolkit.tracking.sightings import PersonSightings, SightingFile, StoredSighting
from toolkit.tracking.trajectory_choice import Step
from toolkit.tracks import EMPTY, TRACKED, FrameResult

FOLDER = "second"
"""Folder of the second pass within an unfinished run."""
STATE_FILE = "state.npz"
SHARED_FRAMES = 2000
"""Frames in which people are in sight, summed over them, from which on worker processes share them: 20 to 40 s of
processor time; a process takes 3.5 s to start."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "NUMBA_NUM_THREADS")
"""Environment variables that keep a worker process to one thread."""
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


class SecondPass:
    """Second pass over the people of a recording, one after the other; its rows replace those of the first pass.

    Parameters
    ----------
    run : the run folder, in which the sightings of the first pass lie
    tracker : tracker of the first pass
    recording : read in the first pass
    floor : y of the floor, metres, level frame, None where it is not known
    sink : holds the rows of the first pass
    workers : number of processes that share the people
    recipe : recipe of the tracker in each process; None = this process only

    Attributes
    ----------
    bodies : bodies of all people, by id: after `begin` or `restore` those of the first pass, then their own
    evidence : evidence of all people and of furniture, by id, from the first pass
    """

    CHECKPOINT = ("bodies", "evidence", "_finished")
    bodies: dict[int, Body]
    evidence: dict[int, Evidence]
    _finished: list[int]

    def __init__(
        self,
        run: Path,
        tracker: SearchingTracker,
        recording: Recording,
        floor: float | None,
        sink: RunSink,
        workers: int = 1,
        recipe: TrackerRecipe | None = None,
    ) -> None:
        self._folder, self._tracker, self._floor, self._sink = run / FOLDER, tracker, floor, sink
        self._camera = DepthFilter(recording.camera, tracker.settings.sensing).camera
        self._rotation, self._timestamps = level_rotation(recording.up_camera), recording.timestamps
        self.bodies, self.evidence, self._finished = {}, {}, []
        self._workers, self._recipe = workers, recipe

    def sightings(self, frames: int) -> SightingFile:
        """Return the store of the first pass's sightings; a resumed run keeps those of its first `frames`."""
        if frames == 0 and is_folder(self._folder):  # rmtree would wait for a writer of a pipe
            shutil.rmtree(self._folder, ignore_errors=True)
        return SightingFile(self._folder, self._camera, frames)

    def begin(
        self, bodies: Mapping[int, Body], evidence: Mapping[int, Evidence], before: Iterable[tuple[int, StoredSighting]]
    ) -> None:
        """Begin after the first pass with its bodies and evidence; `before`: earlier frames and their sightings."""
        with closing(SightingFile(self._folder / BEFORE_FOUND, self._camera)) as file:
            for frame, kept in sorted(before, key=lambda seen: seen[0]):
                file.append(frame, [kept.sighting()])
        self.bodies, self.evidence, self._finished = dict(bodies), dict(evidence), []
        self._keep()

    def restore(self) -> bool:
        """Restore an unfinished run; return True if its first pass was finished.

        Raises
        ------
        TrackError
            It is no state of a second pass.
        """
        if not (self._folder / STATE_FILE).exists():
            return False
        restore(self, load_checkpoint(self._folder / STATE_FILE, self._tracker.settings.tracker), "second pass")
        return self._sink.rows(self.bodies.keys() - furniture(self.evidence)) == len(self._timestamps)

    def follow(self, stop: threading.Event, report: Callable[[int, int], None]) -> bool:
        """Follow all people, until a stop is requested; return whether all are done."""
        people, frames = sorted(self.bodies), len(self._timestamps)
        tasks = [self._task(person) for person in people if person not in self._finished]
        if self._shared(tasks):
            self._follow_together(tasks, stop, lambda: report(frames * len(self._finished), frames * len(people)))
        for task in tasks:
            if task.person in self._finished:
                continue
            parts = task.run(self._tracker)
            for done in count():
                try:
                    next(parts)
                except StopIteration as ended:
                    self._put_in_place(task, ended.value)
                    break
                report(frames * len(self._finished) + min(done, frames - 1), frames * len(people))
                if stop.is_set():
                    return False
        if stop.is_set():
            return False
        shutil.rmtree(self._folder)
        self._sink.remove_furniture(self.evidence)
        return True

    def _task(self, person: int) -> PersonTask:
        return PersonTask(
            self._folder, person, self._camera, self._rotation, self._timestamps, self._floor, self.bodies[person],
            self._sink.past(person),
        )  # fmt: skip

    def _shared(self, tasks: Sequence[PersonTask]) -> bool:
        """Return whether worker processes save time: each takes some seconds to start."""
        if self._recipe is None or self._workers < 2 or len(tasks) < 2:
            return False
        with ExitStack() as stack:
            return sum(len(task.sightings(stack).frames) for task in tasks) >= SHARED_FRAMES

    def _follow_together(self, tasks: Sequence[PersonTask], stop: threading.Event, report: Callable[[], None]) -> None:
        """Follow people in worker processes; those of a process that dies are left."""
        from joblib.externals.loky import ProcessPoolExecutor
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        (self._folder / STOP_FILE).unlink(missing_ok=True)
        longest = sorted(tasks, key=lambda task: -np.count_nonzero(task.first_pass["state"] == TRACKED))
        # A pool of its own: joblib keeps the reusable one for itself.
        with ProcessPoolExecutor(min(self._workers, len(tasks)), env=dict.fromkeys(THREADS, "1")) as pool:
            running = {pool.submit(task_of(follow_in_worker), task, self._recipe): task for task in longest}
            try:
                while running:
                    report()
                    if stop.is_set():
                        (self._folder / STOP_FILE).touch()
                    for future in wait(running, timeout=0.2, return_when=FIRST_COMPLETED).done:
                        task = running.pop(future)
                        try:
                            followed, done = future.result()
                        except TerminatedWorkerError:
                            continue
                        if done:
                            self._put_in_place(task, followed)
            except BaseException:
                (self._folder / STOP_FILE).touch()  # the others end, too
                raise

    def _put_in_place(self, task: PersonTask, followed: Followed | None) -> None:
        """Replace the rows and the body of a person who is done."""
        person = task.person
        if followed is not None:  # otherwise too little was seen: the rows of the first pass stay
            self._sink.replace(person, self._rows(person, followed.steps))
            self.bodies[person] = followed.body
        self._finished.append(person)
        self._keep()

    def _rows(self, person: int, steps: Mapping[int, Step]) -> Iterator[tuple[FrameResult, float]]:
        """Return all rows of a person; frames out of view repeat the last pose, earlier ones the first."""
        spent = self._sink.past(person)["stage_ms"]
        predicted = self._tracker.source_names.index(PREDICTED)
        last = steps[min(steps)].result
        for frame, moment in enumerate(self._timestamps.tolist()):
            if frame in steps:
                last = steps[frame].result
                yield replace(last, stage_ms=last.stage_ms + spent[frame]), moment
                continue
            nothing = {"confidence": np.zeros_like(last.confidence), "observed": np.zeros_like(last.observed)}
            yield replace(last, stage_ms=spent[frame], state=EMPTY, source=predicted, **nothing), moment

    def _keep(self) -> None:
        save_checkpoint(self._folder / STATE_FILE, self._tracker.settings.tracker, self)
