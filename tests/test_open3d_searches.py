"""Open3D: searches equal to the compiled ones to the bit, and pictures."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.database_helpers import small_database
from tests.run_helpers import run, write_run
from tests.sensing_scenes import KINECT, neutral, standing
from tests.support.solo import Solo
from tests.support.subjects import LEVEL, camera_for, draw, moving_poses, write_recording
from toolkit.app.config import load_settings
from toolkit.body.shape import load_body
from toolkit.fitting.open3d_scene import Open3DScene
from toolkit.fitting.placed import Placer
from toolkit.fitting.scene import Scene
from toolkit.io.errors import SettingsError
from toolkit.io.files import sha256_of
from toolkit.output.rendering.open3d_pictures import PicturePainter
from toolkit.output.rendering.painter import RenderSettings
from toolkit.output.rendering.views import OutsideView
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import DEFAULT_UP, level_rotation
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.kd_tree import KdTree
from toolkit.simulation.mesh import Mesh
from toolkit.simulation.raycast import render_depth
from toolkit.simulation.shading import visible
from toolkit.trackers.baak2013 import Baak2013Tracker
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracks import RunInfo

BODY = load_body("neutral")
CAMERA = camera_for(2500)
GRID = {"fitting.correspondences": "grid", "lookup.search": "scan"}
OPEN3D = {"fitting.correspondences": "open3d", "lookup.search": "open3d"}


@pytest.mark.parametrize("reach", [0.03, 10.0])
@pytest.mark.parametrize("seed", range(3))
def test_correspondences_are_the_same(seed: int, reach: float) -> None:
    rng = np.random.default_rng(seed)
    poses = moving_poses(3, rng)
    cloud = Cloud.from_depth(draw(BODY, poses[seed], CAMERA, rng), CAMERA, LEVEL)
    withheld = rng.random(18) < 0.2
    extrema = cloud.points[::300].astype(np.float64)
    grid, tree = (kind(cloud, extrema, 300, withheld=withheld) for kind in (Scene, Open3DScene))
    placed = Placer(BODY, CAMERA, LEVEL).place(BODY, poses[0] + 0.02)
    points, wanted = placed.chosen_points.copy(), rng.random(len(placed.chosen_points)) < 0.8
    points[:3, 2] = 0.01, -1.0, 90.0
    for count in (1, 5):
        one, other = np.full((2, *points.shape), np.nan)
        grid.medians(points, wanted, reach, count, one)
        tree.medians(points, wanted, reach, count, other)
        known = ~np.isnan(one[:, 0])
        np.testing.assert_array_equal(known, ~np.isnan(other[:, 0]))
        np.testing.assert_array_equal(one[known], other[known])
        assert 10 < known.sum() <= wanted.sum()
    for one, other in zip(*(scene.nearest_drawn(placed, scene.samples, reach) for scene in (grid, tree)), strict=True):
        known = np.isfinite(one.reshape(len(one), -1)).all(axis=1) & (
            grid.nearest_drawn(placed, grid.samples, reach)[1] >= 0
        )
        np.testing.assert_array_equal(one[known], other[known])


def test_the_kd_tree_is_exact_and_answers_for_no_query() -> None:
    rng = np.random.default_rng(0)
    points, queries = rng.normal(size=(400, 4)), rng.normal(size=(20, 4))
    rows, squared = KdTree(points).query(queries, 3)
    gaps = ((queries[:, None] - points) ** 2).sum(axis=2)
    np.testing.assert_array_equal(rows, np.argsort(gaps, axis=1)[:, :3])
    np.testing.assert_allclose(squared, np.sort(gaps, axis=1)[:, :3])
    assert KdTree(points).query(queries[:0], 3)[0].shape == (0, 3)


@pytest.mark.parametrize(("config", "tracker"), [("baak2013", Baak2013Tracker), ("hybrid", HybridTracker)])
def test_tracks_are_the_same_to_the_bit(tmp_path, config: str, tracker: type[HybridTracker]) -> None:
    path = tmp_path / "rendered.npz"
    write_recording(path, 2500, 6)
    recording, database = open_recording(path), small_database()
    hypotheses = {"hypotheses": ["local", "extrema"]}
    steps = []
    for searches in (GRID, OPEN3D):
        solo = Solo(tracker(database, load_settings(HybridSettings, config, {**searches, **hypotheses})), recording)
        steps.append([solo.step(frame.depth_mm, frame.timestamp) for frame in recording.stream()])
    for one, other in zip(*steps, strict=True):
        np.testing.assert_array_equal(one.pose, other.pose)
        np.testing.assert_array_equal(one.confidence, other.confidence)
        assert one.source == other.source


def test_the_papers_tracker_searches_by_open3d_and_the_hybrid_one_by_compiled_code() -> None:
    for config, kind, search in (("baak2013", Open3DScene, "Open3DSearch"), ("hybrid", Scene, "ScanSearch")):
        settings = load_settings(HybridSettings, config)
        tracker = {"baak2013": Baak2013Tracker, "hybrid": HybridTracker}[config](small_database(), settings)
        assert tracker.observer.scene is kind
        assert type(tracker._poses._search).__name__ == search


ROTATION = level_rotation(np.array(DEFAULT_UP))
HEIGHT = 1.2


def person() -> tuple[np.ndarray, np.ndarray]:
    """Return vertices, level frame, and faces of a person before the camera."""
    body = neutral()[0]
    return body.vertex_positions(standing(0.2, 2.6, HEIGHT)), body.faces


def painted(ground: float) -> np.ndarray:
    vertices, faces = person()
    view = OutsideView(KINECT, np.zeros(3), ROTATION)
    return PicturePainter(view, ground).paint([Mesh(vertices @ ROTATION, faces, np.full(vertices.shape, 90.0))])


def test_silhouettes_are_those_of_the_present_renderer() -> None:
    vertices, faces = person()
    ours = visible(Mesh(vertices @ ROTATION, faces), KINECT)[2] >= 0
    seen = painted(np.nan).min(axis=2) < 172  # half way from the body, 90, to the paper
    assert np.count_nonzero(seen & ours) > 0.98 * np.count_nonzero(seen | ours)


def test_a_body_throws_a_soft_shadow_on_the_ground_and_on_nothing_else() -> None:
    vertices, _ = person()
    shaded = (painted(float(vertices[:, 1].min())) != painted(np.nan)).any(axis=2)
    rows, _ = np.nonzero(shaded)
    feet = KINECT.project(vertices @ ROTATION)[:, 1].max()
    assert shaded.sum() > 300 and rows.min() > 0.5 * feet
    assert len(np.unique(painted(float(vertices[:, 1].min()))[shaded])) > 20, "the border of the shadow is soft"


def test_the_command_draws_with_either_engine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses = np.stack([standing(x, 2.6, HEIGHT) for x in (0.0, 0.1)])
    depth = [np.rint(1000 * render_depth(neutral()[0], pose, KINECT, ROTATION)).astype(np.uint16) for pose in poses]
    save_recording(tmp_path / "take.npz", depth=depth, camera=KINECT, timestamps=[0.0, 0.1], up_camera=DEFAULT_UP)
    folder = write_run(tmp_path / "run", poses, recording=str(tmp_path / "take.npz"))
    info = RunInfo.load(folder)
    replace(info, recording_sha256=sha256_of(tmp_path / "take.npz")).save(folder)
    for engine, light in (("toolkit", False), ("open3d", True)):
        assert run("render", folder, "--engine", engine, "--panels", "body", "--output", tmp_path / engine) == 0
        picture = cv2.imread(str(tmp_path / engine / "00001.png"))
        assert (np.median(picture) > 200) == light
    assert run("render", folder, "--engine", "other", "--output", tmp_path / "x.png") == 2
    assert "toolkit or open3d" in capsys.readouterr().err
    with pytest.raises(SettingsError):
        RenderSettings(engine="other")
