"""Recordings that can be read but are not as intended: each fault is named with the option that corrects it."""

import json
import os
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import depthmocap
from depthmocap import tracks
from tests.fake_tracker import FakeTracker
from tests.run_helpers import run
from tests.sensing_scenes import KINECT, neutral, scene, standing
from toolkit.app.cli.main import standard_streams
from toolkit.app.cli.terminal import program
from toolkit.app.pipeline import TrackerRecipe
from toolkit.app.pipeline.batch import MANIFEST_FILE
from toolkit.app.pipeline.run_summary import RunSummary, track_warnings
from toolkit.body import skeleton
from toolkit.io.errors import PlausibilityWarning, RecordingError
from toolkit.people.image_rotation import quarter_turns
from toolkit.people.plausibility import plausibility
from toolkit.recordings.opening import recording_of, upright
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.conversion import DEPTH_UNITS
from toolkit.simulation.raycast import render_depth
from toolkit.tracks import EMPTY

CENTRED = (KINECT.fx, KINECT.fy, KINECT.cx, KINECT.cy)
ALONE: dict[str, Any] = {}
ROOM: dict[str, Any] = {"wall": 4.5, "floor": True, "height": 1.4}
SQUARER = Camera(365.5, 365.5, 255.5, 211.5, 512, 424)


def frames(room: dict[str, Any] = ALONE, camera: Camera = KINECT) -> np.ndarray:
    """Return a person who shifts from foot to foot: uint16 (4, H, W), millimetres."""
    return np.stack([scene(camera, ((x, 3.4),), **room)[0] for x in (-0.2, -0.1, 0.0, 0.1)])


def kinds(depth: np.ndarray, **options: Any) -> dict[str, str]:
    """Return the kind of each concern with its text."""
    recording = recording_of(depth, **{"intrinsics": CENTRED, "frame_rate": 30.0, **options})
    return {concern.kind: concern.text for concern in plausibility(recording)}


@pytest.mark.parametrize("room", [ALONE, ROOM])
def test_a_plausible_recording_raises_no_concern(room: dict[str, Any]) -> None:
    assert kinds(frames(room)) == {}


@pytest.mark.parametrize(
    ("intrinsics", "says"),
    [
        ((575.8, 575.8, 319.5, 239.5), "look like the intrinsics of 640x480"),
        ((143.9, 143.9, 79.5, 59.5), "25 % of the image away from its centre"),
        ((287.0, 287.0, 119.5, 159.5), "has cx and cy exchanged"),
        ((287.0, 287.0, 159.5, 170.0), "21 % of the image away"),
        ((71.4, 71.4, 39.9, 29.9), "37 % of the image away"),
        ((285.6, 142.8, 159.5, 119.5), "the focal lengths 285.6 and 142.8 differ"),
        ((428.4, 285.6, 159.5, 119.5), "the focal lengths 428.4 and 285.6 differ"),
    ],
)
def test_intrinsics_of_another_image_size_are_named(intrinsics: tuple[float, ...], says: str) -> None:
    found = kinds(frames(), intrinsics=intrinsics)
    assert list(found) == ["intrinsics"] and says in found["intrinsics"] and "--intrinsics" in found["intrinsics"]


def test_exchanged_centres_of_a_nearly_square_image_are_named() -> None:
    image = np.stack([scene(SQUARER, ((0.0, 3.4),))[0]] * 2)
    right = (SQUARER.fx, SQUARER.fy, SQUARER.cx, SQUARER.cy)
    assert kinds(image, intrinsics=right) == {}
    assert "exchanged" in kinds(image, intrinsics=(*right[:2], right[3], right[2]))["intrinsics"]


def test_a_principal_point_is_that_of_the_image_in_the_file() -> None:
    turned = np.ascontiguousarray(np.rot90(frames(), -1, axes=(1, 2)))
    camera = KINECT.rotated(1)
    found = kinds(turned, intrinsics=(camera.fx, camera.fy, camera.cx, camera.cy), rotate=270)
    assert found == {}


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_focal_length_of_another_size_makes_dwarfs_and_giants(factor: float) -> None:
    found = kinds(frames(), intrinsics=(KINECT.fx * factor, KINECT.fy * factor, KINECT.cx, KINECT.cy))
    assert found and "--depth-unit" in " ".join(found.values())


