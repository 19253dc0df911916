"""How well a hidden limb is told by what its motion is called: `depthmocap bench hidden_limbs [--clips 4]`.

True poses of HDM05, without a camera: one actor is left out in turn, classes are learned from the other two, and one
limb of each clip of the third is hidden, for the whole clip or for a while in its middle. Mean distance of the limb's
three outer joints from the true ones, on the neutral body, for arms and legs: the pose of the last frame in which it
was seen held on, straight from end to end, and what `toolkit/retrieval/priors/` expects.
"""

from __future__ import annotations

import argparse
import time
import timeit
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from tests.support.labelled import ACTORS, clips_of, label_of
from toolkit.body.shape import load_body
from toolkit.retrieval.annotation.annotator import Annotator, MotionClass
from toolkit.retrieval.annotation.class_motion import Example
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix, relational_features
from toolkit.retrieval.priors.allocation import Allocation, allocate, unknown_rows
from toolkit.retrieval.priors.expectation import GapContext, expect, fill
from toolkit.retrieval.priors.gap_trajectories import flags_of
from toolkit.retrieval.priors.gaps import Gap
from toolkit.retrieval.priors.limb_entries import ENTRIES, LIMBS, OUTER
from toolkit.retrieval.workflow.motions import load_motion, load_poses

BODY = load_body("neutral")
PEOPLE = ("bd", *sorted(ACTORS.values()))
WHOLE = "whole motion"
SECONDS = (0.5, 1.0, 2.0)
FRAMES = 1257
"""Of the take of the thesis (6.5), which spends 15 s on labels and priors."""

Errors = dict[tuple[str, str, str], list[float]]
"""Kind of limb, how long it is hidden and how it is told -> mean errors, metres."""


def examples_of(person: str, most: int) -> dict[str, list[Example]]:
    """Clips of an actor by class, at most so many of each."""
    found: dict[str, list[Example]] = {}
    for path in clips_of(person):
        own = found.setdefault(label_of(path), [])
        if len(own) < most:
            own.append(Example(relational_features(load_motion(path)), load_poses(path)))
    return found


def told_of(clips: Sequence[Example], label: str, classes: Sequence[MotionClass], limb: str, gap: Gap) -> GapContext:
    """Clips one after the other, all of one class, with a gap."""
    poses = np.concatenate([clip.poses for clip in clips])
    features = FeatureMatrix("clips", np.concatenate([clip.features.values for clip in clips], axis=1))
    hidden = {name: np.zeros(len(poses), dtype=np.bool_) for name in LIMBS}
    hidden[limb][gap.start : gap.stop] = True
    ends = np.cumsum([0, *(len(clip.poses) for clip in clips)]) / FEATURE_RATE
    segments = [Segment(float(a), float(b), label) for a, b in zip(ends[:-1], ends[1:], strict=True)]
    allocation = allocate(features, segments, classes, unknown_rows(hidden, len(features)))
    return GapContext(poses, np.arange(len(poses)) / FEATURE_RATE, hidden, allocation, classes)


def error_of(poses: np.ndarray, limb: str, angles: np.ndarray) -> float:
    """Metres, mean distance of the limb's outer joints, where a limb has other angles (D, A) than in `poses` (D, P)."""
    moved = poses.copy()
    moved[:, ENTRIES[limb]] = angles
    apart = (BODY.joint_positions(moved) - BODY.joint_positions(poses))[:, OUTER[limb]]
    return float(np.linalg.norm(apart, axis=2).mean())


def hide(errors: Errors, clips: list[Example], label: str, classes: Sequence[MotionClass]) -> None:
    """Hide each limb of each clip of a class, and tell it in all ways."""
    for number, clip in enumerate(clips):
        others = [*clips[:number], *clips[number + 1 :]]
        for limb in LIMBS:
            kind, length = limb.split("_")[1], len(clip.poses)
            _hide_all(errors, kind, limb, clip, others, label, classes)
            for seconds in SECONDS:
                frames = round(seconds * FEATURE_RATE)
                start = (length - frames) // 2
                if start < 1 or start + frames >= length:
                    continue
                gap = Gap(limb, start, start + frames)
                told = told_of([clip], label, classes, limb, gap)
                straight = replace(told, allocation=Allocation.nothing(length))
                rows = clip.poses[gap.start : gap.stop]
                held = np.repeat(clip.poses[gap.start - 1 : gap.start, ENTRIES[limb]], frames, axis=0)
                ways = {
                    "held": held,
                    "straight": fill(straight, gap)[0].mean,
                    "class and ends": fill(told, gap)[0].mean,
                }
                for name, angles in ways.items():
                    errors.setdefault((kind, f"{seconds:g} s", name), []).append(error_of(rows, limb, angles))


