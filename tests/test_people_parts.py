"""Parts of the finder: identities, unattached surfaces, joints, mirrors, dropped people."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.fake_tracker import FakeTracker
from tests.sensing_scenes import KINECT, ConstantOdds, scene
from toolkit.app.pipeline.run_writer import RunSink
from toolkit.io.checkpoint import plain, read_state, restore
from toolkit.io.errors import SegmentationError
from toolkit.people.evidence import Evidence, furniture
from toolkit.people.joint_masks import GivenJoints
from toolkit.people.known_people import match_heads, re_identified
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.people.sighting import Sighting
from toolkit.people.surroundings import Surroundings
from toolkit.people.survey import find_person
from toolkit.people.tracks import KnownPerson
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.joints2d import Joints2D
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.sensing.stream import Frame
from toolkit.tracks import EMPTY, TRACKED, FrameResult, RunInfo
from toolkit.tracks.runs import PersonSummary, load_people, save_people

UP = np.array([0.0, -1.0, 0.0])
HEAD = np.array([0.0, 0.3, -2.5])
PERSON, FURNITURE = Evidence(4, 20.0), Evidence(3, -15.0)


def somebody(head=HEAD, number=1, *, velocity=(0.0, 0.0, 0.0), last=0.0, first=0.0, area=0.5):
    head = np.array(head, dtype=np.float64)
    return KnownPerson(number, head, np.array(velocity), first, last, float(head[1]), head - (0, 0.4, 0), area)


# Identities.


@pytest.mark.parametrize(("absence", "within", "beyond"), [(1 / 30, 0.42, 0.48), (0.5, 1.1, 1.2), (60.0, 1.45, 1.55)])
def test_the_gate_grows_during_an_absence_up_to_a_limit(absence, within, beyond):
    person = somebody(last=0.0)
    for way, found in ((within, {0: 0}), (beyond, {})):
        assert match_heads([person], [HEAD + (way, 0.0, 0.0)], absence) == found


def test_heads_go_to_people_by_least_total_distance():
    people = [somebody((0.0, 0.3, -2.5), 1), somebody((0.3, 0.3, -2.5), 2)]
    heads = [np.array([0.28, 0.3, -2.5]), np.array([0.6, 0.3, -2.5])]
    assert match_heads(people, heads, 0.1) == {0: 0, 1: 1}, "the nearest to the second alone would be the first head"


def test_a_returning_person_is_the_best_height_match_and_none_taller():
    people = [somebody((0.0, 0.3, -2.5), 1), somebody((0.1, 0.1, -2.5), 2)]
    assert re_identified(people, np.array([0.2, 0.28, -2.5]), 5.0).id == 1
    assert re_identified(people, np.array([0.2, 0.12, -2.5]), 5.0).id == 2
    assert re_identified(people, np.array([0.2, 0.40, -2.5]), 5.0) is None


# Unattached surfaces.


# Joints of people.


def joints_at(pixels):
    rows = np.full((20, 3), np.nan)
    rows[: len(pixels)] = [(u, v, 1.0) for u, v in pixels]
    return Joints2D.of_rows(rows)


def cut_outs():
    left, right = np.zeros((2, *KINECT.shape), dtype=np.float32)
    left[:, 50:100], right[:, 200:250] = 2.0, 2.0
    return [Sighting(1, left, None, KINECT), Sighting(2, right, None, KINECT)]


def test_joints_go_to_the_cut_out_on_which_most_of_them_lie_and_three_tenths_are_enough():
    on, off = [(220.0, 10.0 * k) for k in range(1, 4)], [(150.0, 10.0 * k) for k in range(1, 8)]
    for seen, given in ((on + off, True), (on[:2] + off, False)):
        frame = Frame(np.zeros(KINECT.shape, np.uint16), 0.0, (joints_at(seen),))
        first, second = GivenJoints(KINECT).add(frame, cut_outs())
        assert first.joints is None and (second.joints is not None) == given


# Mirrors.


# People accepted at once.


# Dropped people.


@pytest.mark.parametrize(("odds", "peak", "dropped"), [(1.0, 1.0, frozenset()), (-3.0, -1.0, frozenset({1}))])
def test_a_track_is_furniture_after_repeated_rejections_by_the_network(odds, peak, dropped):
    empty = np.zeros((120, 160), dtype=np.float32)
    room = Surroundings(False, True, empty, empty, empty > 0)
    finder = MultiPersonFinder(KINECT, UP, room, network=ConstantOdds(odds, peak))
    for k in range(30):
        finder.find(scene(KINECT, ((0.0, 2.5),))[0], k / 30, {})
    assert furniture(finder.evidence) == dropped
    assert finder.people[0].evidence.looks == 4, "a few times a second is enough"
    again = MultiPersonFinder(KINECT, UP, room, network=ConstantOdds(odds, peak))
    restore(again, plain(finder), "people")
    assert again.evidence == finder.evidence


def test_the_log_odds_are_the_mean_score_of_the_samples_and_grow_with_motion():
    own = Evidence().after(1.5, 0.0).after(-0.5, 0.0)
    assert own == Evidence(2, 1.0) and own.log_odds == pytest.approx(0.5)
    scores = [Evidence(4, 2.0, moved).log_odds for moved in range(5)]
    assert np.all(np.diff(scores) > 0) and scores[0] == pytest.approx(0.5)
    assert furniture({1: Evidence(4, -2.0), 2: Evidence(4, -2.0, 4), 3: Evidence(4, 2.0)}) == {1}
    assert Evidence().log_odds > 0, "a track without a sample is a person"
    tracks = {1: own, 3: Evidence(), 7: Evidence(9, -3.25, 4)}
    assert read_state(plain(tracks), dict[int, Evidence], "evidence") == tracks


def row(state):
    return FrameResult(
        np.zeros(43), np.zeros((20, 3), np.float32), np.zeros(20, np.float32), state, 0, np.zeros(2, np.float32)
    )


def test_people_who_were_none_leave_no_folder_and_the_others_are_numbered_without_a_gap(tmp_path: Path):
    from toolkit.body.shape import load_body
    from toolkit.tracking.multi_person import Row

    info = RunInfo("take.npz", "0", {}, "", [], 1.0, "", list(np.eye(3).ravel()), {}, "0", "fake", 0)
    sink = RunSink(tmp_path / "run", FakeTracker(), info, several=True, resume=False)
    states = {1: TRACKED, 2: TRACKED, 3: EMPTY}
    for frame in range(3):
        sink.write([Row(person, frame, frame / 30, row(state)) for person, state in states.items()])
    sink.remove_furniture({1: FURNITURE, 2: PERSON})
    tracks = sink.finish(dict.fromkeys((2, 3), load_body("neutral")), complete=True)
    assert [int(track.state[0]) for track in tracks] == [TRACKED, EMPTY]
    assert sorted(path.name for path in (tmp_path / "run").glob("person_*")) == ["person_01", "person_02"]
    assert [person.folder for person in load_people(tmp_path / "run").people] == ["person_01", "person_02"]
    assert "person_03" not in json.dumps((tmp_path / "run" / "people.json").read_text())
    first, second, left_out = load_people(tmp_path / "run").text().split("\n")[:3]
    assert first.startswith("person_01: 1.") and f"person score {PERSON.log_odds:+.1f}" in first
    assert second.startswith("person_02") and "score" not in second
    assert load_people(tmp_path / "run").furniture == (FURNITURE,)
    assert left_out.startswith(f"furniture, left out: person score {FURNITURE.log_odds:+.1f}")


# Selected person.


def crowd_recording(folder: Path, frames: int = 12):
    """Return two people who walk in a room: the first, farther, all the time, the second, nearer, in the last third."""
    room = {"height": 1.2, "wall": 4.0, "floor": True}
    depth = []
    for k in range(frames):
        people = ((-0.9 + 0.08 * k, 2.9),) + (((0.9 - 0.05 * k, 2.0),) if k >= 2 * frames // 3 else ())
        depth.append(scene(KINECT, people, **room)[0])
    path = folder / "two.npz"
    save_recording(path, depth=depth, camera=KINECT, timestamps=np.arange(frames) / 10, up_camera=UP)
    return open_recording(path)


@pytest.mark.parametrize(
    ("options", "distance"),
    [
        ({"segment": "person"}, 2.8),
        ({"segment": "auto"}, 2.8),
        ({"segment": "person", "subject": "largest"}, 2.8),
        ({"segment": "person", "subject": "nearest"}, 1.9),
    ],
)
def test_the_one_in_a_room_who_is_meant_is_chosen_over_the_whole_recording(tmp_path, options, distance):
    recording = crowd_recording(tmp_path)
    finder, seen = find_person(recording, SensingSettings(**options)), []
    for i in range(len(recording)):
        (sighting,) = finder.find(recording.depth(i), i / 10, {})
        assert sighting.id == 1
        if sighting.depth.any():
            seen.append(float(np.median(sighting.depth[sighting.depth > 0])))
    assert np.median(seen) == pytest.approx(distance, abs=0.1)
    assert len(seen) >= (4 if options.get("subject") == "nearest" else 11)


def test_a_seed_selects_the_person_at_its_pixel_and_an_empty_pixel_is_an_error(tmp_path):
    recording = crowd_recording(tmp_path)
    v, u = (int(n) for n in np.argwhere(scene(KINECT, ((-0.9, 2.9),))[0] > 0).mean(axis=0))
    finder = find_person(recording, SensingSettings(segment=f"seed:{u},{v}"))
    assert finder.find(recording.depth(0), 0.0, {})[0].depth[v, u] > 0
    with pytest.raises(SegmentationError, match="no person is found at the pixel"):
        find_person(recording, SensingSettings(segment="seed:310,10"))


def test_the_evidence_of_runs_of_earlier_versions_is_not_shown(tmp_path: Path) -> None:
    save_people(tmp_path, [PersonSummary(1, "person_01", 0, 9, 1.7, 1.0, 0.0, 0.0, Evidence(3, 4.5, 1))], [Evidence(2)])
    path = tmp_path / "people.json"
    now = load_people(tmp_path)
    assert "person score +2.8" in now.text() and len(now.furniture) == 1
    path.write_text(path.read_text().replace('"moved"', '"rested"'), encoding="utf-8")
    earlier = load_people(tmp_path)
    assert earlier.people[0].evidence is None and not earlier.furniture