UNITS = [name for name in DEPTH_UNITS if name not in ("mm", "m")]


@pytest.mark.parametrize("room", [ALONE, ROOM])
@pytest.mark.parametrize("unit", UNITS)
def test_depth_in_another_unit_is_named_with_the_unit_that_fits(unit: str, room: dict[str, Any]) -> None:
    stored = frames(room) * (0.001 / DEPTH_UNITS[unit])
    stored = np.rint(stored).astype(np.uint16)
    assert kinds(stored, depth_unit=unit) == {}
    try:
        found = kinds(stored)
    except RecordingError as error:
        assert "--depth-unit" in str(error)
        return
    assert found == {"unit": found.get("unit")} and f"give --depth-unit {unit}" in found["unit"]


@pytest.mark.parametrize("beyond", [np.nan, np.inf, -np.inf, -1.0, 1e10, 1e30])
@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64, ">f4"])
def test_what_is_no_measurement_is_not_in_the_depth(beyond: float, kind: Any) -> None:
    depth = frames()
    with np.errstate(over="ignore"):  # in half precision the largest values are infinite
        metres = np.where(depth > 0, depth / 1000.0, beyond).astype(kind)
    recording = recording_of(metres, intrinsics=CENTRED)
    np.testing.assert_allclose(recording.depth(1), depth[1], atol=2 if kind == np.float16 else 0)
    np.testing.assert_array_equal(recording_of(depth.astype(">u2"), intrinsics=CENTRED).depth(1), depth[1])


def test_a_sensor_that_is_rolled_by_45_degrees_raises_no_concern() -> None:
    body, pose = neutral()[0], standing(0.0, 3.4, 1.2)
    for up in ([0.7, -0.7, 0.0], [0.0, -0.7, -0.7]):
        depth = np.rint(1000 * render_depth(body, pose, KINECT, level_rotation(np.array(up)))).astype(np.uint16)
        assert kinds(np.stack([depth] * 2), up_camera=up) == {}


def test_a_person_who_lies_has_the_size_of_a_person() -> None:
    body, pose = neutral()[0], standing(0.0, 3.4, 0.0)
    pose[skeleton.ROOT_ROTATION] = 0.0, 0.0, np.pi / 2
    depth = np.rint(1000 * render_depth(body, pose, KINECT, level_rotation(np.array([0.0, -1.0, 0.0]))))
    assert kinds(np.stack([depth.astype(np.uint16)] * 2)).keys() <= {"orientation"}


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_person_who_is_cut_out_is_turned_upright(turns: int) -> None:
    turned = np.ascontiguousarray(np.rot90(frames(), turns, axes=(1, 2)))
    camera = KINECT.rotated(4 - turns)
    given = {"intrinsics": (camera.fx, camera.fy, camera.cx, camera.cy), "frame_rate": 30.0}
    assert quarter_turns(recording_of(frames(), intrinsics=CENTRED)) == 0
    with pytest.warns(PlausibilityWarning, match=f"turned upright by {90 * turns} degrees; --rotate 0"):
        recording = upright(lambda **more: recording_of(turned, **{**given, **more}))
    assert recording.options["rotate"] == 90 * turns
    np.testing.assert_array_equal(recording.depth(0), frames()[0])
    assert kinds(turned, **given) == {
        "orientation": f"people stand upright in turned images; give --rotate {90 * turns}"
    }


@pytest.mark.parametrize("room", [{"wall": 3.5}, ROOM])
def test_an_empty_room_is_not_turned(room: dict[str, Any]) -> None:
    empty = np.stack([scene(KINECT, (), **room)[0]] * 2)
    assert kinds(empty) == {}
    assert quarter_turns(recording_of(empty, intrinsics=CENTRED)) == 0


