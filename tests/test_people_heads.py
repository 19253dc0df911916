"""Head candidates of a frame: people near, far and half occluded, an empty room, the foreground, neighbouring peaks."""

from dataclasses import replace

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, NO_HEAD, ConstantOdds, neutral, scene, standing, view_of
from toolkit.body.skeleton import POSE_NAMES, POSE_SIZE, REPORTED
from toolkit.mocap.clip import PoseClip
from toolkit.people.detection import HEAD_DISTANCE, Head, connected_surfaces, find_heads, head_score, large_enough
from toolkit.people.view import CoarseCamera, View
from toolkit.sensing.camera import Camera
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, prepare

ROOM = {"height": 1.2, "wall": 4.0, "floor": True}
HEAD = REPORTED.index("head")


def people_in(view: View, coarse: CoarseCamera) -> list[Head]:
    """Return the heads that the network gives to people."""
    return [head for head in find_heads(view, coarse) if head.score > 0]


def true_head(x: float, distance: float, height: float = 1.2) -> np.ndarray:
    """Return the head's centre (3,) of a simulated person, level frame."""
    return neutral()[0].joint_positions(standing(x, distance, height))[HEAD]


def beside(place: np.ndarray, truth: np.ndarray) -> float:
    """Return the distance of two places (3,) in the plane through the second that faces a level camera, metres."""
    return float(np.hypot(*(place[:2] * truth[2] / place[2] - truth[:2])))


@pytest.mark.parametrize("room", [{}, ROOM])
@pytest.mark.parametrize(
    "people", [((0.2, 2.5),), ((-0.7, 2.6), (0.7, 3.0)), ((-0.2, 2.5), (0.2, 2.5))], ids=["one", "two", "touching"]
)
def test_the_heads_of_people_are_found(people, room):
    coarse, view = view_of(scene(KINECT, people, **room)[0])
    heads = people_in(view, coarse)
    assert len(heads) == len(people)
    for truth in (true_head(*place) for place in people):
        assert min(beside(head.place, truth) for head in heads) < 0.1


def test_an_empty_room_has_no_head():
    coarse, view = view_of(scene(KINECT, (), **ROOM)[0])
    assert people_in(view, coarse) == []


@pytest.mark.parametrize("room", [{}, {"wall": 7.0, "floor": True}])
def test_a_head_at_a_distance_of_more_than_five_metres_is_found(room):
    coarse, view = view_of(scene(KINECT, ((0.5, 5.5),), height=1.5, **room)[0])
    (head,) = people_in(view, coarse)
    assert beside(head.place, true_head(0.5, 5.5, 1.5)) < 0.1


def sitting() -> PoseClip:
    """Return one frame of a person with hanging arms."""
    pose = np.zeros((1, POSE_SIZE))
    for side, angle in (("left", -1.2), ("right", 1.2)):
        pose[:, POSE_NAMES.index(f"{side}_shoulder_rz")] = angle
    return PoseClip("sitting", pose, 30.0, "test")


def test_a_head_above_a_desk_that_occludes_half_of_a_seated_person_is_found():
    shot = CaptureSettings(sensor="kinect", distance=2.8, height=1.3)
    free, occluded = (
        prepare([SimulatedPerson(sitting(), seated=True, furniture=things)], shot)
        for things in (("chair",), ("chair", "desk"))
    )
    shown = [int((next(simulation.frames()).person == 0).sum()) for simulation in (free, occluded)]
    assert shown[1] < 0.6 * shown[0]
    frame = next(occluded.frames())
    coarse, view = view_of(frame.depth, occluded.sensor.camera, occluded.view.up_camera)
    (head,) = people_in(view, coarse)
    place, truth = coarse.from_level(head.place[None])[0], frame.joints[0, HEAD]
    assert beside(place, truth) < 0.1


