"""A person of a recording followed from the surest frame outwards, once all of it has been seen.

A recorded cloud has no first frame. The body is learnt where most of the person is to be seen (`survey.py`); there the
person is found, and followed forwards and backwards. Other frames that show much of them are looked at afresh: where
these say something else, and at every jump, a second way is followed until it meets the first, and of two ways through
a stretch the one that explains it stays (`ways.py`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from toolkit.body.body import Body
from toolkit.io.archives import Column
from toolkit.io.checkpoint import HINT, check_state, numbered
from toolkit.io.errors import TrackError
from toolkit.tracking.follower import Follower
from toolkit.tracking.frame_detection import Detection, FrameDetector
from toolkit.tracking.heading import heading_disagreement
from toolkit.tracking.search.search_protocol import UNLIKELY
from toolkit.tracking.sightings import PersonSightings
from toolkit.tracking.state import PersonState, Previous, State, body_of, body_state
from toolkit.tracking.trajectory_choice import Step, TrajectoryStore, apart, better_parts
from toolkit.tracks import EMPTY, TRACKED

AGREED, AGREED_FRAMES = 0.04, 3
"""Metres, and frames in a row: two ways so near to each other have met."""
OTHERWISE = 0.10
"""Metres, mean over the joints, from which on a frame looked at afresh says something else."""
JUMP = 0.05
"""Metres, mean over the joints, to a pose that does not go on from the one before: one of the two was wrong."""
DISAGREED = 5
"""Frames in a row in which the first pass says something else, before its way is followed too."""
REPAIRED = 300
"""Frames that a second way is followed at most."""
TURNED_FROM = 0.5
"""What the heading says against a pose, see `heading_disagreement`, from which on the frame is looked at afresh."""
FIRST_PASS = 2
"""In place of a direction: from the pose of the first pass, in both."""
_PLAN = {
    "stretches": Column("iu", ("stretches", 3), 0), "checks": Column("iu", ("checks", 3), 0),
    "heading": Column("f", ("frames", 2), -1.0, 1.0),
}  # fmt: skip
_STEPS = {"leg": Column("iu", (), 0), "repairs": Column("iu", ("repairs", 3), -1, optional=True)}


@dataclass(frozen=True, eq=False)
class Plan:
    """Where a person is begun.

    Attributes
    ----------
    body : the person's own
    stretches : int64 (S, 3), of each time in sight the first and last frame, and the surest one between them
    checks : int64 (C, 3), further frames that are looked at afresh, each with the number of its stretch, and 0
    heading : float64 (T, 2), where the person heads in each frame, see `toolkit.tracking.heading.heading`
    looks : at some of these frames, by which they were chosen; they are not kept on disk, for they can be had again
    """

    body: Body
    stretches: np.ndarray
    checks: np.ndarray
    heading: np.ndarray
    looks: Mapping[int, Detection] = field(default_factory=dict)

    def export(self) -> State:
        """As plain arrays, numbers and text."""
        plain = ("stretches", "checks", "heading")
        return {"body": body_state(self.body), **{name: getattr(self, name) for name in plain}}

    @classmethod
    def restore(cls, state: Mapping[str, Any]) -> Plan:
        """What `export` gave; raises TrackError for what no planner plans."""
        check_state(state, _PLAN, ("body",), "plan")
        return cls(body_of(state["body"]), state["stretches"], state["checks"], state["heading"])

    def check(self, frames: int, repairs: np.ndarray | None, pending: Collection[int]) -> None:
        """Raise TrackError where a stretch or a frame of the second pass lies outside of a recording of `frames`."""
        first, last, start = self.stretches.T
        moments = self.checks if repairs is None else np.concatenate([self.checks, repairs])
        moments = moments[:, :2]
        inside = (moments >= 0).all() and (moments < [frames, len(self.stretches)]).all()
        fits = ((first <= start) & (start <= last) & (last < frames)).all()
        if not (inside and fits) or max(pending, default=-1) >= frames or len(self.heading) != frames:
            raise TrackError(f"the second pass is of another recording; {HINT}")


class BidirectionalTracker:
    """One person of a recording, followed forwards and backwards from the surest frames.

    Parameters
    ----------
    follower : follows with the person's own body
    seen : the person's sightings
    timestamps : float64 (T,), seconds, of all frames of the recording
    way : where the steps go
    plan : where to begin
    stages : names of the follower's stages
    first_pass : the person's rows (T,) as one pass had them, with the track's columns; None without
    """

    def __init__(
        self,
        follower: Follower,
        seen: PersonSightings,
        timestamps: np.ndarray,
        way: TrajectoryStore,
        plan: Plan,
        stages: tuple[str, ...],
        first_pass: np.ndarray | None = None,
    ) -> None:
        self._follower, self._looker = follower, FrameDetector(follower, seen, timestamps, stages, plan.heading)
        self._timestamps, self._first_pass = timestamps, first_pass
        self._way, self._plan = way, plan
        self._unknown = replace(follower.state, body=plan.body, sized=True)
        self._leg, self._frame, self._state = 0, -1, self._unknown
        self._repairs: np.ndarray | None = None
        self._pending: dict[int, Step] = {}

    def run(self) -> Iterator[bool]:
        """Follow everything, by frames; the caller may stop in between, or keep `export_state`: True says to."""
        legs = [(stretch, turn) for stretch in self._plan.stretches for turn in (1, -1)]
        while self._leg < len(legs):
            yield from self._followed(*legs[self._leg])
            self._leg, self._frame = self._leg + 1, -1
        if self._repairs is None:
            self._repairs = np.concatenate([self._turned(), self._plan.checks, self._jumps(), self._disagreements()])
            yield True
        while self._leg < len(legs) + len(self._repairs):
            yield from self._repaired(*self._repairs[self._leg - len(legs)].tolist())
            self._leg += 1

    def export_state(self) -> State:
        """All that the rest depends on besides sightings, plan and way."""
        return {
            "leg": self._leg,
            "frame": self._frame,
            "state": self._state.export(),
            "repairs": self._repairs,
            "pending": {str(frame): self._way.packed(step) for frame, step in self._pending.items()},
        }

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `export_state` gave; raises TrackError for what it never gives."""
        frames = len(self._timestamps)
        check_state(state, {**_STEPS, "frame": Column("iu", (), -1, frames)}, ("state", "pending"), "second pass")
        pending = numbered(state["pending"], "way")
        self._plan.check(frames, state["repairs"], pending)
        self._leg, self._frame, self._repairs = state["leg"], state["frame"], state["repairs"]
        self._state = PersonState.restore(state["state"])
        for frame, packed in pending.items():
            self._way.put_back(frame, packed)
        self._leg += bool(state["pending"])

    def _followed(self, stretch: np.ndarray, turn: int) -> Iterator[bool]:
        """From the surest frame of a stretch to its last one, or (`turn` -1) from the one before it to the first."""
        first, last, start = stretch.tolist()
        end = last + 1 if turn > 0 else first - 1
        if self._frame < 0:
            self._way[start] = self.start_at(start)
            self._frame = start + turn
        else:
            self._follower.state = self._state
        for frame in range(self._frame, end, turn):
            self._way[frame] = self.step_at(frame)
            self._frame, self._state = frame + turn, self._follower.state
            yield False

    def start_at(self, frame: int) -> Step:
        """Find the person anew in a frame."""
        look = self._plan.looks.get(frame) or self._looker.redetect(frame, self._plan.body)
        self._follower.state = look.state
        return look.step

    def step_at(self, frame: int) -> Step:
        """Follow on to a frame."""
        return self._looker.follow(frame)

    def _jumps(self) -> np.ndarray:
        """Repairs from behind every jump: int64 (J, 3), frame to begin in, its stretch, and 1 or -1 for where to.

        The surest frames come first, whichever way time runs.
        """
        found: list[tuple[float, int, int, int]] = []
        for number, (first, last, start) in enumerate(self._plan.stretches.tolist()):
            before = self._way[first]
            for frame in range(first + 1, last + 1):
                here = self._way[frame]
                behind, turn, after = (frame, -1, here) if frame > start else (frame - 1, 1, before)
                seen = EMPTY not in (here.result.state, before.result.state)
                if seen and not after.continues and apart(here.result, before.result) > JUMP:
                    found.append((after.cost, behind, number, turn))
                before = here
        return np.array([row for _, *row in sorted(found)], dtype=np.int64).reshape(-1, 3)

    def _turned(self) -> np.ndarray:
        """Where the way has the person head elsewhere: int64 (B, 3), frame to look at afresh, its stretch, and 0."""
        found: list[tuple[int, int, int]] = []
        heading = self._plan.heading
        for number, (first, last, _) in enumerate(self._plan.stretches.tolist()):
            said = [heading_disagreement(heading[f], self._way[f].result.pose) for f in range(first, last + 1)]
            wrong = np.concatenate([[False], np.array(said) > TURNED_FROM, [False]])
            begins, ends = np.flatnonzero(wrong[1:] & ~wrong[:-1]), np.flatnonzero(wrong[:-1] & ~wrong[1:])
            found += [(first + b + int(np.argmax(said[b:e])), number, 0) for b, e in zip(begins, ends, strict=True)]
        return np.array(found, dtype=np.int64).reshape(-1, 3)

    def _disagreements(self) -> np.ndarray:
        """Repairs from where the first pass says something else: int64 (D, 3), frame, stretch, and `FIRST_PASS`."""
        found: list[tuple[int, int, int]] = []
        rows = self._first_pass
        if rows is None:
            return np.empty((0, 3), dtype=np.int64)
        for number, (first, last, _) in enumerate(self._plan.stretches.tolist()):
            since = first
            for frame in range(first, last + 2):
                if frame <= last and rows["state"][frame] == TRACKED == self._way[frame].result.state:
                    gaps = np.linalg.norm(rows["joints"][frame] - self._way[frame].result.joints, axis=1)
                    if gaps.mean() > OTHERWISE:
                        continue
                if frame - since >= DISAGREED:
                    found.append(((since + frame) // 2, number, FIRST_PASS))
                since = frame + 1
        return np.array(found, dtype=np.int64).reshape(-1, 3)

    def _repaired(self, frame: int, number: int, turn: int) -> Iterator[bool]:
        """A second way from `frame`: in one direction (`turn`) from the pose there, or in both from another pose."""
        first, last, _ = self._plan.stretches[number].tolist()
        steps: dict[int, Step] = {}
        state = self._state_at(frame)
        if turn == FIRST_PASS:
            assert self._first_pass is not None
            pose = self._first_pass["pose"][frame].astype(np.float64)
            previous = Previous.of_pose(self._plan.body, pose)
            self._follower.state = replace(self._unknown, previous=previous, pose=pose)
            steps[frame], state = self.step_at(frame), self._follower.state
        elif turn == 0:
            found = self._found_otherwise(frame)
            if found is None:
                return
            steps[frame], state = found
        for way, end in ((1, last + 1), (-1, first - 1)):
            if turn in (0, FIRST_PASS, way):
                self._follower.state = state
                yield from self._second_way(range(frame + way, end, way)[:REPAIRED], steps)
        frames = sorted(steps)
        if not frames:
            return
        old, new = ([way[f].cost for f in frames] for way in (self._way, steps))
        gaps = [apart(self._way[f].result, steps[f].result) for f in frames]
        chosen = better_parts(np.array(old), np.array(new), np.array(gaps), (frames[0] == first, frames[-1] == last))
        self._pending = {f: steps[f] for f, better in zip(frames, chosen, strict=True) if better}
        if self._pending:
            yield True
        for f, step in self._pending.items():
            self._way[f] = step
        self._pending = {}

    def _second_way(self, frames: range, steps: dict[int, Step]) -> Iterator[bool]:
        """Follow on through `frames`, until the first way is met; the steps go to `steps`."""
        together = 0
        for frame in frames:
            steps[frame] = self.step_at(frame)
            together = together + 1 if apart(steps[frame].result, self._way[frame].result) < AGREED else 0
            if together == AGREED_FRAMES:
                return
            yield False

    def _found_otherwise(self, frame: int) -> tuple[Step, PersonState] | None:
        """What a look afresh says that explains the frame better than the way does, and the state after it."""
        follower, known, planned = self._follower, self._way[frame], self._plan.looks.get(frame)
        if planned is not None and apart(planned.step.result, known.result) < OTHERWISE:
            return None
        step = self._looker.redetect(frame, self._plan.body).step
        if follower.observation is None or apart(step.result, known.result) < OTHERWISE:
            return None
        scene = follower.observation.scene
        old, new = (follower.objective.compare(self._plan.body, at.result.pose, scene) for at in (known, step))
        before, redetect = (
            follower.weighed(compared.distance + UNLIKELY * compared.energy, at.result.pose)
            for compared, at in ((old, known), (new, step))
        )
        better = redetect < before
        return (step, follower.state) if better else None

    def _state_at(self, frame: int) -> PersonState:
        """As if the way's pose in a frame had just been found there."""
        pose = self._way[frame].result.pose
        previous = Previous.of_pose(self._plan.body, pose)
        return replace(self._unknown, previous=previous, pose=pose, timestamp=float(self._timestamps[frame]))