@pytest.mark.parametrize("kind", ["disparity", "infra-red", "8 bits"])
def test_images_that_hold_no_depth_are_doubted(kind: str) -> None:
    depth = frames().astype(np.float64)
    there = depth > 0
    if kind == "disparity":
        image = np.where(there, 285.63 * 75.0 * 8.0 / np.maximum(depth, 1.0), 0.0)
    elif kind == "infra-red":
        image = np.where(there, np.random.default_rng(0).uniform(300, 3000, depth.shape), 0.0)
    else:
        image = np.where(there, 255.0 * depth / 8000.0, 0.0)
    if kind == "8 bits":
        with pytest.raises(RecordingError, match="8 bits a pixel"):
            kinds(image.astype(np.uint8))
    try:
        found = kinds(image.astype(np.uint16))
    except RecordingError as error:
        assert "--depth-unit" in str(error)
        return
    assert found and "--depth-unit" in " ".join(found.values())


@pytest.mark.parametrize("where", ["start", "end"])
def test_frames_that_repeat_a_timestamp_are_left_out_and_counted(tmp_path: Path, where: str) -> None:
    times = np.array([0.0, 0.0, 0.1, 0.2]) if where == "start" else np.array([0.0, 0.1, 0.2, 0.2])
    depth = frames()
    joints = np.arange(4 * 60, dtype=np.float32).reshape(4, 20, 3)
    save_recording(tmp_path / "take.npz", depth=depth, camera=KINECT, timestamps=times, joints=joints)
    recording = depthmocap.open_recording(tmp_path / "take.npz")
    kept = [0, 2, 3] if where == "start" else [0, 1, 2]
    assert len(recording) == 3 and recording.stored_frames == 4 and recording.timestamps.tolist() == [0.0, 0.1, 0.2]
    for k, i in enumerate(kept):
        np.testing.assert_array_equal(recording.depth(k), depth[i])
    np.testing.assert_array_equal([image for image in recording.frames()], depth[kept])
    np.testing.assert_array_equal(recording.joints, joints[kept])
    recording.give_joints_2d(np.abs(joints) / 1000.0)
    assert recording.image_joints is not None and recording.image_joints.shape == (1, 3, 20, 3)
    assert "1 of 4 frames repeat the timestamp" in {c.kind: c.text for c in plausibility(recording)}["times"]


