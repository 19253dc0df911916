"""Pictures of a track: left is left, all views agree, films can be read back."""

from dataclasses import replace

import numpy as np
import pytest

from tests.chromium import browser
from tests.run_helpers import track_of
from tests.sensing_scenes import KINECT, neutral, person_alone, standing
from toolkit.body import skeleton
from toolkit.body.skeleton import POSE_NAMES
from toolkit.io.errors import UsageError
from toolkit.io.files import sha256_of
from toolkit.output.rendering import encoders, style
from toolkit.output.rendering.film import contact_sheet, render_people, render_run, write_film
from toolkit.output.rendering.overlay import Ground
from toolkit.output.rendering.painter import FramePainter, RenderSettings
from toolkit.output.rendering.style import KEY_LIGHT, LIGHTS, mesh_colors
from toolkit.output.rendering.views import outside_view_of
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import level_rotation
from toolkit.simulation.mesh import Mesh
from toolkit.simulation.raycast import render_depth
from toolkit.simulation.shading import draw, visible
from toolkit.tracks import EMPTY, LOST, RunInfo
from toolkit.tracks.runs import Person, PersonSummary, save_people

LEVEL = level_rotation(np.array([0.0, -1.0, 0.0]))
HEIGHT = 1.2


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    """Return a recording of four frames, one of them empty, and its true track."""
    body = neutral()[0]
    places = [-0.1, 0.0, None, 0.1]
    depth = [np.zeros(KINECT.shape, np.uint16) if x is None else person_alone(KINECT, x, 2.8) for x in places]
    path = tmp_path_factory.mktemp("take") / "take.npz"
    save_recording(path, depth=depth, camera=KINECT, timestamps=np.arange(4) / 20, up_camera=(0, -1, 0))
    poses = np.stack([standing(x or 0.0, 2.8, HEIGHT) for x in places])
    return open_recording(path), rows_of(poses), body


def rows_of(poses, state=(0, LOST, EMPTY, 0)):
    return track_of(neutral()[0].joint_positions(poses) @ LEVEL, poses, np.arange(len(poses)) / 20, np.array(state))


def people_of(track, body):
    return (Person("take", track, body, LEVEL),)


def share_of(image, color, tolerance=40):
    """Return the mean column of the pixels with the hue of `color`, as a fraction of the width, and their number."""
    pixels = image.astype(float)
    bright = pixels.max(axis=2) > 60
    normed = pixels / np.maximum(pixels.max(axis=2, keepdims=True), 1)
    near = bright & (np.abs(normed - np.array(color) / max(color)).max(axis=2) < tolerance / 255)
    return np.nonzero(near)[1].mean() / image.shape[1], near.sum()


def test_the_left_of_a_person_who_faces_the_camera_is_at_the_right_of_the_picture(take):
    recording, track, body = take
    for panel in ("depth", "body"):
        settings = RenderSettings(panels=(panel,), extrema=0)
        image = FramePainter(people_of(track, body), recording, settings=settings).paint(1, recording.depth(1))
        image = image[40:-40]  # without the legend
        left, lefts = share_of(image, style.LEFT)
        right, rights = share_of(image, style.RIGHT)
        assert lefts > 300 and rights > 300
        assert left > 0.5 > right


