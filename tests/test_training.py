"""Simulated training images of both networks, and export in whole numbers."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from tests.database_helpers import small_database
from toolkit.sensing.exact_network import ExactNetwork, write_digest
from training.joint_crops import PIXEL, SIZE, UNOBSERVED, VISIBLE, draw_crops
from training.room_images import FOCAL, FURNITURE, HEIGHT, WIDTH, draw_images
from training.sensor import lossy


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    """Return the canonical poses (N, P)."""
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


def test_room_images_show_people_where_their_heads_are(poses: np.ndarray) -> None:
    images = draw_images(poses, 12, 3)
    near, people = [], 0
    for depth, owner, heads in zip(*images.values(), strict=True):
        people += len(np.unique(owner[owner >= 0]))
        for number, (x, y, z) in enumerate(heads):
            if z < 0.3:
                continue
            u, v = round(FOCAL * x / z + 0.5 * (WIDTH - 1)), round(FOCAL * y / z + 0.5 * (HEIGHT - 1))
            if 0 <= u < WIDTH and 0 <= v < HEIGHT and owner[v, u] == number and depth[v, u]:
                near.append(z - 0.001 * depth[v, u])
    assert people > 8 and len(near) > 3 and 0.0 < np.median(near) < 0.2
    assert (images["depth"] > 0).any(axis=(1, 2)).all() and (images["owner"] == FURNITURE).any()


def test_room_images_depend_on_the_seed_alone(poses: np.ndarray) -> None:
    first, again, other = draw_images(poses, 2, 1), draw_images(poses, 2, 1), draw_images(poses, 2, 2)
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert not np.array_equal(first["depth"], other["depth"])


def test_a_sensor_loses_glass_black_grazing_and_far_surfaces() -> None:
    flat = np.full((20, 200), 1.0 / 2.5)
    share = {}
    for name, cosine, reflectance, inverse in (
        ("plain", 1.0, 0.6, flat), ("glass", 1.0, 0.0, flat), ("black", 1.0, 0.04, flat), ("grazing", 0.02, 0.6, flat),
        ("far", 1.0, 0.6, flat * 0.2),
    ):  # fmt: skip
        surfaces = inverse, np.full(flat.shape, cosine), np.full(flat.shape, reflectance)
        share[name] = np.mean([(lossy(*surfaces, 150.0, np.random.default_rng(s)) > 0).mean() for s in range(20)])
    assert share["plain"] > 0.9 and share["glass"] == share["far"] == 0.0
    assert 0.1 < share["black"] < 0.9 and share["grazing"] < 0.5


def test_an_exported_person_network_follows_its_weights(poses: np.ndarray, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    pytest.importorskip("onnx")
    from training.export import ranges_of
    from training.export_people import SHAPE, export
    from training.person_network import PersonNetwork, features
    from training.train_people import batch_of

    images = draw_images(poses, 4, 5)
    torch.manual_seed(0)
    net = PersonNetwork().eval()
    data = tuple(torch.from_numpy(images[name]) for name in ("depth", "owner", "heads"))
    depth, owner, _ = batch_of(data, slice(0, 4), augment=False)
    assert depth.shape[1:] == SHAPE[2:] and owner.shape[1:] == (SHAPE[2] // 2, SHAPE[3] // 2)
    inputs = features(depth)
    largest = export(net, ranges_of(net, [inputs]), tmp_path / "net.onnx")
    assert largest <= 2.0**24
    write_digest(tmp_path / "net.onnx", SHAPE, ("log_odds",))
    exact = ExactNetwork(tmp_path / "net.onnx", SHAPE, ("log_odds",))
    with torch.no_grad():
        expected = net(inputs).numpy()
    found = np.stack([exact.run(np.rint(64 * x[None].numpy()))[0][0] for x in inputs])
    assert np.abs(found - expected).mean() < 0.1 * expected.std()


def test_the_heads_to_learn_peak_at_projected_heads_and_an_occluded_one_is_not_learnt() -> None:
    torch = pytest.importorskip("torch")
    from training.train_people import PADDING, batch_of, peaks_of

    depth, owner = np.full((1, HEIGHT, WIDTH), 4000, np.int16), np.full((1, HEIGHT, WIDTH), FURNITURE, np.int8)
    heads = np.zeros((1, 8, 3), np.float32)
    places = {0: (30, 40, 2.0), 1: (50, 120, 3.0)}  # row, column, metres; the second is behind a cupboard
    for number, (row, column, z) in places.items():
        heads[0, number] = (column - 0.5 * (WIDTH - 1)) * z / FOCAL, (row - 0.5 * (HEIGHT - 1)) * z / FOCAL, z
        depth[0, row - 4 : row + 5, column - 4 : column + 5] = 1000 * z
    owner[0, 26:35, 36:45] = 0
    depth[0, 40:60, 110:130] = 1500
    data = tuple(torch.from_numpy(values) for values in (depth, owner, heads))
    peaks, visible = (values[0].numpy() for values in peaks_of(*batch_of(data, slice(0, 1), augment=False)))
    rows, columns = np.nonzero(peaks == 1)
    expected = {((row + PADDING) // 2, column // 2) for row, column, _ in places.values()}
    assert set(zip(rows.tolist(), columns.tolist(), strict=True)) == expected
    assert 0 < peaks[17, 21] < 1 and peaks[17, 40] < 1e-6
    assert np.argwhere(visible).tolist() == [[17, 20]]


@pytest.mark.parametrize("path", sorted(Path("training").rglob("*.py")), ids=str)
def test_every_script_of_training_finds_what_it_imports(path: Path) -> None:
    try:
        import_module(".".join(path.with_suffix("").parts))
    except ModuleNotFoundError as error:
        if error.name not in ("torch", "onnx"):
            raise
