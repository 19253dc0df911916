"""The person network: input, log-odds of people, heads and rooms, the same bits everywhere."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, scene
from toolkit.people import person_network
from toolkit.people.view import CoarseCamera
from toolkit.sensing.camera import Camera
from toolkit.sensing.sensing_settings import SensingSettings

UP = np.array([0.0, -1.0, 0.0])
ROOM = {"height": 1.2, "wall": 4.0, "floor": True}


@pytest.fixture(scope="module")
def seen() -> tuple[np.ndarray, np.ndarray, Camera]:
    """Return the coarse depth of a person in a room, the person's pixels, and the camera."""
    coarse = CoarseCamera(KINECT, UP, SensingSettings())
    depth, who = scene(KINECT, ((0.3, 2.5),), **ROOM)
    return coarse.downsampled(depth), who[:: coarse.step, :: coarse.step] == 1, coarse.camera


def test_pixels_of_a_person_have_higher_log_odds_than_the_room(seen: tuple[np.ndarray, np.ndarray, Camera]) -> None:
    depth, person, camera = seen
    odds, _ = person_network.person_network().odds(depth, camera)
    assert odds.dtype == np.float32 and odds.shape == depth.shape
    assert (odds[person] > 0).mean() > 0.9 and (odds[(depth > 0) & ~person] < 0).mean() > 0.9


def test_log_odds_are_multiples_of_a_step_and_those_of_people_are_zero_without_measurement(
    seen: tuple[np.ndarray, np.ndarray, Camera],
) -> None:
    depth, _, camera = seen
    holes = np.where(np.arange(depth.shape[1]) % 7 == 0, np.float32(0), depth)
    odds, heads = (image / person_network.STEP for image in person_network.person_network().odds(holes, camera))
    assert (odds[holes == 0] == 0).all() and np.array_equal(odds, np.rint(odds))
    assert heads[holes == 0].any() and np.array_equal(heads, np.rint(heads)) and heads.shape == depth.shape


def test_the_log_odds_of_a_head_are_positive_at_the_head_alone(seen: tuple[np.ndarray, np.ndarray, Camera]) -> None:
    depth, person, camera = seen
    _, heads = person_network.person_network().odds(depth, camera)
    top = np.flatnonzero(person.any(axis=1))[0]
    head = np.zeros(person.shape, dtype=bool)
    head[: top + round(0.3 * camera.fy / 2.5)] = True  # metres from the crown to the chin of a tall adult
    assert heads[person & head].max() > 0 > heads[~person | ~head].max()


def test_a_person_is_found_by_cameras_of_other_sizes_and_focal_lengths(
    seen: tuple[np.ndarray, np.ndarray, Camera],
) -> None:
    depth, person, c = seen
    found = person_network.person_network().odds
    wide, _ = found(depth[1:-5, 7:], Camera(c.fx, c.fy, c.cx - 7, c.cy - 1, c.width - 7, c.height - 6))
    assert (wide[person[1:-5, 7:]] > 0).mean() > 0.9
    # The same image by a camera of half the focal length: everything is half as far away.
    half, _ = found(depth * np.float32(0.5), Camera(0.5 * c.fx, 0.5 * c.fy, c.cx, c.cy, c.width, c.height))
    assert np.abs(half - found(depth, c)[0]).mean() < 0.05


def test_features_follow_their_definition() -> None:
    rng = np.random.default_rng(0)
    millimetres = rng.integers(200, 6000, (32, 48))
    millimetres[rng.random(millimetres.shape) < 0.3] = 0
    valid, inverse, logarithm, relief = person_network.features(millimetres) / 64.0
    metres = np.maximum(millimetres, 300) * 0.001
    measured = millimetres > 0
    assert np.array_equal(valid, measured)
    assert inverse == pytest.approx(np.where(measured, 1 / metres, 0), abs=1 / 128)
    assert logarithm == pytest.approx(np.where(measured, np.log(metres), 0), abs=1 / 128)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(millimetres, 7), (15, 15))
    mean = around.sum((2, 3)) / np.maximum((around > 0).sum((2, 3)), 1)
    expected = np.clip((millimetres - mean) / 400, -2, 2)
    assert relief == pytest.approx(np.where(measured, expected, 0), abs=1 / 128)


BITS = """
import hashlib
import cv2
import numpy as np
from toolkit.people.person_network import person_network
from toolkit.sensing.camera import Camera
cv2.setNumThreads({threads})
rng = np.random.default_rng(5)
depth = np.where(rng.random((120, 160)) < 0.2, 0, rng.uniform(0.5, 6, (120, 160))).astype(np.float32)
camera = Camera(140.0, 140.0, 79.5, 59.5, 160, 120)
for image in person_network().odds(depth, camera):
    print(hashlib.sha256(image.tobytes()).hexdigest())
"""


def test_both_outputs_have_the_same_bits_on_every_processor() -> None:
    digests = set()
    for threads, disabled in ((1, ""), (2, ""), (1, "AVX2,AVX512_SKX,FMA3")):
        environment = {**os.environ, "OPENCV_CPU_DISABLE": disabled}
        command = [sys.executable, "-c", BITS.format(threads=threads)]
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, cwd=Path.cwd())
        digests.add(tuple(run.stdout.split()[-2:]))
    assert len(digests) == 1 and len(set(*digests)) == 2
