"""Simulated images that end at a height below the neck."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.body.shape import subject_body
from toolkit.io.errors import UsageError
from toolkit.mocap.procedural import procedural_clips
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.scene import cut_tilt, place_camera
from toolkit.simulation.seating import neck_height
from toolkit.simulation.sensors import make_sensor
from toolkit.simulation.simulate import CaptureSettings, prepare


@pytest.mark.parametrize(("height", "distance", "cut"), [(1.5, 1.4, 1.0), (1.2, 1.1, 0.7)])
def test_the_lowest_row_of_the_image_meets_the_subject_at_the_cut(height: float, distance: float, cut: float) -> None:
    camera = make_sensor("kinect").camera
    view = place_camera(distance=distance, height=height, tilt=cut_tilt(camera, height, distance, cut))
    (pixel,) = camera.project(view.to_camera(np.array([[0.0, cut, 0.0]])))
    assert pixel[1] == pytest.approx(camera.height - 1)


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
