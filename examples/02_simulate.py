"""Simulate a depth recording with exact joint positions: a person with an unknown body in a furnished room.

    python examples/02_simulate.py [CLIP]

CLIP is a BVH or AMC file; the default is a bundled motion outside the database. Writes output/take.npz.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from toolkit.body.shape import subject_body
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SUBJECT_MOTIONS, procedural_clips
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.simulation.simulate import simulate_recording

OUTPUT = Path("output")


def main() -> None:
    # The seed adds deviations outside all shape spaces: other limb lengths, a belly, folds of clothes.
    subject = subject_body("slim_male", seed=7)
    print(f"the subject is {subject.height:.2f} m tall")
    clip: str | PoseClip
    if len(sys.argv) > 1:
        clip = sys.argv[1]
    else:
        whole = procedural_clips(SUBJECT_MOTIONS[:1], body=subject, variations=1)[0]
        clip = replace(whole, poses=whole.poses[:60])  # two seconds are enough here

    recording = simulate_recording(
        clip, OUTPUT / "take.npz", body=subject, sensor="tof", distance=3.0, yaw=10.0, seed=1
    )

    # A recording yields one frame at a time; its background segments the person.
    cleaner = SinglePersonSegmenter.of(recording)
    depth = cleaner.clean(recording.depth(0))
    print(f"{recording.path}: {len(recording)} frames of {recording.camera.width}x{recording.camera.height} pixels")
    print(f"the first frame has {int((depth > 0).sum())} pixels of a person at {depth[depth > 0].mean():.2f} m")


if __name__ == "__main__":
    main()
