"""Compiled loops on depth images against NumPy, SciPy and OpenCV."""

import numpy as np
import pytest
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from tests.sensing_scenes import TOF
from toolkit.kernels.image import components
from toolkit.kernels.image import depth as kernels


def blobs(seed, hole=0.3, shape=(40, 60)):
    """Return a smooth random depth image with holes and steps, uint16 millimetres, and the same with a border of
    zeros.
    """
    rng = np.random.default_rng(seed)
    image = 2000 + 300 * ndimage.gaussian_filter(rng.normal(size=shape), 3) + 400 * (rng.random(shape) < 0.2)
    image[ndimage.gaussian_filter(rng.random(shape), 2) < np.quantile(rng.random(1000), 0.5) * hole + 0.35] = 0
    image[rng.random(shape) < hole / 3] = 0
    image = image.astype(np.uint16)
    return image, np.pad(image, 1)


def whole(image):
    return np.array([1, image.shape[0] + 1, 1, image.shape[1] + 1])


@pytest.mark.parametrize("seed", range(8))
def test_components_are_those_of_the_pixel_graph(seed):
    image, padded = blobs(seed)
    labels, parents = np.zeros(padded.shape, np.int32), np.zeros(padded.size, np.int32)
    count = components.label_components(padded, whole(image), 40.0, 2.8, labels, parents)
    index = np.arange(image.size).reshape(image.shape)
    pairs = []
    for a, b, i, j in (
        (image[:, :-1], image[:, 1:], index[:, :-1], index[:, 1:]),
        (image[:-1], image[1:], index[:-1], index[1:]),
    ):
        near = np.minimum(a, b) / 1000.0
        joined = (a > 0) & (b > 0) & (np.abs(a.astype(int) - b) <= 40 + 2.8 * near**2)
        pairs.append((i[joined], j[joined]))
    i, j = (np.concatenate(p) for p in zip(*pairs, strict=True))
    graph = coo_matrix((np.ones(len(i)), (i, j)), shape=(image.size, image.size))
    expected = connected_components(graph, directed=False)[1].reshape(image.shape)[image > 0]
    ours = labels[1:-1, 1:-1][image > 0]
    assert count == len(np.unique(expected)) == ours.max()
    assert len(np.unique(np.column_stack([ours, expected]), axis=0)) == count
    assert (labels[1:-1, 1:-1][image == 0] == 0).all()


@pytest.mark.parametrize("seed", range(4))
def test_component_extents_are_those_of_their_points(seed):
    image, padded = blobs(seed, shape=TOF.shape)
    labels, parents = np.zeros(padded.shape, np.int32), np.zeros(padded.size, np.int32)
    count = components.label_components(padded, whole(image), 40.0, 2.8, labels, parents)
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    sizes, extents = np.empty((count, 2)), np.empty((count, 3, 2))
    components.component_extents(padded, whole(image), labels, count, TOF.intrinsics, rotation, sizes, extents)
    z = image / 1000.0
    points = np.dstack([TOF.rays() * z[..., None], z]) @ rotation.T
    for k in np.random.default_rng(0).integers(0, count, 10):
        mask = labels[1:-1, 1:-1] == k + 1
        assert sizes[k, 0] == mask.sum()
        assert sizes[k, 1] == pytest.approx((z[mask] ** 2).sum() / (TOF.fx * TOF.fy))
        np.testing.assert_allclose(extents[k], np.column_stack([points[mask].min(0), points[mask].max(0)]))


@pytest.mark.parametrize("seed", range(4))
def test_foreground_lies_before_the_background_and_in_range(seed):
    rng = np.random.default_rng(seed)
    depth = rng.integers(0, 6000, (30, 40)).astype(np.uint16)
    background = rng.integers(0, 6000, (30, 40)).astype(np.uint16) * (rng.random((30, 40)) < 0.8).astype(np.uint16)
    padded, box = np.full((32, 42), 7, np.uint16) * 0, np.zeros(4, np.int64)
    count = kernels.take_foreground(depth, background, 30.0, 2.8, 400, 5000, padded, box)
    gap = background.astype(float) - depth
    keep = (depth >= 400) & (depth <= 5000) & ((background == 0) | (gap > 30 + 2.8 * (background / 1000.0) ** 2))
    np.testing.assert_array_equal(padded[1:-1, 1:-1], np.where(keep, depth, 0))
    v, u = np.nonzero(keep)
    assert count == keep.sum()
    assert tuple(box) == (v.min() + 1, v.max() + 2, u.min() + 1, u.max() + 2)


@pytest.mark.parametrize("support", [0, 3])
def test_contour_deletion_counts_supporting_neighbours(support):
    image, padded = blobs(3)
    out = np.zeros_like(padded)
    kernels.delete_contour(padded, whole(image), 30.0, 2.8, support, out)
    deep = np.pad(image, 2).astype(int)
    z = image.astype(int)
    tolerance = 30 + 2.8 * z**2 * 1e-6
    supported = np.zeros(image.shape, int)
    for dv in (-1, 0, 1):
        for du in (-1, 0, 1):
            if dv == du == 0:
                continue
            near = deep[2 + dv : deep.shape[0] - 2 + dv, 2 + du : deep.shape[1] - 2 + du]
            behind = deep[2 + 2 * dv : deep.shape[0] - 2 + 2 * dv, 2 + 2 * du : deep.shape[1] - 2 + 2 * du]
            flat = np.abs(near - z) <= tolerance
            sloped = (behind > 0) & (np.abs(2 * near - behind - z) <= tolerance)
            supported += (near > 0) & (flat | sloped)
    np.testing.assert_array_equal(out[1:-1, 1:-1], np.where(supported >= support, image, 0))


def test_deleting_the_silhouette_is_erosion_by_a_cross():
    import cv2

    image = np.zeros((40, 60), np.uint16)
    cv2.ellipse(image, (30, 20), (20, 12), 20, 0, 360, 2000, -1)
    image[:, 30:] *= 2  # a step in depth within the person is no contour
    out = np.zeros((42, 62), np.uint16)
    kernels.delete_silhouette(np.pad(image, 1), whole(image), out)
    cross = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
    inside = cv2.erode((image > 0).astype(np.uint8), cross, borderValue=0) > 0
    np.testing.assert_array_equal(out[1:-1, 1:-1], np.where(inside, image, 0))


@pytest.mark.parametrize("step", [1, 2])
def test_the_median_is_opencv_s_inside_and_the_lower_middle_at_edges(step):
    import cv2

    image, padded = blobs(5)
    out = np.zeros((-(-40 // step), -(-60 // step)), np.float32)
    kernels.median_to_metres(padded, whole(image), step, True, out)
    expected = np.zeros(image.shape)
    for v, u in zip(*np.nonzero(image), strict=True):
        values = padded[v : v + 3, u : u + 3]
        values = np.sort(values[values > 0])
        expected[v, u] = values[(len(values) - 1) // 2] / 1000
    np.testing.assert_allclose(out, expected[::step, ::step], rtol=1e-6)
    inside = ndimage.minimum_filter(image, 3) > 0
    inside[[0, -1]] = inside[:, [0, -1]] = False
    np.testing.assert_allclose(
        out[inside[::step, ::step]], cv2.medianBlur(image, 3)[::step, ::step][inside[::step, ::step]] / 1000, rtol=1e-6
    )
