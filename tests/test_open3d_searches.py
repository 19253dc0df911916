"""Open3D's searches against the compiled ones: correspondences, answers and tracks are equal to the bit."""

import numpy as np
import pytest

from tests.database_helpers import small_database
from tests.support.solo import Solo
from tests.support.subjects import LEVEL, camera_for, draw, moving_poses, write_recording
from toolkit.app.config import load_settings
from toolkit.body.shape import load_body
from toolkit.fitting.open3d_scene import Open3DScene
from toolkit.fitting.placed import Placer
from toolkit.fitting.scene import Scene
from toolkit.recordings.opening import open_recording
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.kd_tree import KdTree
from toolkit.trackers.baak2013 import Baak2013Tracker
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker

BODY = load_body("neutral")
CAMERA = camera_for(2500)
GRID = {"fitting.correspondences": "grid", "lookup.search": "leaves"}
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
    for config, kind, search in (("baak2013", Open3DScene, "Open3DSearch"), ("hybrid", Scene, "LeafSearch")):
        settings = load_settings(HybridSettings, config)
        tracker = {"baak2013": Baak2013Tracker, "hybrid": HybridTracker}[config](small_database(), settings)
        assert tracker.observer.scene is kind
        assert type(tracker._poses._search).__name__ == search
