"""Trackers with wrong states: wrong poses, and a person's state as if one of them had been the last result."""

from dataclasses import replace

import numpy as np

from toolkit.body import skeleton
from toolkit.database.canonical import body_facing, canonicalise, mirrored, place
from toolkit.tracking.state import PersonState, Previous

KINDS = ("random pose", "left and right", "turned", "arms", "shifted")
ARMS: np.ndarray = np.array(
    [
        i
        for i, n in enumerate(skeleton.POSE_NAMES)
        if any(part in n for part in ("clavicle", "shoulder", "elbow", "wrist"))
    ]
)
"""Pose entries of both arms."""


def wrong_pose(kind: str, pose: np.ndarray, poses: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a wrong version of `pose` (P,), level frame; `poses` (N, P) are those of the database."""
    own, position, yaw = canonicalise(pose)
    nowhere = np.zeros(4)
    if kind == "random pose":
        return place(poses[rng.integers(len(poses))].astype(np.float64), nowhere, position, yaw)
    if kind == "left and right":
        return place(mirrored(own), nowhere, position, yaw)
    if kind == "turned":
        return place(own, nowhere, position, yaw + np.pi)
    wrong = pose.copy()
    if kind == "arms":
        wrong[ARMS] = mirrored(own)[ARMS]
    else:
        angle = rng.uniform(-np.pi, np.pi)
        wrong[skeleton.ROOT_POSITION] += [np.sin(angle), 0.0, np.cos(angle)]
    return wrong


def misled(state: PersonState, wrong: np.ndarray) -> PersonState:
    """Return the state of a tracked person as if `wrong` (P,) had been the result of the previous frame."""
    assert state.pose is not None and state.previous is not None and state.centre is not None
    shift = wrong[skeleton.ROOT_POSITION] - state.pose[skeleton.ROOT_POSITION]
    yaw = float(body_facing(wrong))
    return replace(
        state,
        previous=Previous.of_pose(state.body, wrong, state.previous.extrema),
        pose=wrong,
        centre=state.centre + shift,
        facing=np.array([np.sin(yaw), np.cos(yaw)]),
    )
