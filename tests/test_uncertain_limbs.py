"""Uncertain stretches of limbs: by limb, joined over short pauses, in seconds since the first frame."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import write_run
from toolkit.app.cli.track import print_done as print_result
from toolkit.body import skeleton
from toolkit.motion.uncertain_limbs import NAMED, UncertainStretch, uncertain_stretches, uncertain_text
from toolkit.output.report.content import describe_run
from toolkit.tracks import EMPTY, LOST, Track

RATE = 30.0


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", np.zeros((120, skeleton.POSE_SIZE)), rate=RATE)


@pytest.fixture
def track(run: Path) -> Track:
    return Track.load(run)


def unsure(track: Track, limb: str, start: int, stop: int) -> Track:
    confidence = track.confidence.copy()
    confidence[start:stop, skeleton.OUTER[limb]] = 0.3
    return replace(track, confidence=confidence)


def test_a_sure_track_has_no_uncertain_stretch(track: Track) -> None:
    assert uncertain_stretches(track) == []
    assert uncertain_text(track) == "none"


def test_stretches_of_two_limbs_are_named_with_their_seconds(track: Track) -> None:
    found = unsure(unsure(track, "right_leg", 60, 90), "left_arm", 15, 45)
    arm, leg = uncertain_stretches(found)
    assert (arm.limb, leg.limb) == ("left_arm", "right_leg")
    assert (arm.start, arm.end) == pytest.approx((15 / RATE, 45 / RATE))
    assert (leg.start, leg.end) == pytest.approx((60 / RATE, 90 / RATE))
    assert uncertain_text(found) == "left arm 0.5-1.5 s, right leg 2.0-3.0 s"


def test_short_pauses_are_bridged_and_short_stretches_left_out(track: Track) -> None:
    joined = unsure(unsure(track, "left_arm", 10, 30), "left_arm", 36, 60)
    (stretch,) = uncertain_stretches(joined)
    assert (stretch.start, stretch.end) == pytest.approx((10 / RATE, 60 / RATE))
    apart = unsure(unsure(track, "left_arm", 10, 30), "left_arm", 45, 60)
    assert len(uncertain_stretches(apart)) == 2
    assert uncertain_stretches(unsure(track, "left_arm", 10, 14)) == []


def test_lost_frames_are_uncertain_and_empty_ones_are_not_there(track: Track) -> None:
    state, confidence = track.state.copy(), track.confidence.copy()
    state[30:60], state[90:] = LOST, EMPTY
    confidence[30:60] = confidence[90:] = 0.0
    found = uncertain_stretches(replace(track, state=state, confidence=confidence))
    assert {stretch.limb for stretch in found} == set(skeleton.OUTER)
    assert all((s.start, s.end) == pytest.approx((1.0, 2.0)) for s in found)


def test_one_frame_is_named_however_short(track: Track) -> None:
    columns = ("joints", "pose", "confidence", "state", "source", "timestamps", "stage_ms", "observed", "contact")
    one = replace(track, **{name: getattr(track, name)[:1] for name in columns})
    assert uncertain_stretches(unsure(one, "left_leg", 0, 1)) == [UncertainStretch("left_leg", 0.0, 0.0)]


def test_the_longest_are_named_and_the_others_counted(track: Track) -> None:
    found = track
    for k, limb in enumerate(skeleton.OUTER):
        found = unsure(unsure(found, limb, 5, 15 + k), limb, 60, 110 + k)
    assert len(uncertain_stretches(found)) == NAMED + 2
    assert uncertain_text(found).endswith(", 2 shorter ones")


def test_the_summary_and_the_report_name_them(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    loaded = Track.load
    monkeypatch.setattr(Track, "load", lambda path: unsure(loaded(path), "left_arm", 15, 45))
    facts = dict(describe_run(run, "one").data["facts"])
    assert facts["uncertain limbs"] == "left arm 0.5-1.5 s"
    print_result("run: 120 frames", run)
    assert "uncertain limbs: left arm 0.5-1.5 s" in capsys.readouterr().out
