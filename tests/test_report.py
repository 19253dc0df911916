"""Report page: complete, self-contained, names are text, and a browser draws and plays it."""

import base64
import json
import re
import shutil
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.chromium import Page, browser
from tests.run_helpers import TURN, write_people, write_run
from tests.run_helpers import run as run_command
from tests.sensing_scenes import KINECT, neutral, standing
from toolkit.io import html
from toolkit.io.errors import TrackError, UsageError
from toolkit.io.files import sha256_of
from toolkit.output.report.clouds import STORED_UNIT, gather_clouds
from toolkit.output.report.page import write_report
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.simulation.raycast import render_depth
from toolkit.tracks import RunInfo, Track

FRAMES, RATE, WALL, HEIGHT = 12, 10.0, 3.6, 1.2
NODE = Path(__file__).parents[1] / "scripts" / "node"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a run whose recording, with truth and a wall behind the person, has a tag in its name."""
    folder = tmp_path_factory.mktemp("report")
    body = neutral()[0]
    poses = np.stack([standing(0.04 * i, 2.5, HEIGHT) for i in range(FRAMES)])
    depth = []
    for pose in poses:
        person = np.rint(1000 * render_depth(body, pose, KINECT, TURN)).astype(np.uint16)
        depth.append(np.where(person > 0, person, np.uint16(1000 * WALL)))
    path = folder / "<b>take.npz"
    joints = (body.joint_positions(poses) @ TURN).astype(np.float32)
    save_recording(
        path, depth=depth, camera=KINECT, timestamps=np.arange(FRAMES) / RATE, up_camera=(0, -1, 0),
        background=np.full(KINECT.shape, 1000 * WALL, np.uint16), joints=joints + np.float32(0.02),
    )  # fmt: skip
    write_run(folder / "run", poses, rate=RATE, recording=str(path))
    info = RunInfo.load(folder / "run")
    replace(info, recording_sha256=sha256_of(path), shape=[0.0], scale=1.0).save(folder / "run")
    return folder / "run"


@pytest.fixture(scope="module")
def page_file(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    hostile = tmp_path_factory.mktemp("names") / "<script>alert(1)<!--"
    shutil.copytree(run, hostile)
    return write_report([hostile, run], tmp_path_factory.mktemp("page") / "report.html")


def block_of(page: Path, key: str) -> bytes:
    found = re.search(rf'<script type="text/plain" id="{key}">(.*?)</script>', page.read_text(), re.S)
    assert found is not None
    return zlib.decompress(base64.b64decode(found[1]))


def data_of(page: Path) -> list[dict]:
    return json.loads(block_of(page, "data"))["runs"]


def test_the_page_contains_each_block_that_it_names_and_loads_nothing(page_file: Path) -> None:
    text = page_file.read_text()
    for run in data_of(page_file):
        for key in ("glb", "film", "poster", "points", "room"):
            assert block_of(page_file, run[key])
    outside = re.sub(r"<script[^>]*>.*?</script>", "", text, flags=re.S)
    assert not re.search(r'(?:src|href)\s*=\s*["\'](?!data:)', outside)
    assert "default-src 'none'" in text


def test_a_name_with_a_tag_stays_text(page_file: Path) -> None:
    text = page_file.read_text()
    assert "<script>alert" not in text and "<b>take" not in text
    assert "&lt;script&gt;alert(1)&lt;!--" in text
    run = data_of(page_file)[0]
    assert run["name"] == "<script>alert(1)<!--"
    assert ["recording", "<b>take.npz"] in run["facts"]


def test_the_numbers_of_the_page_are_those_of_the_track(run: Path, page_file: Path) -> None:
    shown, track = data_of(page_file)[1], Track.load(run)
    np.testing.assert_allclose(shown["times"], track.timestamps - track.timestamps[0], atol=1e-4)
    (person,) = shown["people"]
    np.testing.assert_allclose(np.array(person["joints"]).reshape(FRAMES, 20, 3) / 1000, track.joints @ TURN, atol=6e-4)
    assert person["observed"] == ["".join("01"[int(seen)] for seen in row) for row in track.observed]
    error = next(plot for plot in shown["plots"] if plot["title"].startswith("error"))
    np.testing.assert_allclose(error["series"][0]["values"], 1000 * 0.02 * np.sqrt(3), atol=5)


def test_without_its_recording_a_run_has_no_film_and_the_page_has_the_reason(tmp_path: Path, run: Path) -> None:
    lost = write_run(tmp_path / "lost", Track.load(run).pose)
    shown = data_of(write_report([lost], tmp_path / "page.html"))[0]
    assert shown["film"] is None and "is gone" in shown["note"]
    assert len(shown["plots"]) == 2
    recording = RunInfo.load(run).recording
    with pytest.raises(UsageError, match="2 runs"):
        write_report([lost, run], tmp_path / "page.html", recording=recording)
    with pytest.raises(UsageError, match=r"\*\.html"):
        write_report([run], tmp_path / "page.pdf")
    with pytest.raises(TrackError):
        write_report([tmp_path / "absent"], tmp_path / "page.html")


def test_points_near_the_person_and_the_room_lie_where_they_were_measured(run: Path) -> None:
    info, track = RunInfo.load(run), Track.load(run)
    clouds = gather_clouds(open_recording(info.recording), track.joints.astype(float), range(2, 6))
    assert len(clouds.counts) == 4 and clouds.counts.sum() == len(clouds.points) and (clouds.counts > 100).all()
    body, start = info.body(), 0
    for count, i in zip(clouds.counts, range(2, 6), strict=True):
        points = in_space(clouds.points[start : start + count]) @ TURN
        distance = np.linalg.norm(points[:, None] - body.vertex_positions(track.pose[i])[None], axis=2).min(axis=1)
        assert np.median(distance) < 0.02, "most measured points lie on the body that was drawn"
        start += count
    np.testing.assert_allclose(in_space(clouds.room)[:, 2], WALL, atol=STORED_UNIT)


def in_space(points: np.ndarray) -> np.ndarray:
    """Return columns, rows and depths (N, 3) as points in the camera frame, metres."""
    z = points[:, 2] * STORED_UNIT
    return np.column_stack([(points[:, 0] - KINECT.cx) * z / KINECT.fx, (points[:, 1] - KINECT.cy) * z / KINECT.fy, z])


def test_several_people_stand_on_one_page(tmp_path: Path, run: Path) -> None:
    people = write_people(tmp_path / "people", Track.load(run).pose)
    shown = data_of(write_report([people], tmp_path / "page.html"))[0]
    assert [person["name"] for person in shown["people"]] == ["person_01", "person_02"]
    assert shown["people"][1]["joints"][0] is None
    assert shown["people"][0]["color"] != shown["people"][1]["color"]


def test_the_command_writes_the_page_and_prints_its_path(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command("report", run, "--output", tmp_path / "page.html", "--from", "2", "--to", "5") == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "page.html")
    assert len(data_of(tmp_path / "page.html")[0]["times"]) == 3


def colours(page: Page, tmp_path: Path) -> int:
    """Return the number of colours of the scene."""
    picture = cv2.imread(str(page.screenshot(tmp_path / "shot.png")))
    x, y, width, height = map(
        int,
        page.evaluate(
            "(() => { const b = document.getElementById('scene').getBoundingClientRect();"
            " return [b.x, b.y, b.width, b.height]; })()"
        ),
    )
    part = picture[y : y + height, x : x + width].reshape(-1, 3)
    return len(np.unique(part // 8, axis=0))


def test_a_browser_draws_and_plays_the_page_and_no_request_leaves(page_file: Path, tmp_path: Path) -> None:
    with browser() as page:
        page.open(page_file.as_uri())
        page.wait_for("document.body.dataset.ready === 'yes'")
        assert page.evaluate("document.body.dataset.drawn") == "yes"
        assert page.evaluate("document.querySelector('h1').textContent").startswith("depthmocap: <script>alert(1)<!--")
        page.wait_for("document.getElementById('film').readyState >= 2")
        assert colours(page, tmp_path) > 60
        assert page.evaluate("document.getElementById('film').poster").startswith("blob:")
        assert not page.evaluate("document.querySelector('details').open")
        page.evaluate("document.querySelector('[data-shows=names]').click()")
        page.wait_for(
            "[...document.querySelectorAll('#labels span')].some(s => !s.hidden && s.textContent === 'left hand')"
        )
        assert page.evaluate("document.querySelectorAll('#plots figure').length") == 3
        page.evaluate("document.getElementById('play').click()")
        page.wait_for("document.getElementById('film').currentTime > 0.3")
        page.wait_for(f"document.body.dataset.frame === '{FRAMES - 1}'")
        page.evaluate(
            "(() => { const s = document.getElementById('slider'); s.value = 3; s.oninput({ target: s }); })()"
        )
        page.wait_for("document.body.dataset.frame === '3'")
        page.wait_for(f"Math.abs(document.getElementById('film').currentTime - 3.5 / {RATE}) < 0.05")
        page.evaluate("(() => { const s = document.getElementById('run'); s.value = 1; s.onchange(); })()")
        page.wait_for("document.body.dataset.ready === 'yes' && document.body.dataset.frame === '0'")
        assert page.errors == []
        assert [url for url in page.requests if not url.startswith(("blob:", "data:"))] == [page_file.as_uri()]


def test_the_film_has_its_first_picture_before_it_plays(page_file: Path) -> None:
    shown = data_of(page_file)[0]
    poster = cv2.imdecode(np.frombuffer(block_of(page_file, shown["poster"]), np.uint8), cv2.IMREAD_COLOR)
    assert poster.std() > 20, "it is not black"


def test_on_a_narrow_screen_the_page_is_as_wide_as_the_screen_and_keys_work_after_a_checkbox(page_file: Path) -> None:
    with browser() as page:
        page.resize(400, 800)
        page.open(page_file.as_uri())
        page.wait_for("document.body.dataset.ready === 'yes'")
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        page.evaluate("document.querySelector('[data-shows=names]').click()")
        page.evaluate(
            "document.querySelector('[data-shows=names]').dispatchEvent("
            "new KeyboardEvent('keydown', { key: 'ArrowRight', bubbles: true }))"
        )
        page.wait_for("document.body.dataset.frame === '1'")


def test_wide_tables_of_other_pages_scroll_on_a_narrow_screen(tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text(html.page("page", [html.table(["column"] * 20, [["12345"] * 20])]))
    with browser() as page:
        page.resize(400, 800)
        page.open((tmp_path / "page.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 400


def test_the_viewer_in_the_package_is_what_its_script_builds(tmp_path: Path) -> None:
    if not (shutil.which("npm") and (NODE / "node_modules" / "esbuild").is_dir()):
        pytest.skip("npm or its packages are absent; scripts/install_node_packages.sh installs them")
    built = tmp_path / "viewer.js"
    command = ["npm", "--prefix", str(NODE), "run", "build", "--silent", "--", f"--outfile={built}"]
    subprocess.run(command, check=True, capture_output=True)
    shipped = Path(__file__).parents[1] / "toolkit" / "output" / "report" / "assets" / "viewer.js"
    assert built.read_bytes() == shipped.read_bytes()
    assert b"</script" not in shipped.read_bytes().lower()
