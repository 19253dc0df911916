"""Simulated training crops of the joint network, and export in whole numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.database_helpers import small_database
from toolkit.sensing.exact_network import ExactNetwork, write_digest
from training.joint_crops import PIXEL, SIZE, UNOBSERVED, VISIBLE, draw_crops


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    """Canonical poses (N, P)."""
    return small_database(200).poses.astype(np.float64)


def test_visible_joints_of_a_crop_lie_behind_its_depth(poses: np.ndarray) -> None:
    crops = draw_crops(poses, 12, 3)
    behind = []
    for depth, (reference, *middle), joints, seen in zip(*crops.values(), strict=True):
        pixels = (joints[:, :2] / joints[:, 2:] - middle) * reference / PIXEL + 0.5 * (SIZE - 1)
        u, v = np.rint(pixels).astype(int).T
        for joint in np.flatnonzero(seen == VISIBLE):
            z = int(depth[v[joint], u[joint]])
            if 0 < z < UNOBSERVED:
                behind.append(joints[joint, 2] - 0.001 * z)
    assert len(behind) > 60 and 0.0 < np.median(behind) < 0.15


def test_crops_depend_on_the_seed_alone_and_held_out_poses_are_others(poses: np.ndarray) -> None:
    first, again, held = draw_crops(poses, 3, 1), draw_crops(poses, 3, 1), draw_crops(poses, 3, 1, held=True)
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert not np.array_equal(first["joints"], held["joints"])


def test_an_exported_convolution_is_exact_and_follows_its_weights(tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    from training.whole_numbers import EXACT, Layer, Values, WholeGraph

    rng = np.random.default_rng(0)
    layer = Layer(rng.normal(size=(4, 3, 3, 3)), rng.normal(size=4))
    graph, path = WholeGraph(), tmp_path / "net.onnx"
    total = graph.sum(layer, Values("in", -6, -256, 256, 3), -5)
    out = graph.rounded(total, -5, 0, 511, 4)
    graph.save(path, "test", ("in", [1, 3, 8, 8]), {"out": (out.name, [1, 4, 8, 8])})
    assert graph.largest <= EXACT
    write_digest(path, (1, 3, 8, 8), ("out",))
    whole = rng.integers(-256, 257, (1, 3, 8, 8)).astype(np.float32)
    (found,) = ExactNetwork(path, (1, 3, 8, 8), ("out",)).run(whole)
    padded = np.pad(whole[0] / 64.0, ((0, 0), (1, 1), (1, 1)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(1, 2))
    expected = np.einsum("ihwkl,oikl->ohw", windows, layer.weights) + layer.bias[:, None, None]
    assert np.array_equal(found, np.rint(found))
    assert np.abs(found[0] / 32.0 - np.clip(expected, 0, 511 / 32)).max() < 1.0 / 32
