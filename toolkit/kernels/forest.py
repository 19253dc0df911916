"""Regression forest on depth images: its questions, its votes and its training, compiled.

A question at pixel u of depth z compares the depth at two probes, `u + f a / z` and `u + f b / z`, with offsets a and b
in metres, so that the answer depends neither on the distance nor on the sensor's resolution (Shotton 2011, Eq. 1).
Offsets and depths are those of a level camera at the same place, so that neither does it depend on the camera's tilt.
Depth differences to z are clipped to one `REACH`. A probe that meets nobody counts as `REACH` behind the pixel; one
that can see nothing, outside the image or behind something else, as `REACH` before it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

Numbers = np.ndarray | tuple[float, ...]
"""A few numbers: compiled code keeps those of a tuple in registers."""

REACH = 1.0
"""Metres: how much nearer or farther than its pixel a probe can say that something is."""


UNOBSERVED = 65535
"""In a training image: what was measured here says nothing about the person."""


NEAREST = 0.05
"""Metres before the camera where probes end."""


@njit(cache=True)
def depth_along(depth: np.ndarray, camera: np.ndarray, along: np.ndarray, out: np.ndarray) -> None:
    """How far along the level frame's -z everything is that was measured: fills `out` float64 (H, W), metres.

    `depth` float32 (H, W), metres: 0 = nothing, negative = unobserved; both stay. `camera` holds fx, fy, cx, cy;
    `along` (3,) is the level frame's -z in the camera frame.
    """
    for v in range(depth.shape[0]):
        down = along[1] * (v - camera[3]) / camera[1] + along[2]
        for u in range(depth.shape[1]):
            d = depth[v, u]
            out[v, u] = d * (along[0] * (u - camera[2]) / camera[0] + down) if d > 0.0 else d


@njit(cache=True)
def probe(
    level: np.ndarray, camera: Numbers, across: Numbers, down: Numbers, pixel: np.ndarray,
    x: float, y: float, blind: float,
) -> float:  # fmt: skip
    """Clipped difference of the measured depth at a probe to that of its pixel, metres.

    `level` comes from `depth_along`; `camera` holds fx, fy, cx, cy; `across` and `down` (3,) are the level frame's +x
    and -y in the camera frame; `pixel` (4,) is the pixel's point in the camera frame and its depth along the level
    frame's -z. The probe is at `x` across and `y` down of it. Outside the image and where it is unobserved the answer
    is `blind`.
    """
    px = pixel[0] + x * across[0] + y * down[0]
    py = pixel[1] + x * across[1] + y * down[1]
    pz = pixel[2] + x * across[2] + y * down[2]
    inverse = 1.0 / max(pz, NEAREST)
    iu = int(np.rint(camera[2] + camera[0] * px * inverse))
    iv = int(np.rint(camera[3] + camera[1] * py * inverse))
    if pz < NEAREST or iu < 0 or iv < 0 or iv >= level.shape[0] or iu >= level.shape[1]:
        return blind
    d = level[iv, iu]
    if d <= 0.0:
        return blind if d < 0.0 else REACH
    return min(max(d - pixel[3], -REACH), REACH)


@njit(cache=True)
def question(
    level: np.ndarray, camera: Numbers, across: Numbers, down: Numbers, pixel: np.ndarray,
    offsets: np.ndarray, blind: float,
) -> float:  # fmt: skip
    """Answer of one question with probe offsets a_x, a_y, b_x, b_y, metres across and down; else as in `probe`."""
    return probe(level, camera, across, down, pixel, offsets[0], offsets[1], blind) - probe(
        level, camera, across, down, pixel, offsets[2], offsets[3], blind
    )


BLOCK = 64
"""Pixels that walk down a tree side by side, so that one steps while another waits for memory."""


@njit(cache=True)
def find_leaves(
    depth: np.ndarray,
    pixels: np.ndarray,
    camera: np.ndarray,
    rotation: np.ndarray,
    nodes: np.ndarray,
    roots: np.ndarray,
    blind: float,
    leaves: np.ndarray,
) -> None:
    """Leaf that each pixel reaches in each tree: fills `leaves` (N, trees).

    `depth` and `camera` as in `depth_along`, `blind` as in `probe`; `pixels` (N,) are flat indices; `rotation` (3, 3)
    is R_level_camera; `nodes` float32 (nodes, 7) hold a question's probe offsets, its threshold and both children in a
    row, of which a negative one is leaf `-1 - child`; an answer below the threshold goes to the first.
    """
    width = depth.shape[1]
    along = -rotation[2]
    level = np.empty(depth.shape)
    depth_along(depth, camera, along, level)
    lens = (camera[0], camera[1], camera[2], camera[3])
    across = (rotation[0, 0], rotation[0, 1], rotation[0, 2])
    down = (-rotation[1, 0], -rotation[1, 1], -rotation[1, 2])
    at = np.empty(BLOCK, dtype=np.int64)
    walking = np.empty(BLOCK, dtype=np.int64)
    point = np.empty((BLOCK, 4))
    for start in range(0, pixels.shape[0], BLOCK):
        block = min(BLOCK, pixels.shape[0] - start)
        for k in range(block):
            u, v = pixels[start + k] % width, pixels[start + k] // width
            z = depth[v, u]
            point[k, 0] = (u - camera[2]) * z / camera[0]
            point[k, 1] = (v - camera[3]) * z / camera[1]
            point[k, 2] = z
            point[k, 3] = along[0] * point[k, 0] + along[1] * point[k, 1] + along[2] * z
        for t in range(roots.shape[0]):
            at[:] = roots[t]
            walking[:] = np.arange(BLOCK)
            left = block if roots[t] >= 0 else 0
            while left > 0:
                still = 0
                for i in range(left):
                    k = walking[i]
                    node = nodes[at[k]]
                    answer = question(level, lens, across, down, point[k], node, blind)
                    at[k] = int(node[5] if answer < node[4] else node[6])
                    # Written whether it walks on or not: a branch here would be guessed wrong at every leaf.
                    walking[still] = k
                    still += at[k] >= 0
                left = still
            for k in range(block):
                leaves[start + k, t] = -1 - at[k]


SURE = 256
"""Steps in which leaves say how sure they are of a joint."""


@njit(cache=True)
def vote(
    points: np.ndarray,
    leaves: np.ndarray,
    leaf_offsets: np.ndarray,
    unit: float,
    leaf_sureness: np.ndarray,
    leaf_in_view: np.ndarray,
    weight_of: np.ndarray,
    log_odds: np.ndarray,
    voters: int,
    bandwidth: float,
    rounds: int,
    joints: np.ndarray,
    confidence: np.ndarray,
    evidence: np.ndarray,
) -> None:
    """Modes of the joint votes by mean shift: fills `joints` (J, 3), `confidence` (J,) in [0, 1] and `evidence` (J,).

    Pixel i votes for joint j at `points[i] + unit * leaf_offsets[leaf, j]` with weight
    `weight_of[leaf_sureness[leaf, j]]`, (SURE,), rising, times the share `leaf_in_view[leaf, j]` in steps of 1 / 255;
    only the `voters` surest votes for a joint count, and those as sure as the last of them. The search starts at their
    weighted mean with a Gaussian kernel three times as wide as `bandwidth`, in metres, which narrows to it. Confidence
    is the mean weight of these votes times the share of it that the mode holds. Evidence that a joint is in view is the
    mean over all pixels and trees of `log_odds[leaf_in_view[leaf, j]]`, (256,): the few pixels that know, those beside
    the border that cuts a limb off, say so with large numbers, and the many that do not with small ones.
    """
    pixels, trees = leaves.shape
    count_of_joints = leaf_offsets.shape[1]
    # One pass over the leaves counts for all joints how many votes are how sure, so that nothing has to be sorted.
    histogram = np.zeros((count_of_joints, SURE), dtype=np.int32)
    evidence[:] = 0.0
    for i in range(pixels):
        for t in range(trees):
            leaf = leaves[i, t]
            for j in range(count_of_joints):
                histogram[j, leaf_sureness[leaf, j]] += 1
                evidence[j] += log_odds[leaf_in_view[leaf, j]]
    least = np.zeros(count_of_joints, dtype=np.int64)
    counts = np.zeros(count_of_joints, dtype=np.int64)
    most = 0
    for j in range(count_of_joints):
        for level in range(SURE - 1, -1, -1):
            counts[j] += histogram[j, level]
            if counts[j] >= voters:
                least[j] = level
                break
        most = max(most, counts[j])
    chosen = np.empty((count_of_joints, most, 4))
    counts[:] = 0
    for i in range(pixels):
        for t in range(trees):
            leaf = leaves[i, t]
            for j in range(count_of_joints):
                sure = leaf_sureness[leaf, j]
                if sure >= least[j]:
                    n = counts[j]
                    chosen[j, n, 0] = points[i, 0] + unit * leaf_offsets[leaf, j, 0]
                    chosen[j, n, 1] = points[i, 1] + unit * leaf_offsets[leaf, j, 1]
                    chosen[j, n, 2] = points[i, 2] + unit * leaf_offsets[leaf, j, 2]
                    chosen[j, n, 3] = weight_of[sure] * leaf_in_view[leaf, j] / 255.0
                    counts[j] = n + 1
    for j in range(count_of_joints):
        _mode(chosen[j, : counts[j]], bandwidth, rounds, joints[j])
        confidence[j] = _held(chosen[j, : counts[j]], bandwidth, joints[j]) / max(counts[j], 1)
        evidence[j] /= max(pixels * trees, 1)


@njit(cache=True)
def _mode(votes: np.ndarray, bandwidth: float, rounds: int, mode: np.ndarray) -> None:
    """Mean shift from the weighted mean of `votes` (N, 4), position and weight, to a mode: fills `mode` (3,)."""
    x = y = z = mass = 0.0
    for n in range(votes.shape[0]):
        w = votes[n, 3]
        x += w * votes[n, 0]
        y += w * votes[n, 1]
        z += w * votes[n, 2]
        mass += w
    x, y, z = x / max(mass, 1e-12), y / max(mass, 1e-12), z / max(mass, 1e-12)
    for step in range(rounds):
        width = bandwidth * (1.0 + 2.0 * (rounds - 1 - step) / max(rounds - 1, 1))
        factor = 0.5 / (width * width)
        mx = my = mz = held = 0.0
        for n in range(votes.shape[0]):
            dx, dy, dz = votes[n, 0] - x, votes[n, 1] - y, votes[n, 2] - z
            w = votes[n, 3] * np.exp(-factor * (dx * dx + dy * dy + dz * dz))
            mx += w * votes[n, 0]
            my += w * votes[n, 1]
            mz += w * votes[n, 2]
            held += w
        if held > 0.0:
            x, y, z = mx / held, my / held, mz / held
    mode[0], mode[1], mode[2] = x, y, z


@njit(cache=True)
def _held(votes: np.ndarray, bandwidth: float, mode: np.ndarray) -> float:
    """Weight of `votes` (N, 4) under the kernel at a mode (3,)."""
    factor = 0.5 / (bandwidth * bandwidth)
    held = 0.0
    for n in range(votes.shape[0]):
        dx, dy, dz = votes[n, 0] - mode[0], votes[n, 1] - mode[1], votes[n, 2] - mode[2]
        held += votes[n, 3] * np.exp(-factor * (dx * dx + dy * dy + dz * dz))
    return held


@njit(cache=True)
def _stored_probe(
    images: np.ndarray, start: int, height: int, width: int, windows: np.ndarray, k: int, iu: int, iv: int, z: float
) -> float:
    """`probe` at pixel (iu, iv) of training image k."""
    if iu < 0 or iv < 0 or iv >= height or iu >= width:
        outside = iu < windows[k, 0] or iu > windows[k, 1] or iv < windows[k, 2] or iv > windows[k, 3]
        return -REACH if outside else REACH
    d = images[start + iv * width + iu]
    if d == 0:
        return REACH
    if d == UNOBSERVED:
        return -REACH
    return min(max(d * 0.001 - z, -REACH), REACH)


@njit(cache=True)
def _stored_question(
    images: np.ndarray,
    start: int,
    height: int,
    width: int,
    windows: np.ndarray,
    k: int,
    u: int,
    v: int,
    z: float,
    scale: float,
    candidates: np.ndarray,
    q: int,
) -> float:
    """`question` q in the crop of training image k of a level camera; a metre at depth z covers `scale` pixels."""
    iu = int(np.floor(u + scale * candidates[q, 0] + 0.5))
    iv = int(np.floor(v + scale * candidates[q, 1] + 0.5))
    answer = _stored_probe(images, start, height, width, windows, k, iu, iv, z)
    if candidates[q, 2] == 0.0 and candidates[q, 3] == 0.0:
        return answer  # the second probe is the pixel itself
    iu = int(np.floor(u + scale * candidates[q, 2] + 0.5))
    iv = int(np.floor(v + scale * candidates[q, 3] + 0.5))
    return answer - _stored_probe(images, start, height, width, windows, k, iu, iv, z)


@njit(cache=True)
def answers(
    images: np.ndarray,
    starts: np.ndarray,
    shapes: np.ndarray,
    windows: np.ndarray,
    focal: float,
    sample_image: np.ndarray,
    sample_u: np.ndarray,
    sample_v: np.ndarray,
    rows: np.ndarray,
    offsets: np.ndarray,
    out: np.ndarray,
) -> None:
    """Answers of training samples `rows` to one question: fills `out` (len(rows),).

    Image k is the crop `images[starts[k]:]` of shape `shapes[k]`, uint16 millimetres, 0 = nothing, or `UNOBSERVED`.
    Outside of it is nothing, and outside of `windows[k]`, first and last column and row, it is unobserved.
    """
    one = offsets.reshape(1, 4)
    for n in range(rows.shape[0]):
        s = rows[n]
        k = sample_image[s]
        height, width, start = shapes[k, 0], shapes[k, 1], starts[k]
        z = images[start + sample_v[s] * width + sample_u[s]] * 0.001
        out[n] = _stored_question(
            images, start, height, width, windows, k, sample_u[s], sample_v[s], z, focal / z, one, 0
        )


@njit(cache=True)
def best_split(
    images: np.ndarray,
    starts: np.ndarray,
    shapes: np.ndarray,
    windows: np.ndarray,
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
    # Nodes near the leaves hold few classes: only those are counted. Logarithms are looked up, not taken.
    number = np.full(classes, -1, dtype=np.int64)
    present = 0
    for n in range(count):
        label = labels[rows[n]]
        if number[label] < 0:
            number[label] = present
            present += 1
    scaled_log = np.zeros(count + 1)
    for n in range(2, count + 1):
        scaled_log[n] = n * np.log(n)
    total = np.zeros(present, dtype=np.int64)
    label_of = np.empty(count, dtype=np.int64)
    bin_of = np.empty((questions, count), dtype=np.uint8)
    # All questions are put to one sample before the next: its image then stays in the cache.
    for n in range(count):
        s = rows[n]
        label_of[n] = number[labels[s]]
        total[label_of[n]] += 1
        k = sample_image[s]
        height, stride, start = shapes[k, 0], shapes[k, 1], starts[k]
        z = images[start + sample_v[s] * stride + sample_u[s]] * 0.001
        for q in range(questions):
            answer = _stored_question(
                images, start, height, stride, windows, k, sample_u[s], sample_v[s], z, focal / z, candidates, q
            )
            b = int(np.floor((np.float32(answer) - low) / width))
            bin_of[q, n] = min(max(b, 0), bins - 1)
    best, best_threshold, best_entropy = -1, 0.0, np.inf
    histogram = np.zeros((bins, present), dtype=np.int64)
    below = np.empty(present, dtype=np.int64)
    for q in range(questions):
        histogram[:] = 0
        for n in range(count):
            histogram[bin_of[q, n], label_of[n]] += 1
        below[:] = 0
        under = 0
        mixed = 0.0  # what the labels on both sides take off the entropy; changes only by those of the next bin
        for c in range(present):
            mixed += scaled_log[total[c]]
        for b in range(bins - 1):
            before = under
            for c in range(present):
                more = histogram[b, c]
                if more > 0:
                    mixed -= scaled_log[below[c]] + scaled_log[total[c] - below[c]]
                    below[c] += more
                    mixed += scaled_log[below[c]] + scaled_log[total[c] - below[c]]
                    under += more
            if under == before or under == count:
                continue
            entropy = scaled_log[under] + scaled_log[count - under] - mixed
            if entropy < best_entropy:
                best, best_threshold, best_entropy = q, low + (b + 1) * width, entropy
    return best, best_threshold, best_entropy
