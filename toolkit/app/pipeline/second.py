"""Second pass over a recording: all people are tracked again, forward and backward from keyframes."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.app.pipeline.run_writer import RunSink
from toolkit.body.body import Body
from toolkit.io.archives import Column
from toolkit.io.checkpoint import check_state, load_checkpoint, numbered, save_checkpoint
from toolkit.io.files import is_folder
from toolkit.people.evidence import Evidence, export_evidence, furniture, restore_evidence
from toolkit.sensing.camera import Camera
from toolkit.tracking.person import PREDICTED
from toolkit.tracking.planning import Plan
from toolkit.tracking.sightings import SightingFile, StoredSighting
from toolkit.tracking.state import body_of, body_state
from toolkit.tracking.tracker_protocol import LooksBack
from toolkit.tracking.trajectory_choice import TrajectoryStore
from toolkit.tracks import EMPTY, FrameResult

FOLDER, BEFORE_FOUND = "second", "before"
"""Folder of the second pass within an unfinished run, and within it that of sightings before the first detection."""
STATE_FILE = "state.npz"
MEMORY_SECONDS = 2.0
"""Interval of stored states, seconds; a killed run loses at most this much work."""


class SecondPass:
    """Second pass over the people of a recording, one after the other; its rows replace those of the first pass.

    Parameters
    ----------
    run : the run folder, in which the sightings of the first pass lie
    tracker : that of the first pass
    camera, level_rotation : of the sightings
    timestamps : float64 (T,), seconds, of all frames
    floor : y of the floor, metres, level frame, None where it is not known
    sink : holds the rows of the first pass

    Attributes
    ----------
    bodies : of all people, by id: after `begin` or `restore` those of the first pass, then their own
    evidence : of all people and of what is furniture, by id, from the first pass
    """

    def __init__(
        self,
        run: Path,
        tracker: LooksBack,
        camera: Camera,
        level_rotation: np.ndarray,
        timestamps: np.ndarray,
        floor: float | None,
        sink: RunSink,
    ) -> None:
        self._folder, self._tracker, self._camera, self._rotation = run / FOLDER, tracker, camera, level_rotation
        self._timestamps, self._floor, self._sink = timestamps, floor, sink
        self.bodies: dict[int, Body] = {}
        self.evidence: dict[int, Evidence] = {}
        self._finished = 0
        self._resumed: Mapping[str, Any] = {}

    def sightings(self, frames: int) -> SightingFile:
        """Return the store of the first pass's sightings; a resumed run keeps those of its first `frames`."""
        if frames == 0 and is_folder(self._folder):  # rmtree would wait for a writer of a pipe
            shutil.rmtree(self._folder, ignore_errors=True)
        return SightingFile(self._folder, self._camera, frames)

    def begin(
        self, bodies: Mapping[int, Body], evidence: Mapping[int, Evidence], before: Iterable[tuple[int, StoredSighting]]
    ) -> None:
        """Begin after the first pass with its bodies and evidence; `before` are frames before people were detected,
        and their
        sightings.
        """
        with closing(SightingFile(self._folder / BEFORE_FOUND, self._camera)) as file:
            for frame, kept in sorted(before, key=lambda seen: seen[0]):
                file.append(frame, [kept.sighting()])
        self.bodies, self.evidence, self._finished, self._resumed = dict(bodies), dict(evidence), 0, {}
        self._keep({})

    def restore(self) -> bool:
        """Restore an unfinished run; return True if its first pass was finished.

        Raises
        ------
        TrackError
            It is no state of a second pass.
        """
        if not (self._folder / STATE_FILE).exists():
            return False
        state = load_checkpoint(self._folder / STATE_FILE, self._tracker.settings.tracker)
        check_state(state, {"finished": Column("iu", (), 0)}, ("bodies", "evidence", "person"), "second pass")
        self.bodies = {person: body_of(own) for person, own in numbered(state["bodies"], "second pass").items()}
        self.evidence = restore_evidence(state["evidence"])
        self._finished, self._resumed = state["finished"], state["person"]
        if self._resumed:
            check_state(self._resumed, {}, ("plan", "steps"), "person")
        return self._sink.rows(self.bodies.keys() - furniture(self.evidence)) == len(self._timestamps)

    def follow(self, stop: threading.Event, report: Callable[[int, int], None]) -> bool:
        """Track all people until a stop is requested; return True if all are done."""
        people = sorted(self.bodies)
        frames = len(self._timestamps)
        total = len(people) * frames
        with ExitStack() as opened:
            folders = self._folder, self._folder / BEFORE_FOUND
            files = [opened.enter_context(closing(SightingFile(folder, self._camera, frames))) for folder in folders]
            for number in range(self._finished, len(people)):
                for done in self._person(people[number], *files):
                    report(number * frames + done, total)
                    if stop.is_set():
                        return False
                self._finished, self._resumed = number + 1, {}
                self._keep({})
        shutil.rmtree(self._folder)
        self._sink.judge(self.evidence)
        return True

    def _person(self, person: int, sightings: SightingFile, before_found: SightingFile) -> Iterator[int]:
        """Track one person and replace the rows; `stop` may end it between two steps."""
        seen, stages = sightings.of(person, before_found.of(person)), self._tracker.stage_names
        first_pass, frames = self._sink.past(person), len(self._timestamps)
        if "plan" in self._resumed:
            plan: Plan | None = Plan.restore(self._resumed["plan"], frames)
        else:
            planner = self._tracker.planner(
                self._camera, self._rotation, seen, self._timestamps, self.bodies[person], first_pass, self._floor
            )
            for _ in planner.run():
                yield 0
            plan = planner.plan
        if plan is None:
            return  # too little was seen: the rows of the first pass are kept
        trajectory = TrajectoryStore(
            self._folder / f"trajectory_{person}", len(stages), len(self._tracker.source_names)
        )
        both = self._tracker.bidirectional(
            self._camera, self._rotation, seen, self._timestamps, trajectory, plan, first_pass
        )
        if "plan" in self._resumed:
            both.restore_state(self._resumed["steps"])
        kept = time.monotonic()
        for done, must in enumerate(both.run()):
            if must or time.monotonic() - kept > MEMORY_SECONDS:
                self._keep({"plan": plan.export(), "steps": both.export_state()})
                kept = time.monotonic()
            yield min(done, len(self._timestamps) - 1)
        self._sink.replace(person, self._rows(person, trajectory))
        self.bodies[person] = plan.body
        trajectory.close()
        # Minimum fraction of frames with detected joints for a motionless track to count as a person (coats: 0.14).
        min_detected_fraction = 0.5
        if person in self.evidence:
            poses = self._sink.past(person)["pose"][seen.frames]
            energies = [sum(term.energy(pose) for term in self._tracker.priors) for pose in poses]
            own = replace(self.evidence[person], unlikely=float(np.median(energies)))
            is_person = own.lifeless and seen.detected_fraction() >= min_detected_fraction
            self.evidence[person] = replace(own, unlikely=0.0) if is_person else own

    def _rows(self, person: int, trajectory: TrajectoryStore) -> Iterator[tuple[FrameResult, float]]:
        """Return all rows of a person; frames out of view repeat the last pose, earlier ones the first."""
        spent = self._sink.past(person)["stage_ms"]
        predicted = self._tracker.source_names.index(PREDICTED)
        known = next(step for step in map(trajectory.get, range(len(self._timestamps))) if step is not None)
        last = replace(known.result, source=predicted, **_nothing(known.result))
        for frame, moment in enumerate(self._timestamps.tolist()):
            step = trajectory.get(frame)
            if step is None:
                yield replace(last, stage_ms=spent[frame]), moment
            else:
                yield replace(step.result, stage_ms=step.result.stage_ms + spent[frame]), moment
                last = replace(step.result, source=predicted, **_nothing(step.result))

    def _keep(self, person: Mapping[str, Any]) -> None:
        state = {
            "bodies": {str(person): body_state(body) for person, body in self.bodies.items()},
            "evidence": export_evidence(self.evidence),
            "finished": self._finished,
            "person": person,
        }
        save_checkpoint(self._folder / STATE_FILE, self._tracker.settings.tracker, state)


def _nothing(result: FrameResult) -> dict[str, Any]:
    """Return the row entries of unknown joints."""
    return {
        "state": EMPTY,
        "confidence": np.zeros_like(result.confidence),
        "observed": np.zeros_like(result.observed),
    }
