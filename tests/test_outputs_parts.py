"""Recordings turned and mirrored, and what is drawn or noted of tracks, each by itself."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import RecordingError
from toolkit.mocap.choreography import controls_of
from toolkit.output.export.notes import notes_of, write_notes
from toolkit.output.rendering.depth_alone import DepthPainter
from toolkit.output.rendering.painter import RenderSettings
from toolkit.output.rendering.track_plot import SKELETONS, plot_person
from toolkit.people.vertical import find_vertical
from toolkit.recordings.readers.base import ArrayFrames
from toolkit.sensing.camera import Camera
from toolkit.sensing.conversion import DepthConverter
from toolkit.sensing.recording import Recording
from toolkit.tracks import EMPTY, LOST, TRACKED

CAMERA = Camera(50.0, 55.0, 11.0, 7.0, 20, 16)
POINT = np.array([0.1, -0.2, 2.0])


def recording(*, mirrored: bool = False, rotate: int = 0, **others: Any) -> Recording:
    """Two frames whose only measurement is that of `POINT`, which is a joint as well."""
    u, v = np.rint(CAMERA.project(POINT)).astype(int)
    depth = np.zeros((2, *CAMERA.shape), dtype=np.uint16)
    depth[:, v, u] = 2000
    joints = np.full((2, 20, 3), np.nan, dtype=np.float32)
    joints[:, 0] = POINT
    given: dict[str, Any] = {"timestamps": np.array([0.0, 0.1]), "source": ArrayFrames(depth)}
    given |= {"joints": joints, "stored_up": np.array([0.0, -2.0, 0.0]), "background": depth[0]}
    return Recording(
        "take", Path("take.npz"), CAMERA, converter=DepthConverter("mm", mirrored=mirrored),
        find_vertical=find_vertical, options={"rotate": rotate}, **(given | others),
    )  # fmt: skip


@pytest.mark.parametrize("rotate", [0, 90, 180, 270])
@pytest.mark.parametrize("mirrored", [False, True])
def test_joints_lie_where_they_are_measured_however_a_recording_is_turned(mirrored: bool, rotate: int) -> None:
    take = recording(mirrored=mirrored, rotate=rotate)
    for image in (take.depth(1), take.background, *(frame.depth_mm for frame in take.stream(1))):
        assert image is not None and image.shape == take.camera.shape
        ((v, u),) = np.argwhere(image)
        assert take.joints is not None
        np.testing.assert_allclose(take.camera.project(take.joints[0, 0]), [u, v], atol=0.51)
    assert np.linalg.norm(take.up_camera) == pytest.approx(1.0) and take.vertical.source == "file"
    away = float(take.joints[0, 0] @ take.up_camera)
    assert away == pytest.approx(-POINT[1]), "as high above the camera as before"


def test_frames_that_there_are_not_and_a_vertical_that_is_none_are_refused() -> None:
    take = recording()
    for number in (-1, 2):
        with pytest.raises(RecordingError, match="frames 0 to 1"):
            take.depth(number)
    with pytest.raises(RecordingError, match="no direction"):
        _ = recording(stored_up=np.zeros(3)).vertical
    with pytest.raises(RecordingError, match="holds no frame"):
        recording(timestamps=np.zeros(0), source=ArrayFrames(np.zeros((0, *CAMERA.shape))))


# Notes beside files.


class Rows(SimpleNamespace):
    """A track of which the states matter."""

    def __len__(self) -> int:
        return len(self.state)


def person(states: list[int]) -> Any:
    state = np.array(states, dtype=np.uint8)
    joints = np.tile(load_body("neutral").joint_positions(np.zeros(skeleton.POSE_SIZE)), (len(state), 1, 1))
    times = np.arange(len(state)) / 10
    return SimpleNamespace(name="ann", track=Rows(state=state), there=state != EMPTY, joints_level=joints, times=times)


def test_notes_say_from_which_frame_to_which_nobody_is_there_or_known(tmp_path: Path) -> None:
    origin: Any = SimpleNamespace(note=lambda: "y up")
    ann = person([EMPTY, EMPTY, TRACKED, LOST, TRACKED, EMPTY])
    (entry,) = notes_of(origin, [ann])["people"]
    assert entry == {"name": "ann", "nobody_there": [[0, 1], [5, 5]], "lost": [[3, 3]]}
    write_notes(tmp_path / "motion.bvh", origin, [ann])
    assert json.loads((tmp_path / "motion.bvh.notes.json").read_text())["people"] == [entry]


# Pictures.


@pytest.mark.parametrize(("states", "drawn"), [([TRACKED] * 12, SKELETONS), ([EMPTY] * 12, 0)])
def test_a_plot_shows_some_skeletons_of_who_is_there_and_five_curves(states: list[int], drawn: int) -> None:
    above, below = plot_person(person(states)).axes
    assert len(above.lines) == drawn * len(skeleton.BONES)
    assert [line.get_label() for line in below.lines] == ["head", "left hand", "right hand", "left foot", "right foot"]
    head = below.lines[0].get_ydata()
    assert np.nanmin(head) > np.nanmax(below.lines[3].get_ydata())


def test_depth_alone_has_one_scale_of_colours_and_an_even_size() -> None:
    take: Any = SimpleNamespace(name="take", timestamps=np.array([0.0, 0.1]))
    painter = DepthPainter(take, RenderSettings(height=120))
    depth = np.repeat(np.repeat([1000, 2000, 3000], 7)[None], 15, axis=0).astype(np.uint16)
    first = painter.paint(0, depth)
    again = painter.paint(1, np.where(depth == 2000, depth, 0).astype(np.uint16))
    assert first.shape[1] % 2 == 0 and first.shape == again.shape
    near, middle, far = (first[-60, column] for column in (20, 84, 148))
    assert near.sum() > middle.sum() > far.sum() > again[-60, 148].sum(), "nearer is lighter, nothing is dark"
    np.testing.assert_array_equal(again[-60, 84], middle)


def test_controls_of_both_sides_are_those_of_each() -> None:
    assert controls_of({"bend": 1, "both": {"flex": 3, "knee": 4}, "right": {"knee": 5}}) == {
        "bend": 1, "left_flex": 3, "right_flex": 3, "left_knee": 4, "right_knee": 5,
    }  # fmt: skip
