"""Track a depth recording with a pose database.

    python examples/03_track.py [RECORDING]

Needs output/poses.npz of example 01 and, without RECORDING, output/take.npz of example 02. Writes output/run.
"""

import sys
from pathlib import Path

import numpy as np

from toolkit.app.pipeline import TrackerRecipe, track_recording
from toolkit.recordings.opening import open_recording
from toolkit.tracks import STATE_NAMES, Track

OUTPUT = Path("output")


def main() -> None:
    recording = open_recording(sys.argv[1] if len(sys.argv) > 1 else OUTPUT / "take.npz")
    # Settings: configs/hybrid.yaml (configs/baak2013.yaml is the paper's variant); any can be set by its dotted name.
    tracker = TrackerRecipe("hybrid", {"sensing.half_resolution": False}, database=OUTPUT / "poses.npz").build()

    # The only input is depth: no first pose, no body shape. Rows are on the disk as soon as they are computed.
    summary = track_recording(
        recording,
        tracker,
        OUTPUT / "run",
        progress=lambda name, doing, done, total: print(f"\r{doing} {done}/{total}", end="", file=sys.stderr),
    )
    print(file=sys.stderr)
    print(summary.text())

    # The track: joints in the camera frame, the pose vector, and which hypothesis won each frame.
    track = Track.load(OUTPUT / "run")
    head = track.joints[:, track.joint_names.index("head")]
    print(f"the head moved over {1000 * np.linalg.norm(np.diff(head, axis=0), axis=1).sum():.0f} mm")
    for i, name in enumerate(STATE_NAMES):
        print(f"{name}: {int((track.state == i).sum())} frames")
    for i, name in enumerate(track.source_names):
        print(f"won by {name}: {int((track.source == i).sum())} frames")


if __name__ == "__main__":
    main()
