"""Geometry of the finder: floor, candidates beside people and mirrors, seeds, selected person."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, TOF, neutral, scene, standing, up_of_tilt, view_of
from toolkit.io.errors import SegmentationError, SeveralPeopleError
from toolkit.people.floor import find_floor, find_known_floor
from toolkit.people.image_rotation import quarter_turns
from toolkit.people.newcomers import in_a_mirror
from toolkit.people.selected_person import FIRST_SECONDS, SelectedPersonFinder, meant_person
from toolkit.people.sharing import body_seeds
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.people.structure import Plane
from toolkit.people.tracks import KnownPerson
from toolkit.people.view import CoarseCamera
from toolkit.sensing.camera import level_rotation, rotated_points
from toolkit.sensing.sensing_settings import SensingSettings

LEVEL = up_of_tilt(0.0)


def whole(who: np.ndarray, coarse: CoarseCamera) -> np.ndarray:
    return who[:: coarse.step, :: coarse.step]


# The floor.


@pytest.mark.parametrize(("tilt", "height"), [(0.3, 1.2), (0.4, 1.9), (0.6, 2.4)])
def test_both_searches_find_the_floor_of_a_room_with_a_person(tilt, height):
    depth_mm, _ = scene(TOF, ((0.3, 2.5),), tilt=tilt, height=height, wall=4.0, floor=True)
    found, known = find_floor(depth_mm, TOF), find_known_floor(depth_mm, TOF, up_of_tilt(tilt))
    assert found is not None and known is not None
    assert np.degrees(np.arccos(found.up_camera @ up_of_tilt(tilt))) < 0.5
    assert [found.height, known.height] == pytest.approx([height] * 2, abs=0.015)


@pytest.mark.parametrize("tilt", [0.0, -0.1, -0.16, -0.25])
def test_a_wall_alone_and_an_empty_image_have_no_floor_wherever_the_camera_looks(tilt):
    for depth_mm in (scene(TOF, (), tilt=tilt, wall=3.0)[0], np.zeros(TOF.shape, dtype=np.uint16)):
        assert find_floor(depth_mm, TOF) is None
        assert find_known_floor(depth_mm, TOF, up_of_tilt(tilt)) is None


def test_a_table_with_the_floor_below_it_is_not_the_floor():
    tilt, up = 0.5, up_of_tilt(0.5)
    depth_mm, _ = scene(TOF, (), tilt=tilt, height=1.6, floor=True, wall=3.0)
    table = scene(TOF, (), tilt=tilt, height=1.0, floor=True, wall=3.0)[0]
    on_it = table < 2000
    on_it[:, :20] = False
    floor = find_known_floor(np.where(on_it, table, depth_mm), TOF, up)
    assert floor is not None and floor.height == pytest.approx(1.6, abs=0.015)


# Candidates for a new person.


@pytest.mark.parametrize(("depth", "mirrored"), [(4.0, True), (4.8, False), (2.0, False)])
def test_a_head_behind_a_wall_at_the_mirror_image_of_another_is_none(depth, mirrored):
    coarse, _ = view_of(np.zeros(KINECT.shape, dtype=np.uint16))
    wall = Plane(np.array([0.0, 0.0, -1.0]), 3.0, 4.0)  # 3 m before the camera
    before, behind = np.array([0.2, 0.3, -2.0]), np.array([0.2, 0.3, -depth])
    assert in_a_mirror(behind, [before], [wall], coarse) == mirrored


# Seeds.


def predicted(x: float, distance: float, up: np.ndarray = LEVEL) -> PredictedBody:
    body = neutral()[0]
    vertices = body.vertex_positions(standing(x, distance, 1.2)) @ level_rotation(up)
    return PredictedBody(vertices, body.faces, body.height)


def test_pixels_go_to_the_body_that_is_expected_there_and_one_behind_another_claims_nothing():
    people = ((-0.1, 2.5), (0.25, 3.2))
    depth_mm, who = scene(KINECT, people)
    coarse, view = view_of(depth_mm)
    truth, seeds = whole(who, coarse), np.zeros(view.depth.shape, dtype=np.int32)
    bodies = {4 + k: predicted(*place) for k, place in enumerate(people)}
    body_seeds(view, coarse, bodies, seeds)
    for number in (1, 2):
        own = seeds[truth == number]
        assert (own == 3 + number).mean() > 0.97
        assert not (own == 6 - number).sum() > 5, "pixels of one body's rim"
    assert not seeds[truth == 0].any()


# Selected person.


class FakePeople:
    """Finder that returns given people, of given heights."""

    camera = KINECT
    evidence: Mapping[int, Any] = {}

    def __init__(
        self, frames: Sequence[Mapping[int, tuple[slice, float]]] = (), heights: Sequence[float] = (0.4, 0.4, 0.4)
    ) -> None:
        self.frames, self.told, self.coarse = list(frames), {}, view_of(np.zeros(KINECT.shape, dtype=np.uint16))[0]
        none, never = np.zeros(3), -1e9
        self.people = [KnownPerson(k, none, none, never, never, h, none, 0.5) for k, h in enumerate(heights, start=1)]

    def coarse_pixel(self, u: float, v: float) -> tuple[int, int]:
        return int(v) // self.coarse.step, int(u) // self.coarse.step

    def follow(self, depth_mm: np.ndarray, timestamp: float) -> tuple[np.ndarray, np.ndarray]:
        """Return bands of columns of the image, 20 rows high, by person, at a distance."""
        labels, depth = np.zeros(self.coarse.camera.shape, dtype=np.int32), np.zeros(self.coarse.camera.shape)
        for number, (columns, distance) in self.frames[round(timestamp * 10)].items():
            labels[20:40, columns], depth[20:40, columns] = number, distance
            x = distance * (0.5 * (columns.start + columns.stop) - self.coarse.camera.cx) / self.coarse.camera.fx
            known = self.people[number - 1]
            first = known.first if known.first >= 0.0 else timestamp
            head = np.array([x, known.tallest, -distance])
            self.people[number - 1] = replace(known, head=head, first=first, last=timestamp)
        return labels, depth

    def find(self, depth_mm: np.ndarray, timestamp: float, told: Mapping[int, Any]) -> tuple[Sighting, ...]:
        self.told = told
        return tuple(Sighting(k, np.full(KINECT.shape, k, np.float32), None, KINECT) for k in (1, 2, 3))


class Frames:
    """Recording of which only the times matter."""

    def __init__(self, timestamps: np.ndarray) -> None:
        self.timestamps = timestamps

    def __len__(self) -> int:
        return len(self.timestamps)

    def depth(self, i: int) -> None:
        return None


SMALL, LARGE = slice(10, 30), slice(60, 110)


@pytest.mark.parametrize(("together", "refused"), [(2, False), (3, True)])
def test_two_are_one_too_many_who_are_seen_together_for_more_than_half_of_the_time(together, refused):
    frames = [{2: (LARGE, 3.0)} | ({1: (SMALL, 3.0)} if k < together else {}) for k in range(4)]
    sensing, recording = SensingSettings(subject="only"), Frames(np.arange(4) / 10)
    if refused:
        with pytest.raises(SegmentationError, match="2 people are in view"):
            meant_person(recording, FakePeople(frames), sensing)
    else:
        assert meant_person(recording, FakePeople(frames), sensing) == {2}


def test_two_people_are_refused_before_a_long_recording_is_followed_to_its_end():
    both, times = {2: (LARGE, 3.0), 1: (SMALL, 3.0)}, np.arange(400) / 10
    shown = FakePeople([both] * (1 + round(10 * FIRST_SECONDS)))  # any later frame is an IndexError
    with pytest.raises(SeveralPeopleError):
        meant_person(Frames(times), shown, SensingSettings(subject="only"))


def test_a_seed_selects_the_person_at_its_pixel_in_the_first_frame_with_people():
    frames = [{}, {1: (SMALL, 3.0), 2: (LARGE, 3.0)}, {1: (LARGE, 3.0)}]
    recording = Frames(np.arange(3) / 10)
    step = FakePeople().coarse.step
    for column, meant in ((20, 1), (80, 2)):
        sensing = SensingSettings(segment=f"seed:{step * column},{step * 30}")
        assert meant_person(recording, FakePeople(frames), sensing) == {meant}
    with pytest.raises(SegmentationError, match="no person is found at the pixel"):
        meant_person(recording, FakePeople(frames), SensingSettings(segment="seed:0,0"))


BESIDE, EDGE = slice(70, 100), slice(100, 130)


@pytest.mark.parametrize(
    ("pieces", "heights", "expected"),
    [
        ([{1: (EDGE, 3.0)}, {}, {2: (EDGE, 3.1)}, {}, {3: (EDGE, 2.9)}], (0.4, 0.41, 0.38), {1, 2, 3}),
        ([{1: (EDGE, 3.0)}, {}, {2: (EDGE, 2.9)}], (0.4, 0.6, 0.4), {1}),
        ([{1: (EDGE, 3.0)}, {}, {2: (SMALL, 2.9)}], (0.4, 0.4, 0.4), {1}),
        ([{1: (EDGE, 3.0)}, {1: (EDGE, 3.0), 2: (BESIDE, 2.9)}, {2: (BESIDE, 2.9)}], (0.4, 0.4, 0.4), {1}),
        ([{1: (EDGE, 3.0)}, {2: (EDGE, 3.0)}, {1: (EDGE, 3.0)}], (0.4, 0.4, 0.4), {1}),
    ],
    ids=["one person", "taller", "too far to walk", "both in view", "between"],
)
def test_pieces_that_can_be_one_person_are_one_track(pieces, heights, expected):
    recording, sensing = Frames(np.arange(len(pieces)) / 10), SensingSettings()
    assert meant_person(recording, FakePeople(pieces, heights), sensing) == expected


def test_the_track_follows_the_piece_in_view():
    finder = SelectedPersonFinder(FakePeople(), frozenset({2, 3}))
    (sighting,) = finder.find(None, 0.0, {1: None})
    assert sighting.id == 1 and (sighting.depth == 2).all()
    finder._finder.people[2] = replace(finder._finder.people[2], last=0.5)
    (sighting,) = finder.find(None, 1.0, {1: None})
    assert (sighting.depth == 3).all() and list(finder._finder.told) == [3]


# Cameras on their side.


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_the_vertical_of_a_file_determines_the_image_rotation(turns):
    up = rotated_points(np.array([0.0, -1.0, 0.0]), -turns)
    recording = SimpleNamespace(options={}, vertical=SimpleNamespace(source="file", up_camera=up))
    assert quarter_turns(recording) == turns
    recording.options = {"rotate": 90}
    assert quarter_turns(recording) == 0
