"""Candidates for head and hands: `depthmocap bench effectors [--split report]`.

Of the frames of the suite of upper bodies (`toolkit/testing/upper.py`) in which the camera sees head and both hands:
the share in which each has a candidate within 0.15 m, for the first extrema and for the summits of the component tree,
with bridges to pieces that float and without, and how often the fork names all three rightly.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from toolkit.evaluation.joints import seen_joints
from toolkit.evaluation.upper import HANDS, ROWS
from toolkit.landmarks.graph import Workspace
from toolkit.lopez2011.effectors import EffectorSettings, find_effectors, find_fork
from toolkit.people.lone import LonePerson
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.sensing.settings import SensingSettings
from toolkit.testing.scenes import record_scene
from toolkit.testing.suite import WORK
from toolkit.testing.upper import upper_scenes

WITHIN = 0.15
"""Metres."""
COLUMNS = 160
"""Pixels of width, at most, as the particle filter's tracker looks at hands."""
UNBRIDGED = 0.01
"""Metres: bridges as short as this join nothing."""
KINDS: dict[str, EffectorSettings] = {
    "3 extrema, no bridges": EffectorSettings(cuts=0, count=3, bridge_distance=UNBRIDGED),
    "3 extrema": EffectorSettings(cuts=0, count=3),
    "6 extrema": EffectorSettings(cuts=0, count=6),
    "8 extrema": EffectorSettings(cuts=0, count=8),
    "6 extrema, 2 cuts": EffectorSettings(),
    "3 of the tree": EffectorSettings(cuts=0, count=3, tree=True),
    "6 of the tree": EffectorSettings(cuts=0, count=6, tree=True),
}


def count_found(recording: Recording, stride: int) -> dict[str, np.ndarray]:
    """For each kind the number of frames, of those with all three found, of forks and of forks that are right."""
    found = {kind: np.zeros(4, dtype=np.int64) for kind in KINDS}
    finder = LonePerson(recording.camera, recording.background, SensingSettings(), recording.up_camera)
    rotation, workspace = level_rotation(recording.up_camera), Workspace()
    for i in range(0, len(recording), stride):
        depth = recording.depth(i)
        (sighting,) = finder.find(depth, float(recording.timestamps[i]), {})
        truth = recording.joints[i].astype(np.float64)
        rows = ROWS[[0, *range(HANDS.start, HANDS.stop)]]
        if not seen_joints(truth, depth / 1000.0, recording.camera)[rows].all():
            continue
        step = max(1, sighting.camera.width // COLUMNS)
        cloud = Cloud.from_depth(sighting.depth[::step, ::step], sighting.camera.subsampled(step), rotation)
        unobserved = None if sighting.unobserved is None else sighting.unobserved[::step, ::step]
        level = truth[rows] @ rotation.T
        for kind, settings in KINDS.items():
            effectors = find_effectors(cloud, settings, unobserved, workspace)
            gaps = np.linalg.norm(level[:, None] - effectors.points[None], axis=2)
            fork = find_fork(effectors, settings)
            right = fork is not None and all(
                gaps[k, row] <= WITHIN for k, row in enumerate((fork.head, fork.left_hand, fork.right_hand))
            )
            hit = gaps.shape[1] > 0 and bool((gaps.min(axis=1) <= WITHIN).all())
            found[kind] += [1, hit, fork is not None, right]
    return found


def main() -> None:
    """Count, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--takes", type=int, help="at most so many of each group")
    parser.add_argument("--frames", type=int, default=90, help="at most so many of each take")
    parser.add_argument("--stride", type=int, default=3)
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    total = {kind: np.zeros(4, dtype=np.int64) for kind in KINDS}
    for scene in upper_scenes(options.split, count=options.takes):
        recording = open_recording(record_scene(scene, options.work, options.frames))
        for kind, counts in count_found(recording, options.stride).items():
            total[kind] += counts
    figures: dict[str, Any] = {}
    print(f"{'':<24}{'frames':>8}{'all three %':>13}{'fork %':>8}{'right fork %':>14}")
    for kind, (frames, hit, forks, right) in total.items():
        shares = 100.0 * np.array([hit, forks, right]) / max(frames, 1)
        print(f"{kind:<24}{frames:8d}{shares[0]:13.1f}{shares[1]:8.1f}{shares[2]:14.1f}")
        figures[kind] = dict(zip(("all_three", "fork", "right_fork"), shares.tolist(), strict=True))
        figures[kind]["frames"] = int(frames)
    whole = options.takes is None and options.frames >= 90
    settings = {kind: asdict(value) for kind, value in KINDS.items()}
    print("written:", save_figures(f"effectors_{options.split}{'' if whole else '_part'}", figures, settings))


if __name__ == "__main__":
    main()
