"""Regression forest on depth images: its questions and its votes, compiled.

A question at pixel u of depth z compares the depth at two probes, `u + f a / z` and `u + f b / z`, with offsets a and b
in metres, so that the answer depends neither on the distance nor on the sensor's resolution (Shotton 2011, Eq. 1).
Offsets and depths are those of a level camera at the same place, so that neither does it depend on the camera's tilt.
Depth differences to z are clipped to one `REACH`. A probe that meets no person counts as `REACH` behind the pixel; one
that can see nothing, outside the image or behind something else, as `REACH` before it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

REACH = 1.0
"""Metres: how much nearer or farther than its pixel a probe can say that something is."""


UNOBSERVED = 65535
"""In a training image: what was measured here says nothing about the person."""


NEAREST = 0.05
"""Metres before the camera where probes end."""


BLOCK = 64
"""Pixels that are asked side by side, so that their arithmetic is done in vectors and one waits for memory while
another computes."""


class View(NamedTuple):
    """What questions are put to.

    depth : float32 (H, W), metres: 0 = nothing, negative = unobserved
    camera : float64 (4,), fx, fy, cx, cy
    rotation : float64 (3, 3), R_level_camera
    """

    depth: np.ndarray
    camera: np.ndarray
    rotation: np.ndarray


class Asked(NamedTuple):
    """A block of pixels and the question that each is asked.

    points : float64 (4, BLOCK), their points in the camera frame, metres, and how far these are along the level frame's
        -z
    offsets : float64 (4, BLOCK), a_x, a_y, b_x, b_y, metres across and down
    places : int32 (2, BLOCK), room for column and row of the pixel that a probe meets, the column -1 outside the image
    answers : float64 (2, BLOCK), room for those of both probes
    """

    points: np.ndarray
    offsets: np.ndarray
    places: np.ndarray
    answers: np.ndarray


@njit(cache=True)
def empty_block() -> Asked:
    """Room for one block."""
    return Asked(
        np.empty((4, BLOCK)), np.empty((4, BLOCK)), np.empty((2, BLOCK), dtype=np.int32), np.empty((2, BLOCK))
    )  # fmt: skip


@njit(cache=True)
def place_pixels(view: View, pixels: np.ndarray, start: int, asked: Asked) -> None:
    """Fill the points of `asked` with `pixels` (N,), flat indices, from `start` on; the last one fills what is left."""
    width = view.depth.shape[1]
    for k in range(BLOCK):
        pixel = pixels[min(start + k, pixels.shape[0] - 1)]
        z = view.depth[pixel // width, pixel % width]
        x = (pixel % width - view.camera[2]) * z / view.camera[0]
        y = (pixel // width - view.camera[3]) * z / view.camera[1]
        asked.points[0, k], asked.points[1, k], asked.points[2, k] = x, y, z
        asked.points[3, k] = -(view.rotation[2, 0] * x + view.rotation[2, 1] * y + view.rotation[2, 2] * z)


@njit(cache=True)
def answer(view: View, asked: Asked) -> None:
    """Put a block's questions: fills its answers with the clipped differences of measured depth, metres, of each probe.

    The answer to a question is that of the first probe less that of the second.
    """
    fx, fy, cx, cy = view.camera[0], view.camera[1], view.camera[2], view.camera[3]
    across_x, across_y, across_z = view.rotation[0, 0], view.rotation[0, 1], view.rotation[0, 2]
    down_x, down_y, down_z = -view.rotation[1, 0], -view.rotation[1, 1], -view.rotation[1, 2]
    along_x, along_y, along_z = -view.rotation[2, 0], -view.rotation[2, 1], -view.rotation[2, 2]
    height, width = view.depth.shape
    depth = view.depth
    start_x, start_y, start_z, start = asked.points[0], asked.points[1], asked.points[2], asked.points[3]
    columns, rows = asked.places[0], asked.places[1]
    for s in range(2):
        x, y, answers = asked.offsets[2 * s], asked.offsets[2 * s + 1], asked.answers[s]
        # Two loops, the first free of branches and of memory at random: it is computed in vectors.
        for k in range(BLOCK):
            px = start_x[k] + x[k] * across_x + y[k] * down_x
            py = start_y[k] + x[k] * across_y + y[k] * down_y
            pz = start_z[k] + x[k] * across_z + y[k] * down_z
            inverse = 1.0 / max(pz, NEAREST)
            u = np.int32(np.rint(cx + fx * px * inverse))
            v = np.int32(np.rint(cy + fy * py * inverse))
            inside = (pz >= NEAREST) & (u >= 0) & (v >= 0) & (u < width) & (v < height)
            columns[k], rows[k] = (u if inside else np.int32(-1)), (v if inside else np.int32(0))
        for k in range(BLOCK):
            u, v = columns[k], rows[k]
            d = float(depth[v, max(u, 0)])
            along = d * (along_x * (u - cx) / fx + (along_y * (v - cy) / fy + along_z))
            measured = min(max(along - start[k], -REACH), REACH)
            nothing = REACH if d == 0.0 else -REACH
            answers[k] = -REACH if u < 0 else (measured if d > 0.0 else nothing)


@njit(cache=True)
def find_leaves(view: View, pixels: np.ndarray, nodes: np.ndarray, roots: np.ndarray, leaves: np.ndarray) -> None:
    """Leaf that each of `pixels` (N,), flat indices, reaches in each tree: fills `leaves` (N, trees).

    `nodes` float32 (nodes, 7) hold a question's probe offsets, its threshold and both children in a row; these two are
    int32 in the same bytes, and a negative one is leaf `-1 - child`. An answer below the threshold goes to the first.
    """
    asked, at, links = empty_block(), np.empty(BLOCK, dtype=np.int32), nodes.view(np.int32)
    thresholds, children = np.empty(BLOCK, dtype=np.float32), np.empty((2, BLOCK), dtype=np.int32)
    for start in range(0, pixels.shape[0], BLOCK):
        place_pixels(view, pixels, start, asked)
        for t in range(roots.shape[0]):
            at[:] = roots[t]
            walking = roots[t] >= 0
            while walking:
                for k in range(BLOCK):
                    row = max(at[k], 0)
                    for i in range(4):
                        asked.offsets[i, k] = nodes[row, i]
                    thresholds[k] = nodes[row, 4]
                    children[0, k], children[1, k] = links[row, 5], links[row, 6]
                answer(view, asked)
                walking = False
                for k in range(BLOCK):
                    below = asked.answers[0, k] - asked.answers[1, k] < thresholds[k]
                    child = children[0, k] if below else children[1, k]
                    at[k] = child if at[k] >= 0 else at[k]  # who has reached a leaf waits there for the others
                    walking |= at[k] >= 0
            for k in range(min(BLOCK, pixels.shape[0] - start)):
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
