"""Regression forest on depth images: its questions, its votes and its training, compiled.

A question at pixel u of depth z compares the depth at two probes, `u + f a / z` and `u + f b / z`, with offsets a and b
in metres, so that the answer depends neither on the distance nor on the sensor's resolution (Shotton 2011, Eq. 1).
Depth differences to z are clipped to one `REACH`; a probe that meets no measurement counts as `REACH` behind.
"""

from __future__ import annotations

import numpy as np
from numba import njit

REACH = 1.0
"""Metres: how much nearer or farther than its pixel a probe can say that something is."""


@njit(cache=True)
def probe(depth: np.ndarray, u: float, v: float, z: float) -> float:
    """Clipped depth difference at image position (u, v) of `depth` (H, W), metres, to a pixel of depth z."""
    iu = int(np.rint(u))
    iv = int(np.rint(v))
    if iu < 0 or iv < 0 or iv >= depth.shape[0] or iu >= depth.shape[1]:
        return REACH
    d = depth[iv, iu]
    if d <= 0.0:
        return REACH
    return min(max(d - z, -REACH), REACH)


@njit(cache=True)
def question(depth: np.ndarray, u: float, v: float, z: float, fx: float, fy: float, offsets: np.ndarray) -> float:
    """Answer of one question with probe `offsets` (4,) = a_x, a_y, b_x, b_y, metres."""
    sx, sy = fx / z, fy / z
    return probe(depth, u + sx * offsets[0], v + sy * offsets[1], z) - probe(
        depth, u + sx * offsets[2], v + sy * offsets[3], z
    )


@njit(cache=True)
def find_leaves(
    depth: np.ndarray,
    pixels: np.ndarray,
    intrinsics: np.ndarray,
    offsets: np.ndarray,
    thresholds: np.ndarray,
    children: np.ndarray,
    roots: np.ndarray,
    leaves: np.ndarray,
) -> None:
    """Leaf that each pixel reaches in each tree: fills `leaves` (N, trees).

    `pixels` (N,) are flat indices; `children` (nodes, 2): a negative child is leaf `-1 - child`; an answer below the
    node's threshold goes to child 0.
    """
    width = depth.shape[1]
    for i in range(pixels.shape[0]):
        u = pixels[i] % width
        v = pixels[i] // width
        z = depth[v, u]
        for t in range(roots.shape[0]):
            node = roots[t]
            while node >= 0:
                answer = question(depth, u, v, z, intrinsics[0], intrinsics[1], offsets[node])
                node = children[node, 0 if answer < thresholds[node] else 1]
            leaves[i, t] = -1 - node


@njit(cache=True)
def vote(
    points: np.ndarray,
    leaves: np.ndarray,
    leaf_offsets: np.ndarray,
    leaf_weights: np.ndarray,
    voters: int,
    bandwidth: float,
    rounds: int,
    joints: np.ndarray,
    confidence: np.ndarray,
) -> None:
    """Modes of the joint votes by mean shift: fills `joints` (J, 3) and `confidence` (J,) in [0, 1].

    Pixel i votes for joint j at `points[i] + leaf_offsets[leaf, j]` with `leaf_weights[leaf, j]`; only the `voters`
    surest votes for a joint count, and those as sure as the last of them. The search starts at their weighted mean
    with a Gaussian kernel three times as wide as `bandwidth`, in metres, which narrows to it. Confidence is the mean
    weight of these votes times the share of it that the mode holds.
    """
    pixels, trees = leaves.shape
    total = pixels * trees
    weights = np.empty(total)
    chosen = np.empty((total, 4))
    for j in range(leaf_offsets.shape[1]):
        for i in range(pixels):
            for t in range(trees):
                weights[i * trees + t] = leaf_weights[leaves[i, t], j]
        least = np.partition(weights, total - voters)[total - voters] if voters < total else 0.0
        count = 0
        mass = 0.0
        x = y = z = 0.0
        for n in range(total):
            w = weights[n]
            if w < least or count == total:
                continue
            i, leaf = n // trees, leaves[n // trees, n % trees]
            chosen[count, 0] = points[i, 0] + leaf_offsets[leaf, j, 0]
            chosen[count, 1] = points[i, 1] + leaf_offsets[leaf, j, 1]
            chosen[count, 2] = points[i, 2] + leaf_offsets[leaf, j, 2]
            chosen[count, 3] = w
            x += w * chosen[count, 0]
            y += w * chosen[count, 1]
            z += w * chosen[count, 2]
            mass += w
            count += 1
        x, y, z = x / max(mass, 1e-12), y / max(mass, 1e-12), z / max(mass, 1e-12)
        held = 0.0
        for step in range(rounds):
            width = bandwidth * (1.0 + 2.0 * (rounds - 1 - step) / max(rounds - 1, 1))
            factor = 0.5 / (width * width)
            mx = my = mz = held = 0.0
            for n in range(count):
                dx, dy, dz = chosen[n, 0] - x, chosen[n, 1] - y, chosen[n, 2] - z
                w = chosen[n, 3] * np.exp(-factor * (dx * dx + dy * dy + dz * dz))
                mx += w * chosen[n, 0]
                my += w * chosen[n, 1]
                mz += w * chosen[n, 2]
                held += w
            if held > 0.0:
                x, y, z = mx / held, my / held, mz / held
        joints[j, 0], joints[j, 1], joints[j, 2] = x, y, z
        confidence[j] = held / max(count, 1)