def test_a_drawn_body_lies_on_the_depth_image(take, monkeypatch):
    recording, track, body = take
    monkeypatch.setattr(Ground, "draw_floor", lambda *arguments: None)

    def painted(track):
        painter = FramePainter(people_of(track, body), recording, settings=RenderSettings(panels=("body",)))
        return painter.paint(0, recording.depth(0))[32:-32].astype(int)

    nobody = painted(rows_of(np.asarray(track.pose), state=[EMPTY] * 4))
    drawn = (np.abs(painted(track) - nobody).max(axis=2) > 20)[40:]
    measured = (np.abs(nobody - np.array(style.PAPER) // 2).max(axis=2) > 5)[40:]
    assert (drawn & measured).sum() / (drawn | measured).sum() > 0.85


def test_several_people_have_a_colour_each_and_hide_each_other(tmp_path):
    body = neutral()[0]
    places = ((-0.4, 2.6), (0.5, 2.8), (0.5, 3.4))
    people = [
        Person(f"person_{k:02d}", rows_of(standing(x, z, HEIGHT)[None], (0,)), body, LEVEL)
        for k, (x, z) in enumerate(places, start=1)
    ]
    depth = np.min([np.where((d := person_alone(KINECT, x, z)) > 0, d, 65535) for x, z in places], axis=0)
    path = tmp_path / "take.npz"
    image = np.where(depth < 65535, depth, 0).astype(np.uint16)
    save_recording(path, depth=[image], camera=KINECT, timestamps=np.zeros(1), up_camera=(0, -1, 0))
    recording = open_recording(path)
    image = FramePainter(people, recording, settings=RenderSettings(panels=("body",))).paint(0, image)
    image = image[40:-40]
    places = [share_of(image, style.person_color(k)) for k in range(3)]
    assert places[0][0] < 0.5 < places[1][0]
    assert places[0][1] > 1000 and places[1][1] > 1000
    assert places[2][1] < 0.3 * places[1][1], "the third one stands behind the second one"


def test_a_run_of_several_people_becomes_one_film(take, tmp_path):
    recording, track, body = take
    run = tmp_path / "run"
    for name in ("person_01", "person_02"):
        save_run(run / name, recording, track, body)
    save_people(run, [PersonSummary(k, f"person_{k:02d}", 0, 3, 1.7, 1.0, 0.0, 0.0) for k in (1, 2)])
    assert render_run(run, tmp_path / "film.webm").stat().st_size > 1000


@pytest.mark.parametrize("panel", ["depth", "body", "side", "plan"])
def test_a_film_shows_the_feet_that_carry_and_the_ground_under_them(take, panel):
    recording, track, body = take
    pictures = {}
    for carry in (False, True):
        contact = np.zeros((4, 2), dtype=bool)
        contact[1], contact[3] = (carry, False), True  # frame 3 brings both feet into the legend
        person = replace(people_of(track, body)[0], track=replace(track, contact=contact))
        painter = FramePainter([person], recording, settings=RenderSettings(panels=(panel,), extrema=0))
        pictures[carry] = painter.paint(1, recording.depth(1))[40:-40]
    new = np.abs(pictures[True].astype(int) - pictures[False]).max(axis=2) > 30
    where = np.argwhere(new).mean(axis=0) / new.shape
    assert 20 < new.sum() < 0.02 * new.size
    if panel != "plan":
        assert where[0] > 0.75, "a sole is low in the picture"
    if panel != "side":
        assert where[1] > 0.5, "who faces the camera has the left foot at the right of the picture"
    floor = np.zeros_like(pictures[True])
    painter._ground.draw_floor(floor, painter._views[panel].project)
    assert floor.any(axis=2).sum() > 300


def test_a_drawn_mesh_has_the_depth_that_ray_casting_gives():
    body = neutral()[0]
    pose = standing(0.2, 2.5, HEIGHT)
    pose[POSE_NAMES.index("left_elbow_ry")] = -1.2
    image = np.zeros((*KINECT.shape, 3), np.uint8)
    mesh = Mesh(body.vertex_positions(pose) @ LEVEL, body.faces, mesh_colors([body])[0])
    draw(image, [mesh], KINECT, LIGHTS, KEY_LIGHT)
    inverse, expected = visible(mesh, KINECT)[1], render_depth(body, pose, KINECT, LEVEL)
    drawn, hit = inverse > 0, expected > 0
    assert (drawn & hit).sum() / (drawn | hit).sum() > 0.99
    assert np.quantile(np.abs(1 / inverse[drawn & hit] - expected[drawn & hit]), 0.999) < 0.002
    assert (image[drawn].max(axis=1) > 0).all()
    assert not image[~drawn].any()


def test_the_side_view_has_the_camera_at_the_left_and_up_above():
    joints = np.array([[0.0, 0.0, -3.0], [0.0, 1.0, -3.0], [0.0, 0.0, -2.5], [0.4, 0.0, -3.0]])
    view = outside_view_of(joints, (360, 480), "side")
    origin, above, nearer, left = view.camera.project(view.to_camera(joints))
    assert above[1] < origin[1]
    assert nearer[0] < origin[0]
    assert view.to_camera(joints)[3, 2] < view.to_camera(joints)[0, 2], "the subject's left is nearer"
    assert abs(left[0] - origin[0]) < 20


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".avi"])
def test_a_film_can_be_read_back(take, tmp_path, suffix):
    import cv2

    if suffix == ".mp4":
        pytest.importorskip("av")

    seen = []
    path = render_people(
        *arranged(take), tmp_path / f"film{suffix}", progress=lambda done, total: seen.append((done, total))
    )
    film = cv2.VideoCapture(str(path))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 4
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(20.0)
    assert (film.get(cv2.CAP_PROP_FRAME_WIDTH), film.get(cv2.CAP_PROP_FRAME_HEIGHT)) == (1640, 544)
    assert film.read()[1].mean() > 10
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def arranged(take):
    recording, track, body = take
    return people_of(track, body), recording


