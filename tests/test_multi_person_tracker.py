"""The loop over frames with fake tracker and finder: waiting people, body learning, time of rows."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import pytest

from tests.fake_tracker import CAMERA, FakeTracker
from toolkit.people.evidence import Evidence
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.sensing.stream import Frame
from toolkit.tracking.live_people import FRAME_POINTS, MOST_POINTS, LiveFrame, LivePeople
from toolkit.tracking.multi_person import MultiPersonTracker, Row
from toolkit.tracks import TRACKED

UP = np.array([0.0, -1.0, 0.0])
LEARNT = 7.0
"""Scale of the body that `FakeTracker` learns."""


class FakeFinder:
    """Finder of person 1 wherever a pixel is measured, and of person 2 from half a second on."""

    CHECKPOINT: tuple[str, ...] = ()
    camera = CAMERA
    evidence: Mapping[int, Evidence] = MappingProxyType({})

    def __init__(self) -> None:
        self.told: list[tuple[int, ...]] = []

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        self.told.append(tuple(sorted(predicted)))
        depth = depth_mm.astype(np.float32) / 1000
        seen = [1] if depth.any() else []
        return tuple(Sighting(person, depth, None, CAMERA) for person in seen + [2] * (timestamp >= 0.5))


def rows_of(crowd: MultiPersonTracker, frames: int = 40, rate: float = 20.0) -> list[tuple[int, list[Row]]]:
    """Return frames of a recording that begins with an empty one, and the rows of each."""
    depth = np.zeros(CAMERA.shape, dtype=np.uint16)
    depth[20:50, 20:50] = 2000
    return [(k, crowd.step(Frame(depth * (k > 0), k / rate))) for k in range(frames)]


def test_a_body_is_learnt_from_the_first_seconds_and_all_rows_are_tracked_with_it() -> None:
    tracker = FakeTracker(learning_seconds=0.3)
    crowd = MultiPersonTracker(tracker, FakeFinder(), UP)
    came = rows_of(crowd)
    first = [(k, [row.frame for row in rows if row.person == 1]) for k, rows in came]
    # no person in frame 0, so learning lasts from frame 1 to frame 7, and frame 0 waits too
    assert [k for k, frames in first if frames] == list(range(7, 40))
    assert first[7][1] == list(range(8)) and first[8][1] == [8]
    assert tracker.learnt == [7, 7]
    assert {person: body.scale for person, body in crowd.bodies.items()} == {1: LEARNT, 2: LEARNT}


def test_the_finder_receives_predicted_bodies_from_the_second_frame_on() -> None:
    finder = FakeFinder()
    rows_of(MultiPersonTracker(FakeTracker(learning_seconds=0.3), finder, UP))
    # person 1 enters in frame 1, person 2 in frame 10; learning ends in frames 7 and 16
    assert finder.told == [(), (), *[(1,)] * 9, *[(1, 2)] * 29]


def test_who_comes_later_has_rows_for_the_frames_before() -> None:
    crowd = MultiPersonTracker(FakeTracker(learning_seconds=0.3), FakeFinder(), UP)
    second = [row for _, rows in rows_of(crowd) for row in rows if row.person == 2]
    assert [row.frame for row in second] == list(range(40))
    assert [row.timestamp for row in second] == pytest.approx([k / 20 for k in range(40)])


def live_frames(people: LivePeople, frames: int = 40, rate: float = 20.0) -> list[LiveFrame]:
    """Return the same as `rows_of`, one live frame for each frame."""
    depth = np.zeros(CAMERA.shape, dtype=np.uint16)
    depth[20:50, 20:50] = 2000
    return [people.advance(Frame(depth * (k > 0), k / rate)) for k in range(frames)]


def test_a_live_person_has_a_pose_in_each_frame_and_later_the_same_rows() -> None:
    found = live_frames(LivePeople(FakeTracker(learning_seconds=0.3), FakeFinder(), UP))
    expected = [
        row
        for _, rows in rows_of(MultiPersonTracker(FakeTracker(learning_seconds=0.3), FakeFinder(), UP))
        for row in rows
    ]
    for person, came in ((1, 1), (2, 10)):
        shown = [(k, pose) for k, live in enumerate(found) for pose in live.poses if pose.row.person == person]
        assert [k for k, _ in shown] == list(range(came, 40)) == [pose.row.frame for _, pose in shown]
        rows = [row for live in found for row in live.rows if row.person == person]
        wanted = [row for row in expected if row.person == person]
        assert [row.frame for row in rows] == list(range(40)) == [row.frame for row in wanted]
        for row, other in zip(rows, wanted, strict=True):
            np.testing.assert_array_equal(row.result.pose, other.result.pose)


def test_the_body_is_learnt_from_the_same_frames_as_in_a_recording() -> None:
    trackers = [FakeTracker(learning_seconds=0.3) for _ in range(2)]
    live_frames(LivePeople(trackers[0], FakeFinder(), UP))
    rows_of(MultiPersonTracker(trackers[1], FakeFinder(), UP))
    assert sorted(trackers[0].observed) == sorted(trackers[1].observed)


@pytest.mark.parametrize("pixels", [1800, 4800])
def test_no_step_does_more_work_than_a_frame_allows(pixels: int) -> None:
    depth = np.zeros(CAMERA.shape, dtype=np.uint16)
    depth.flat[:pixels] = 2000
    tracker = FakeTracker(learning_seconds=1.0)
    people, most = LivePeople(tracker, FakeFinder(), UP), FRAME_POINTS // pixels + 1
    for k in range(120):
        taken = len(tracker.observed)
        rows = people.advance(Frame(depth, k / 20.0)).rows
        assert len(tracker.observed) - taken <= 1
        assert sum(row.result.state == TRACKED and row.frame < k for row in rows) <= most
    assert len(people.bodies) == 2


def test_a_detection_with_the_learnt_body_is_spread_over_frames_with_poses() -> None:
    tracker = FakeTracker(learning_seconds=0.3)
    tracker.parts = 4
    people = LivePeople(tracker, FakeFinder(), UP)
    found = live_frames(people)
    first = next(k for k, live in enumerate(found) if any(row.result.state == TRACKED for row in live.rows))
    # The sighting of frame 7, the last of learning, is processed in frame 8, the empty frame 0 in frame 9, and the five
    # parts of frame 1 in frames 10, 12, 13, 15 and 16.
    assert first == 16 and people.body_of(1).scale == LEARNT
    assert all(any(pose.row.person == 1 for pose in live.poses) for live in found[1:])


def test_frames_of_a_large_person_are_tracked_again_faster_than_they_come() -> None:
    assert MOST_POINTS < FRAME_POINTS


def test_people_who_come_together_are_detected_one_in_each_frame() -> None:
    class Three(FakeFinder):
        def find(
            self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
        ) -> tuple[Sighting, ...]:
            return tuple(Sighting(person, depth_mm / np.float32(1000), None, CAMERA) for person in (1, 2, 3))

    shown = [
        [pose.row.person for pose in live.poses]
        for live in live_frames(LivePeople(FakeTracker(learning_seconds=9.0), Three(), UP), 6)
    ]
    assert shown == [[], [1], [1, 2], *[[1, 2, 3]] * 3]


def test_what_is_not_caught_up_with_is_tracked_at_the_end() -> None:
    people = LivePeople(FakeTracker(learning_seconds=9.0), FakeFinder(), UP)
    assert all(pose.provisional for live in live_frames(people) for pose in live.poses)
    assert [(row.person, row.frame) for row in people.finish()] == [(p, k) for p in (1, 2) for k in range(40)]
    assert people.body_of(2).scale == LEARNT