@njit(cache=True)
def _stored_probe(
    images: np.ndarray,
    start: int,
    height: int,
    width: int,
    u: int,
    v: int,
    z: float,
    focal: float,
    x: float,
    y: float,
) -> float:
    """`probe` in the crop of a training image, with its offset (x, y) in metres."""
    iu = int(np.rint(u + focal / z * x))
    iv = int(np.rint(v + focal / z * y))
    if iu < 0 or iv < 0 or iv >= height or iu >= width:
        return REACH
    d = images[start + iv * width + iu]
    if d == 0:
        return REACH
    return min(max(d * 0.001 - z, -REACH), REACH)


@njit(cache=True)
def answers(
    images: np.ndarray,
    starts: np.ndarray,
    shapes: np.ndarray,
    focal: float,
    sample_image: np.ndarray,
    sample_u: np.ndarray,
    sample_v: np.ndarray,
    rows: np.ndarray,
    offsets: np.ndarray,
    out: np.ndarray,
) -> None:
    """Answers of training samples `rows` to one question: fills `out` (len(rows),).

    Image k is the crop `images[starts[k]:]` of shape `shapes[k]`, uint16 millimetres; outside of it is nothing.
    """
    for n in range(rows.shape[0]):
        s = rows[n]
        k = sample_image[s]
        height, width, start = shapes[k, 0], shapes[k, 1], starts[k]
        u, v = sample_u[s], sample_v[s]
        z = images[start + v * width + u] * 0.001
        first = _stored_probe(images, start, height, width, u, v, z, focal, offsets[0], offsets[1])
        second = _stored_probe(images, start, height, width, u, v, z, focal, offsets[2], offsets[3])
        out[n] = first - second


@njit(cache=True)
def best_split(
    images: np.ndarray,
    starts: np.ndarray,
    shapes: np.ndarray,
    focal: float,
    sample_image: np.ndarray,
    sample_u: np.ndarray,
    sample_v: np.ndarray,
    labels: np.ndarray,
    rows: np.ndarray,
    candidates: np.ndarray,
    bins: int,
    classes: int,
) -> tuple[int, float, float]:
    """The candidate question and threshold that leave the least label entropy: (candidate, threshold, entropy).

    `candidates` (Q, 4) are probe offsets in metres; thresholds are the borders of `bins` equal bins over +-REACH / 2.
    Entropy is summed over the samples, in nats; -1 as candidate where no question separates them.
    """
    count = rows.shape[0]
    questions = candidates.shape[0]
    low, width = -0.5 * REACH, REACH / bins
    histogram = np.zeros((questions, bins, classes), dtype=np.int32)
    total = np.zeros(classes, dtype=np.int64)
    # All questions are put to one sample before the next: its image then stays in the cache.
    for n in range(count):
        s = rows[n]
        label = labels[s]
        total[label] += 1
        k = sample_image[s]
        height, stride, start = shapes[k, 0], shapes[k, 1], starts[k]
        z = images[start + sample_v[s] * stride + sample_u[s]] * 0.001
        for q in range(questions):
            first = _stored_probe(
                images, start, height, stride, sample_u[s], sample_v[s], z, focal, candidates[q, 0], candidates[q, 1]
            )
            second = _stored_probe(
                images, start, height, stride, sample_u[s], sample_v[s], z, focal, candidates[q, 2], candidates[q, 3]
            )
            b = int(np.floor((np.float32(first - second) - low) / width))
            histogram[q, min(max(b, 0), bins - 1), label] += 1
    best, best_threshold, best_entropy = -1, 0.0, np.inf
    below = np.empty(classes, dtype=np.int64)
    for q in range(questions):
        below[:] = 0
        under = 0
        for b in range(bins - 1):
            for c in range(classes):
                below[c] += histogram[q, b, c]
                under += histogram[q, b, c]
            if under == 0 or under == count:
                continue
            entropy = under * np.log(under) + (count - under) * np.log(count - under)
            for c in range(classes):
                if below[c] > 0:
                    entropy -= below[c] * np.log(below[c])
                over = total[c] - below[c]
                if over > 0:
                    entropy -= over * np.log(over)
            if entropy < best_entropy:
                best, best_threshold, best_entropy = q, low + (b + 1) * width, entropy
    return best, best_threshold, best_entropy