def test_a_head_outside_the_foreground_is_no_candidate():
    depth, who = scene(KINECT, ((-0.7, 2.6), (0.7, 3.0)), **ROOM)
    coarse, view = view_of(depth)
    second = replace(view, foreground=who[:: coarse.step, :: coarse.step] == 2)
    (head,) = find_heads(second, coarse)
    assert beside(head.place, true_head(0.7, 3.0)) < 0.1
    assert head_score(second, coarse, head.place) == head.score
    assert head_score(second, coarse, true_head(-0.7, 2.6)) is None


class TwoPeaks:
    """Person network with two peaks of heads in a row of the image, the left one higher."""

    def __init__(self, row: int, columns: tuple[int, int]) -> None:
        self.row, self.columns = row, columns

    def odds(self, depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """See `PersonNetwork.odds`."""
        peaks = np.full(depth.shape, NO_HEAD, dtype=np.float32)
        peaks[self.row, self.columns] = 3.0, 1.0
        return np.where(depth > 0, np.float32(1), np.float32(0)), peaks


@pytest.mark.parametrize(("factor", "count"), [(0.7, 1), (1.4, 2)])
def test_peaks_closer_than_two_heads_are_one_head(factor, count):
    apart = round(factor * HEAD_DISTANCE * KINECT.fx / 2 / 2.5)
    coarse, view = view_of(np.full(KINECT.shape, 2500, dtype=np.uint16), network=TwoPeaks(50, (60, 60 + apart)))
    heads = find_heads(view, coarse)
    assert len(heads) == count
    assert heads[0].place[0] == pytest.approx((60 - coarse.camera.cx) / coarse.camera.fx * 2.5, abs=0.01)
    assert [head.score for head in heads] == sorted((head.score for head in heads), reverse=True)


class Sides(ConstantOdds):
    """Person network with one score for the left half of the image and one for the right half."""

    def __init__(self, left: float, right: float) -> None:
        super().__init__(right)
        self.left = left

    def _by_side(self, values: np.ndarray) -> np.ndarray:
        left = np.arange(values.shape[1]) < values.shape[1] // 2
        return np.where(left & (values == self.pixels), np.float32(self.left), values)

    def odds(self, depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """See `PersonNetwork.odds`."""
        people, heads = super().odds(depth, camera)
        return self._by_side(people), self._by_side(heads)


@pytest.mark.parametrize(("odds", "people"), [(2.0, 2), (-1.0, 1)])
def test_two_heads_have_two_surfaces_and_that_of_a_rejected_head_has_a_negative_score(odds, people):
    depth_mm, who = scene(KINECT, ((-0.7, 2.6), (0.7, 3.0)))
    coarse, view = view_of(depth_mm, network=Sides(odds, 3.0))
    heads = find_heads(view, coarse)
    assert [np.sign(head.place[0]) for head in heads] == [1, -1], "the most probable first"
    assert sum(head.score > 0 for head in heads) == people
    labels = connected_surfaces(view, coarse, [head.place for head in heads])
    truth = who[:: coarse.step, :: coarse.step]
    for number, person in ((1, 2), (2, 1)):
        assert (labels[truth == person] == number).mean() > 0.9
        assert large_enough(view, coarse, labels == number)
    assert not labels[truth == 0].any()


def test_a_surface_of_a_person_has_an_area_and_a_height():
    coarse, view = view_of(np.full(KINECT.shape, 2500, dtype=np.uint16))
    rows, columns = (int(metres * coarse.camera.fx / 2.5) for metres in (0.5, 0.4))
    mask = np.zeros(view.depth.shape, dtype=bool)
    mask[:rows, :columns] = True
    assert large_enough(view, coarse, mask)
    assert not large_enough(view, coarse, mask & (np.arange(len(mask)) < rows // 2)[:, None]), "too low"
    narrow = mask & (np.arange(mask.shape[1]) < columns // 4)
    assert not large_enough(view, coarse, narrow) and large_enough(view, coarse, narrow, cut_out=True)
