"""Sequences of clips one after the other, which benchmarks of annotation and stabilising share."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.labelled import ACTORS, FILLER, SEQUENCES, MotionSequence, class_clips, label_of, perform
from tests.support.suite import RATE
from toolkit.simulation.joining import JOIN


@pytest.mark.data
@pytest.mark.parametrize("split", ["tune", "report"])
def test_no_clip_that_is_known_before_is_of_the_split_s_actor(split: str, data_folder: Path) -> None:
    known = class_clips(split)
    assert known and not any(f"_{ACTORS[split]}_" in path.name for path in known)
    wanted = {motion for sequence in SEQUENCES for motion, _ in sequence.motions}
    assert all(any(label.startswith(motion) for label in known.values()) for motion in wanted)
    assert label_of(Path("HDM_bk_kickLFront1Reps_001_120.amc")) == "kickLFront1Reps"


@pytest.mark.data
def test_joins_and_filler_belong_to_no_class(data_folder: Path) -> None:
    done = perform(MotionSequence("two", (("squat", 1), ("hop", 1)), "slim_male"), "tune", filler=True)
    squat, hop = done.segments
    assert (squat.start, squat.label[:5], hop.label[:3]) == (0.0, "squat", "hop")
    assert (hop.start - squat.end) * RATE == pytest.approx(JOIN)
    assert len(done.clip.poses) - hop.end * RATE == pytest.approx(JOIN + FILLER)
