"""The suite of upper bodies, its figures, and its annotations."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks._upper import BAD, JOINTS, ROWS, UpperScore, pixel_errors, score_upper, upper_figures
from tests.support.upper import GROUPS, MORE, upper_scenes
from toolkit.body.shape import subject_body
from toolkit.io.errors import UsageError
from toolkit.mocap.procedural import procedural_clips
from toolkit.sensing.camera import Camera
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.scene import cut_tilt, place_camera
from toolkit.simulation.seating import neck_height
from toolkit.simulation.sensors import make_sensor
from toolkit.simulation.simulate import CaptureSettings, prepare
from toolkit.tracks import LOST, TRACKED

CAMERA = Camera(285.6, 285.6, 159.5, 119.5, 320, 240)


def test_each_group_has_two_takes_in_either_split() -> None:
    tune, report = (upper_scenes(split, (*GROUPS, *MORE)) for split in ("tune", "report"))
    for scenes in (tune, report):
        assert [scene.group for scene in scenes] == [group for group in (*GROUPS, *MORE) for _ in range(2)]
        assert len({scene.seed for scene in scenes}) == len(scenes)
    assert len(upper_scenes("tune")) == 2 * len(GROUPS)
    assert len(upper_scenes("tune", ("cut", "desk"), 1)) == 2


@pytest.mark.data
def test_the_splits_share_no_motion() -> None:
    tune, report = (upper_scenes(split, (*GROUPS, *MORE)) for split in ("tune", "report"))
    assert not {s.actors[0].clip for s in tune} & {s.actors[0].clip for s in report}


@pytest.mark.parametrize(("height", "distance", "cut"), [(1.5, 1.4, 1.0), (1.2, 1.1, 0.7)])
def test_the_lowest_row_of_the_image_meets_the_subject_at_the_cut(height: float, distance: float, cut: float) -> None:
    camera = make_sensor("kinect").camera
    view = place_camera(distance=distance, height=height, tilt=cut_tilt(camera, height, distance, cut))
    (pixel,) = camera.project(view.to_camera(np.array([[0.0, cut, 0.0]])))
    assert pixel[1] == pytest.approx(camera.height - 1)


def test_errors_are_counted_in_pixels_of_640_columns() -> None:
    truth = np.zeros((1, 20, 3)) + [0.0, 0.0, 1.5]
    found = truth + [0.021, 0.0, 0.0]
    score = score_upper("take", found, np.array([TRACKED]), truth, CAMERA)
    np.testing.assert_allclose(score.pixels, 2 * 285.6 * 0.021 / 1.5, rtol=1e-6)
    np.testing.assert_allclose(score.mm, 21.0, rtol=1e-6)
    places = CAMERA.project(truth[0, ROWS])[None]
    np.testing.assert_allclose(pixel_errors(found[:, ROWS], places, CAMERA), score.pixels)


def test_who_is_behind_the_camera_counts_as_far_as_can_be() -> None:
    truth = np.zeros((1, 20, 3)) + [0.0, 0.0, 1.5]
    score = score_upper("take", -truth, np.array([LOST]), truth, CAMERA)
    assert (score.pixels == 2 * BAD).all() and (score.mm == 1000.0).all()


def test_first_frames_are_the_first_tracked_ones_and_wrong_frames_are_counted() -> None:
    pixels = np.full((4, 7), 10.0)
    pixels[0], pixels[1, 5:], pixels[3] = 120.0, 115.0, 90.0
    tracked = np.array([False, True, True, True])
    figures = upper_figures([UpperScore("take", pixels, pixels, tracked)])
    assert figures["first_px"] == pytest.approx(pixels[1].mean())
    assert figures["upper_px"] == pytest.approx(pixels.mean()) == pytest.approx(figures["upper_mm"])
    assert figures["hands_px"] == pytest.approx(pixels[:, 5:].mean())
    assert figures["wrong_tracked"] == 0.5  # of the two wrong frames one is said to be tracked
    assert figures["curve"]["10"] == pytest.approx((pixels <= 10).mean())
    assert upper_figures([]) == {}
    never = upper_figures([UpperScore("take", pixels, pixels, np.zeros(4, dtype=bool))])
    assert never["first_px"] is None


@pytest.mark.parametrize("file", ["stills.json", "seated.json"])
def test_annotations_are_in_the_image_and_both_readings_nearly_agree(file: str) -> None:
    content = json.loads((Path(__file__).parents[1] / "benchmarks" / "annotations" / file).read_text(encoding="utf-8"))
    assert content["joints"] == list(JOINTS) and len(content["first"]) == 8
    for places in content["first"].values():
        assert np.array(places).shape == (7, 2) and (np.array(places) >= 0).all()
        assert (np.array(places) < [640, 480]).all()
    for name, others in content["second"].items():
        for joint, place in others.items():
            first = content["first"][name][content["joints"].index(joint)]
            assert np.linalg.norm(np.subtract(first, place)) < 15


def test_a_camera_at_neck_height_sees_the_neck_level_with_it() -> None:
    clip, body = procedural_clips(["conduct"])[0], subject_body("slim_female")
    simulation = prepare([SimulatedPerson(clip, body)], CaptureSettings(height=None, cut=0.45))
    assert simulation.view.position[1] == pytest.approx(neck_height(body))


@pytest.mark.parametrize("seated", [False, True])
def test_a_cut_ends_the_image_as_far_below_the_neck(seated: bool) -> None:
    clip = procedural_clips(["conduct"])[0]
    body = subject_body("slim_female")
    shot = CaptureSettings(sensor="kinect", distance=1.4, height=1.3, cut=0.45)
    simulation = prepare([SimulatedPerson(clip, body, seated=seated)], shot)
    lowest = np.array([0.0, neck_height(body, seated=seated) - 0.45, 0.0])
    camera = simulation.sensor.camera
    assert camera.project(simulation.view.to_camera(lowest)[None])[0, 1] == pytest.approx(camera.height - 1)


@pytest.mark.parametrize(("values", "said"), [({"tilt": 5.0}, "give one"), ({"cut": float("nan")}, "below the neck")])
def test_a_cut_that_cannot_be_is_named(values: dict[str, float], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        CaptureSettings(**{"cut": 0.45, **values})