def test_a_contact_sheet_and_single_pictures_are_png(take, tmp_path):
    import cv2

    sheet = cv2.imread(str(render_people(*arranged(take), tmp_path / "sheet.png")))
    assert sheet.shape == (2 * 340 + 6, 2 * (270 + 270 + 224) + 6, 3)
    folder = render_people(*arranged(take), tmp_path / "pictures", frames=range(1, 4, 2))
    assert sorted(p.name for p in folder.iterdir()) == ["00001.png", "00003.png"]


def save_run(run, recording, track, body):
    run.mkdir(parents=True)
    track.save(run)
    RunInfo(
        recording=str(recording.path), recording_sha256=sha256_of(recording.path), reader_options={},
        body_fingerprint=skeleton.fingerprint(), shape=list(body.shape), scale=1.0, database="",
        level_rotation=LEVEL.ravel().tolist(), sensing={"median": False}, version="0",
    ).save(run)  # fmt: skip


def test_a_run_is_drawn_from_its_folder_without_a_word_of_the_encoder(take, tmp_path, capfd, monkeypatch):
    recording, track, body = take
    run = tmp_path / "run"
    save_run(run, recording, track, body)
    monkeypatch.setattr("toolkit.output.rendering.encoders.has_av", lambda: False)
    assert render_run(run, tmp_path / "film.webm").stat().st_size > 1000
    assert capfd.readouterr().err == ""


def test_an_unknown_output_or_range_is_an_error(take, tmp_path):
    with pytest.raises(UsageError, match=r"\*.mp4"):
        render_people(*arranged(take), tmp_path / "film.gif")
    for frames in (range(0), range(2, 9), range(-1, 2)):
        with pytest.raises(UsageError, match="4 frames"):
            render_people(*arranged(take), tmp_path / "film.mp4", frames=frames)
    with pytest.raises(UsageError):
        write_film(tmp_path / "film.txt", 25, iter([]))
    with pytest.raises(UsageError, match="at least one"):
        contact_sheet([])
    assert list(tmp_path.iterdir()) == []


def test_a_browser_plays_the_films(take, tmp_path, monkeypatch):
    films = ["vp8.webm"]
    with monkeypatch.context() as patch:
        patch.setattr(encoders, "has_av", lambda: False)
        render_people(*arranged(take), tmp_path / films[0])
    if encoders.has_av():
        films += ["h264.mp4", "vp9.webm"]
    for name in films[1:]:
        render_people(*arranged(take), tmp_path / name)
    with browser() as page:
        for name in films:
            (tmp_path / "page.html").write_text(f"<video muted src='{name}'></video>")
            page.open((tmp_path / "page.html").as_uri())
            width, height, seconds, error = page.evaluate(
                "new Promise((done) => { const v = document.querySelector('video');"
                "const say = () => done([v.videoWidth, v.videoHeight, v.currentTime, v.error && v.error.message]);"
                "v.onended = say; v.onerror = say; v.play().catch(say); })"
            )
            assert (width, height, error) == (1640, 544, None), name
            assert seconds == pytest.approx(0.2, abs=0.06), name
