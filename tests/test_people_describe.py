"""First description of a recording: five lines and a picture."""

import re

import cv2
import numpy as np

from tests.run_helpers import run as run_command
from tests.sensing_scenes import KINECT, scene, up_of_tilt
from toolkit.output.rendering.style import person_color
from toolkit.output.rendering.survey_picture import picture
from toolkit.people.description import describe
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording


def recorded(folder, frames, camera=KINECT, **more):
    path = folder / "take.npz"
    save_recording(path, depth=frames, camera=camera, timestamps=np.arange(len(frames)) / 30, **more)
    return path


def test_a_description_names_camera_vertical_room_people_and_useful_options(tmp_path):
    room = {"tilt": 0.2, "height": 1.4, "wall": 4.5, "floor": True}
    frames = [scene(KINECT, ((-0.7 + 0.02 * k, 2.6), (0.7, 3.2)), **room)[0] for k in range(9)]
    path = recorded(tmp_path, frames, background=scene(KINECT, (), **room)[0], up_camera=up_of_tilt(0.2))
    camera, up, surroundings, people, advice = describe(open_recording(path)).lines
    assert camera == "camera: 320 x 240, 59 degrees wide, 9 frames, 30.0 frames a second"
    assert up == "up: file; the camera looks 11 degrees down, rolled by 0"
    assert surroundings.startswith("room: known")
    heading, *found = people.split("\n  ")
    assert heading == "people: 2 in the first 3 s" and [line[0] for line in found] == ["1", "2"]
    score = r" \(person score \+\d+\.\d \(1 sampled frames, \d+% of the head moved\)\)"
    for line, distance in zip(sorted(found, key=lambda line: line[5:]), ("2.5", "3.1"), strict=True):
        assert re.fullmatch(rf"\d at {distance} m, whole{score}", line)
    assert advice == "advice: --people all follows all of them"


def test_colour_is_evidence_for_a_visible_person(tmp_path):
    someone, nobody = scene(KINECT, ((0.0, 2.0),))[0], np.zeros(KINECT.shape, dtype=np.uint16)
    color = np.zeros((1, *KINECT.shape, 3), dtype=np.uint8)
    for name, frame, more, told in (
        ("a", someone, color, True),
        ("b", someone, None, False),
        ("c", nobody, color, False),
    ):
        (tmp_path / name).mkdir()
        look = describe(open_recording(recorded(tmp_path / name, [frame], color=more)))
        assert ("--joints colour" in look.lines[4]) == told


def test_a_camera_on_its_side_is_noticed(tmp_path):
    upright = scene(KINECT, ((0.0, 2.6),), height=1.5, wall=4.0, floor=True)[0]
    path = recorded(tmp_path, [np.rot90(upright)], KINECT.rotated(3))
    look = describe(open_recording(path))
    assert "give --rotate 90" in look.concerns[0].text and "--rotate" not in look.lines[4]
    assert "1 at 2.5 m" in describe(open_recording(path, rotate=90)).lines[3]


def test_the_picture_shows_each_person_in_one_colour(tmp_path):
    depth, who = scene(KINECT, ((-0.7, 2.6), (0.7, 2.6)))
    look = describe(open_recording(recorded(tmp_path, [depth])))
    image = picture(look).astype(int)
    hues = [image[who == number].mean(axis=0) / image[who == number].mean() for number in (1, 2)]
    expected = [np.array(person_color(k)) / np.mean(person_color(k)) for k in (0, 1)]
    off = [[np.abs(hue - color).max() for color in expected] for hue in hues]
    assert sorted(int(np.argmin(row)) for row in off) == [0, 1] and max(min(row) for row in off) < 0.1


def test_the_verb_prints_a_line_for_each_thing_and_person_and_writes_the_picture(tmp_path, capsys):
    path = recorded(tmp_path, [scene(KINECT, ((0.0, 2.6),))[0]])
    assert run_command("info", path, "--output", tmp_path / "look.png") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines.pop(4).startswith("  1 at ")
    assert [line.split(":")[0] for line in lines] == ["camera", "up", "room", "people", "advice", "picture"]
    assert cv2.imread(str(tmp_path / "look.png")).shape == (*KINECT.shape, 3)
