"""Candidates for head and hands, their paths and the fork."""

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from tests.landmark_helpers import body_cloud, cloud_of, figure
from tests.poses import pose_at
from toolkit.app.config import load_settings
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import SegmentationError, SettingsError
from toolkit.io.typed_values import TypedReader
from toolkit.kernels.cloud import cloud_graph, geodesic
from toolkit.landmarks.extrema import extrema_of_graph
from toolkit.landmarks.graph import grid_graph
from toolkit.trackers.lopez2011.effectors import GRAPH, Effectors, EffectorSettings, Fork, find_effectors, find_fork
from toolkit.trackers.lopez2011.tracker import ParticleTrackerSettings


def raised_arms(distance: float = 1.6) -> np.ndarray:
    """Return the pose (P,) of a near person who faces the camera, arms raised to the sides."""
    raised = {"left_shoulder_rz": 0.3, "right_shoulder_rz": -0.3, "left_elbow_ry": -0.8, "right_elbow_ry": 0.8}
    return pose_at((0.0, -0.3, -distance), **raised)


def tips(pose: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(skeleton.END_EFFECTORS, load_body().end_effector_positions(pose), strict=True))


def nearest(effectors: Effectors, point: np.ndarray) -> float:
    return float(np.linalg.norm(effectors.points - point, axis=1).min())


SIX = EffectorSettings(6, 0.1, 0.25, 20.0, 75.0)
"""Settings for a cloud with hips, whose cuts at the lower border of the image are candidates too."""


def test_head_and_hands_are_among_the_candidates() -> None:
    pose = raised_arms()
    effectors = find_effectors(body_cloud(load_body(), pose), SIX)
    for name in ("left_hand", "right_hand", "head"):
        assert nearest(effectors, tips(pose)[name]) < 0.1


def test_the_three_of_the_fork_are_right_and_swap_in_a_mirror() -> None:
    pose = raised_arms()
    effectors = find_effectors(body_cloud(load_body(), pose), SIX)
    fork = find_fork(effectors)
    assert fork is not None
    for name, row in (("head", fork.head), ("left_hand", fork.left_hand), ("right_hand", fork.right_hand)):
        assert np.linalg.norm(effectors.points[row] - tips(pose)[name]) < 0.1
    flipped = Effectors(
        effectors.points * [-1, 1, 1],
        effectors.source * [-1, 1, 1],
        tuple(path * [-1, 1, 1] for path in effectors.paths),
    )
    assert find_fork(flipped) == Fork(fork.head, fork.right_hand, fork.left_hand)


def test_a_path_is_a_shortest_one() -> None:
    cloud = cloud_of(figure())
    graph = grid_graph(cloud, GRAPH)
    extrema = extrema_of_graph(graph, cloud.points, 5, 100)
    exact = dijkstra(graph.matrix(), indices=100)
    np.testing.assert_allclose(extrema.from_source * cloud_graph.UNIT, exact, atol=1e-9)
    edges = graph.matrix()
    for node in extrema.nodes:
        out = np.empty(len(graph), dtype=np.int64)
        count = geodesic.path_to_source(
            graph.neighbours, graph.lengths, graph.more, extrema.from_source, int(node), out
        )
        steps = [edges[a, b] for a, b in zip(out[: count - 1], out[1:count], strict=True)]
        assert out[0] == node and out[count - 1] == 100 and min(steps) > 0
        assert sum(steps) == pytest.approx(exact[node])


def test_an_empty_cloud_is_an_error() -> None:
    with pytest.raises(SegmentationError, match="no points"):
        find_effectors(cloud_of(np.zeros((240, 320), dtype=np.float32)))


@pytest.mark.parametrize(
    ("values", "message"),
    [({"count": 0}, "effectors.count is 0"), ({"narrowest": 80.0}, "effectors.narrowest and widest are 80.0 and 60.0")],
)
def test_impossible_settings_are_named(values: dict[str, float], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        TypedReader(SettingsError).read(values, EffectorSettings, "effectors")


def test_lopez2011_takes_the_fork_by_the_cosines_of_neighbouring_prongs() -> None:
    """Lopez-Mendez 2011, 3: relative slopes within [0.5, 0.9]."""
    settings = load_settings(ParticleTrackerSettings, "lopez2011").effectors
    assert settings == EffectorSettings()

    def prongs(*degrees: float) -> Effectors:
        turns = np.radians(degrees)
        ends = 0.4 * np.stack([np.sin(turns), np.cos(turns), np.zeros(len(turns))], axis=1)
        paths = tuple(np.linspace(np.zeros(3), end, 20) for end in ends)
        return Effectors(ends, np.zeros(3), paths)

    for right in range(-80, -5, 5):
        for left in range(5, 80, 5):
            cosines = np.cos(np.radians([right, left]))
            expected = bool(((cosines > 0.4999) & (cosines < 0.9)).all())
            assert (find_fork(prongs(0.0, left, right), settings) is not None) == expected, (right, left)
