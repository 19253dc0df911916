"""A text-based rafting game with motions as input, which tolerate errors of single joints.

    python examples/06_gestures.py

Three gestures are learned from one example each. A player then performs them pose by pose, as a tracker outputs them;
each event steers the raft. `depthmocap track TAKE --classes classes.npz --events -` prints the events of a recording.
"""

from __future__ import annotations

import numpy as np

from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.mocap.procedural import procedural_clips
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.annotation.online import OnlineAnnotator
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import relational_features

RATE = 30.0
GESTURES = {"paddle": ("archery", 30, 90), "duck": ("half_squat_reach", 20, 80), "jump": ("knee_to_elbow", 20, 60)}
"""Gesture -> bundled motion and its frames with the gesture."""
RAFT = {
    "paddle": "You pull hard: the raft swings round the rock.",
    "duck": "You bend down: the branch passes over your head.",
    "jump": "You lift your knees: the wave rolls under the raft.",
}


def gesture(name: str, body: Body) -> np.ndarray:
    """Return the poses (T, P) of a gesture."""
    motion, start, stop = GESTURES[name]
    return procedural_clips([motion], rate=RATE, body=body, seed=0)[0].poses[start:stop]


def performance(order: list[str], body: Body) -> np.ndarray:
    """Return gestures in a row, with a third of a second between them."""
    pieces = [gesture(order[0], body)]
    for name in order[1:]:
        following, share = gesture(name, body), np.linspace(0.0, 1.0, 12)[1:-1, None]
        pieces += [pieces[-1][-1] + share * (following[0] - pieces[-1][-1]), following]
    return np.concatenate(pieces)


def main() -> None:
    body = ShapeSpace.load().body([])
    examples = {name: [relational_features(from_poses(gesture(name, body), body, RATE, name))] for name in GESTURES}
    game = OnlineAnnotator(learn_classes(examples), body, RATE)
    print("The river is wild today. A rock, a branch and two waves lie ahead.")
    poses = performance(["jump", "paddle", "duck", "jump"], body)
    events = [event for frame, pose in enumerate(poses) for event in game.push(pose, frame / RATE)] + game.finish()
    for event in events:
        print(f"{event.time:5.2f} s  {RAFT[event.label]}")
    print(f"You passed {len(events)} of 4 dangers.")


if __name__ == "__main__":
    main()