def test_a_masked_pixel_is_no_measurement() -> None:
    depth = frames()
    mask = np.zeros(depth.shape, dtype=bool)
    mask[:, :60] = True
    expected = np.where(mask, 0, depth)
    for given in (
        np.ma.masked_array(depth, mask),
        [np.ma.masked_array(d, m) for d, m in zip(depth, mask, strict=True)],
    ):
        np.testing.assert_array_equal(recording_of(given, intrinsics=CENTRED).depth(1), expected[1])
    metres = np.ma.masked_array(depth / 1000.0, mask)
    background = np.ma.masked_array(depth[0] / 1000.0, mask[0])
    recording = recording_of(metres, intrinsics=CENTRED, background=background)
    np.testing.assert_array_equal(recording.depth(0), expected[0])
    np.testing.assert_array_equal(recording.background, expected[0])


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Replace trackers by fast fakes; return their arguments."""
    arguments: dict[str, Any] = {}
    monkeypatch.setattr(tracks, "tracker_of", lambda *_: FakeTracker(**arguments))
    monkeypatch.setattr(TrackerRecipe, "build", lambda *_: FakeTracker(**arguments))
    return arguments


@pytest.mark.usefixtures("fake")
@pytest.mark.parametrize("command", ["info", "track", "batch"])
def test_the_command_prints_a_concern_as_one_line(
    tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = replace(KINECT, cx=79.5, cy=59.5)
    save_recording(tmp_path / "take.npz", depth=frames(), camera=wrong, timestamps=np.arange(4) / 30)
    words = ["--workers", 1] if command == "batch" else []
    verb = "info" if command == "info" else "track"
    assert run(verb, tmp_path / "take.npz", "--output", tmp_path / f"{command}.png", *words) == 0
    said = capsys.readouterr()
    text = said.out if command == "info" else said.err
    assert "of the image away from its centre" in text and "see docs/troubleshooting.md" in text
    assert "the defaults fit" not in said.out
    if command == "batch":
        rows = [json.loads(line) for line in (tmp_path / "batch.png" / MANIFEST_FILE).read_text().splitlines()[1:]]
        assert "away from its centre" in rows[0]["warnings"][0] and rows[0]["tracked"] == 4


@pytest.mark.parametrize("workers", [[], ["--workers", 1]])
def test_a_command_that_tracks_no_person_warns_and_exits_with_3(
    tmp_path: Path, fake: dict[str, Any], capsys: pytest.CaptureFixture[str], workers: list[Any]
) -> None:
    fake["state"] = EMPTY
    save_recording(tmp_path / "take.npz", depth=frames(), camera=KINECT, timestamps=np.arange(4) / 30)
    assert run("track", tmp_path / "take.npz", "--output", tmp_path / "run", *workers) == 3
    said = capsys.readouterr().err
    assert "depthmocap: warning: take: no person was tracked" in said and "--segment" in said


def test_the_library_warns_as_the_command_prints(fake: dict[str, Any]) -> None:
    fake["state"] = EMPTY
    with pytest.warns(PlausibilityWarning) as found:
        depthmocap.track(frames(), intrinsics=(*CENTRED[:2], 79.5, 59.5), frame_rate=30)
    texts = [str(warning.message) for warning in found]
    assert ["away from its centre" in texts[0], "no person was tracked" in texts[1]] == [True, True]
    assert all(warning.filename == __file__ for warning in found)
    with warnings.catch_warnings():
        warnings.simplefilter("error", depthmocap.PlausibilityWarning)
        with pytest.raises(depthmocap.PlausibilityWarning):
            depthmocap.track(frames(), intrinsics=CENTRED, frame_rate=30)


@pytest.mark.parametrize(("confidence", "doubted"), [(0.05, True), (0.35, True), (0.7, False)])
def test_a_track_of_low_confidence_is_doubted(fake: dict[str, Any], confidence: float, doubted: bool) -> None:
    fake["confidence"] = confidence
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        depthmocap.track(frames(), intrinsics=CENTRED, frame_rate=30)
    assert any(f"the mean confidence is {confidence:.2f}" in str(w.message) for w in found) == doubted


@pytest.mark.parametrize(("stature", "doubted"), [(0.88, True), (1.1, False), (1.9, False), (3.4, True)])
def test_a_body_that_is_no_person_s_size_is_doubted(tmp_path: Path, stature: float, doubted: bool) -> None:
    summary = RunSummary("take", tmp_path, 9, 9, {}, 1.0, {"tracked": 9, "lost": 0, "empty": 0}, confidence=0.7)
    assert bool(found := track_warnings(summary, [1.7, stature])) == doubted
    assert not doubted or f"a fitted body is {stature:.2f} m tall; check --intrinsics" in str(found[0])


def test_the_rows_before_a_frame_that_cannot_be_read_are_a_track(tmp_path: Path, fake: dict[str, Any]) -> None:
    fake["broken"] = 3
    save_recording(tmp_path / "take.npz", depth=frames(), camera=KINECT, timestamps=np.arange(4) / 30)
    assert run("track", tmp_path / "take.npz", "--output", tmp_path / "run") == 1
    (stored,) = depthmocap.Track.load(tmp_path / "run")
    assert len(stored) == 3
    assert stored.export(tmp_path / "motion.csv").stat().st_size > 0


def test_a_closed_pipe_or_terminal_takes_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w") as broken, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", broken)
        with standard_streams():
            for _ in range(3):
                print("x" * 100_000, flush=True)
        broken.write("nothing is left to fail")


def test_a_working_folder_that_was_removed_stops_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert program()
