"""Base of followers of one person: state, body, and rows of the track."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.placed import Placer
from toolkit.kernels import linear
from toolkit.people.sighting import PredictedBody
from toolkit.tracking.state import PersonState
from toolkit.tracks import FrameResult

PREDICTED = "predicted"
"""Source of a pose without a hypothesis: the last found pose."""
HEAD = skeleton.REPORTED.index("head")


class FollowedPerson:
    """One person in front of one camera; a `PersonFollower` without its step.

    Parameters
    ----------
    state : before the first frame
    placer : places bodies before that camera
    level_rotation : R_level_camera, float64 (3, 3)
    sources : names of the searches, in the order in which the track numbers them

    Attributes
    ----------
    state : everything that the next step depends on besides the sighting; replaced, never changed, by a step
    """

    CHECKPOINT: tuple[str, ...] = ("state",)
    state: PersonState

    def __init__(self, state: PersonState, placer: Placer, level_rotation: np.ndarray, sources: Sequence[str]) -> None:
        self.state, self.level_rotation = state, level_rotation
        self._placer, self._sources = placer, tuple(sources)
        self._drawn: tuple[Mapping[str, Any], np.random.Generator] | None = None

    @property
    def body(self) -> Body:
        """See `PersonFollower.body`."""
        return self.state.body

    def check_restored(self) -> None:
        """Raise ValueError for an invalid random generator, see `toolkit.io.checkpoint.restore`."""
        self.state.rng()

    def predicted(self) -> PredictedBody:
        """See `PersonFollower.predicted`: the body where it was last found."""
        return self.predicted_in(self.state)

    def predicted_in(self, state: PersonState) -> PredictedBody:
        """Return the body of a state where it was last found."""
        body, head = state.body, None
        if state.previous is not None and not state.lost:
            head = linear.rotated(state.previous.joints[HEAD : HEAD + 1], self.level_rotation)[0]
        return PredictedBody(self._placer.place(body, last_pose(state)).vertices, body.faces, body.height, head)

    def rng(self, state: PersonState) -> np.random.Generator:
        """Return the generator of a state; the one of the last step is reused."""
        if self._drawn is None or self._drawn[0] is not state.generator:
            self._drawn = state.generator, state.rng()
        return self._drawn[1]

    def after(self, rng: np.random.Generator) -> Mapping[str, Any]:
        """Return the state of a used random generator for the next state."""
        self._drawn = rng.bit_generator.state, rng
        return self._drawn[0]

    def row(
        self,
        pose: np.ndarray,
        joints: np.ndarray,
        confidence: np.ndarray,
        observed: np.ndarray,
        state: int,
        source: str,
    ) -> FrameResult:
        """Return a row of the track without times: `joints` (20, 3) in the level frame."""
        return FrameResult(
            pose=pose,
            joints=linear.rotated(joints, self.level_rotation).astype(np.float32),
            confidence=confidence.astype(np.float32),
            state=state,
            source=self._sources.index(source),
            stage_ms=np.empty(0, dtype=np.float32),
            observed=observed,
        )

    def predicted_row(self, before: PersonState, state: int) -> FrameResult:
        """Return the row of a frame without a pose, without times: the last pose at confidence 0."""
        pose = last_pose(before)
        joints = before.body.joint_positions(pose)
        nothing = np.zeros(len(joints), dtype=np.bool_)
        return self.row(pose, joints, np.zeros(len(joints)), nothing, state, PREDICTED)


def last_pose(state: PersonState) -> np.ndarray:
    """Return the last found pose (P,), or a standing one before the first."""
    if state.pose is not None:
        return state.pose
    pose = np.zeros(skeleton.POSE_SIZE)
    unseen = (0.0, 0.0, -3.0)  # reported root position before the first sighting, metres, level frame
    pose[skeleton.ROOT_POSITION] = unseen
    return pose