def _hide_all(
    errors: Errors, kind: str, limb: str, clip: Example, others: list[Example], label: str,
    classes: Sequence[MotionClass],
) -> None:  # fmt: skip
    """One limb hidden for all of a clip."""
    length = len(clip.poses)
    alone = told_of([clip], label, classes, limb, Gap(limb, 0, length))
    every = np.arange(length)
    ways = {
        "held": np.repeat(clip.poses[:1, ENTRIES[limb]], length, axis=0),
        "class": expect(alone, limb, every).mean,
    }
    if length > 2:
        first = told_of([clip], label, classes, limb, Gap(limb, 1, length))
        ways["class and first frame"] = np.concatenate(
            [clip.poses[:1, ENTRIES[limb]], fill(first, Gap(limb, 1, length))[0].mean]
        )
    if others:
        beside = told_of([clip, *others], label, classes, limb, Gap(limb, 0, length))
        without = replace(beside, classes=[replace(c, motion=None) for c in beside.classes])
        ways["repetitions"] = expect(without, limb, every).mean
        ways["class and repetitions"] = expect(beside, limb, every).mean
    for name, angles in ways.items():
        errors.setdefault((kind, WHOLE, name), []).append(error_of(clip.poses, limb, angles))


def seconds_of(clips: Sequence[Example], classes: Sequence[MotionClass]) -> float:
    """Processor seconds to annotate a track as long as the thesis's, allocate it and bridge 40 gaps of a second in each
    of its limbs in turn: the least of three."""
    poses = np.concatenate([clip.poses for clip in clips])
    poses = np.tile(poses, (1 + FRAMES // len(poses), 1))[:FRAMES]
    gaps = [Gap(LIMBS[k % len(LIMBS)], start, start + 30) for k, start in enumerate(range(1, FRAMES - 31, 31))]

    def run() -> None:
        features = relational_features(from_poses(poses, BODY, FEATURE_RATE, "track"))
        segments, hidden = Annotator(classes).annotate(features).segments, flags_of(gaps, FRAMES)
        allocation = allocate(features, segments, classes, unknown_rows(hidden, FRAMES))
        told = GapContext(poses, np.arange(FRAMES) / FEATURE_RATE, hidden, allocation, classes)
        for gap in gaps:
            fill(told, gap)

    return min(timeit.repeat(run, timer=time.process_time, repeat=3, number=1))


def main() -> None:
    """Learn, hide, tell, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)

    parser.add_argument("--clips", type=int, default=4, help="at most so many of each class and actor")
    options = parser.parse_args()
    examples = {person: examples_of(person, options.clips) for person in PEOPLE}
    errors: Errors = {}
    for person in PEOPLE:
        others = [examples[other] for other in PEOPLE if other != person]
        known = {label: [e for own in others for e in own.get(label, [])] for label in examples[person]}
        known = {label: clips for label, clips in known.items() if clips}
        classes = learn_classes(
            {label: [e.features for e in clips] for label, clips in known.items()},
            poses={label: [e.poses for e in clips] for label, clips in known.items()},
        )
        for label in known:
            hide(errors, examples[person][label], label, classes)
    figures: dict[str, Any] = {
        f"{kind} hidden for {span}, {name}": {"mm": 1000 * float(np.mean(found)), "clips": len(found)}
        for (kind, span, name), found in sorted(errors.items())
    }
    for name, value in figures.items():
        print(f"{name}: {value['mm']:.0f} mm ({value['clips']})")
    seconds = seconds_of([clip for clips in examples[person].values() for clip in clips], classes)
    print(f"annotate, allocate and bridge {FRAMES} frames: {seconds:.2f} s of a processor")
    figures["seconds"] = {"frames": FRAMES, "annotate, allocate and bridge": seconds}
    print("written:", save_figures("hidden_limbs", figures, {"clips": options.clips}))


if __name__ == "__main__":
    main()
