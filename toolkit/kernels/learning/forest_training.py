"""Training of a regression forest on depth images: questions to stored crops and the trees that they make, compiled.

Questions are those of `toolkit.kernels.learning.forest`, put to images of level cameras. Splits are found as
gradient boosting finds them (Ke et al. 2017): answers fall into bins, and labels are counted by bin instead of sorted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from toolkit.kernels.learning.forest import REACH, UNOBSERVED

FARTHEST_PROBE = 0.8
"""Metres: probes reach so far across the image, most of them less."""
STEPS = 256
"""Of a metre in which probes are told: half a pixel of a person at 2 m, and few bytes."""
FEWEST_QUESTIONS = 20
"""Questions that are tried for a node of few samples."""
JUDGES_A_QUESTION = 5
"""A node of few samples is asked one question for so many of them: more would be answered alike."""


class Samples(NamedTuple):
    """Pixels of level cameras' images that a forest is trained on.

    Attributes
    ----------
    images : uint16 millimetres, crops one after the other, 0 = nothing, or `UNOBSERVED`
    starts, shapes : crop k is `images[starts[k]:]` of shape `shapes[k]`; outside of it is nothing
    windows : (K, 4), first and last column and row; outside of `windows[k]` crop k is unobserved
    focal : pixels
    image, u, v : (N,), crop, column and row of each sample
    """

    images: np.ndarray
    starts: np.ndarray
    shapes: np.ndarray
    windows: np.ndarray
    focal: float
    image: np.ndarray
    u: np.ndarray
    v: np.ndarray


class Growth(NamedTuple):
    """How a tree grows: `deepest` level, and the rest as in `database_builder.regressor.RegressorSettings`."""

    deepest: int
    smallest_leaf: int
    questions: int
    bins: int
    node_samples: int
    classes: int


class Tree(NamedTuple):
    """A grown tree, or a part of one.

    Attributes
    ----------
    offsets : float32 (nodes, 4), probe offsets in metres
    thresholds : float32 (nodes,), metres
    children : int32 (nodes, 2), a negative child is leaf `-1 - child`; every child comes after its parent
    starts : int64 (leaves + 1,), leaf k holds `rows[starts[k] : starts[k + 1]]` of the rows that it was grown from
    paths : int64 (leaves,), the way to each leaf: 1, then of each turn a bit, 0 below the threshold and 1 from it on
    """

    offsets: np.ndarray
    thresholds: np.ndarray
    children: np.ndarray
    starts: np.ndarray
    paths: np.ndarray


@njit(cache=True, nogil=True)
def _random(state: np.ndarray) -> float:
    """The next number in [0, 1) of SplitMix64 (Steele et al. 2014); `state` uint64 (1,) moves on."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return float((z ^ (z >> np.uint64(31))) >> np.uint64(11)) / 9007199254740992.0


@njit(cache=True, nogil=True)
def random_questions(count: int, state: np.ndarray) -> np.ndarray:
    """Probe offsets of questions, float32 (4, count), metres; the first half compares with the pixel itself."""
    out = np.zeros((4, count), dtype=np.float32)
    for q in range(count):
        for probe in range(2):
            radius = FARTHEST_PROBE * _random(state) ** 1.5
            angle = 2.0 * np.pi * _random(state)
            if probe == 0 or q >= count // 2:
                out[2 * probe, q] = np.rint(STEPS * radius * np.cos(angle)) / STEPS
                out[2 * probe + 1, q] = np.rint(STEPS * radius * np.sin(angle)) / STEPS
    return out


@njit(cache=True, nogil=True)
def _ask(
    samples: Samples, s: int, questions: np.ndarray, places: np.ndarray, beyond: np.ndarray, out: np.ndarray
) -> None:
    """Answers of sample s to `questions` (4, Q), metres: fills `out` float32 (Q,); `places` and `beyond` are room."""
    k, u, v = samples.image[s], samples.u[s], samples.v[s]
    height, width = samples.shapes[k, 0], samples.shapes[k, 1]
    crop = samples.images[samples.starts[k] : samples.starts[k] + height * width]
    first_u, last_u = samples.windows[k, 0], samples.windows[k, 1]
    first_v, last_v = samples.windows[k, 2], samples.windows[k, 3]
    z = crop[v * width + u] * 0.001
    scale = samples.focal / z  # pixels that a metre covers there
    out[:] = 0.0
    # The first half of the questions has one probe. Two loops: the first, free of memory at random, is done in vectors.
    for probe in range(2):
        start = 0 if probe == 0 else questions.shape[1] // 2
        across, down = questions[2 * probe], questions[2 * probe + 1]
        for q in range(start, questions.shape[1]):
            iu = np.int32(np.rint(u + scale * across[q]))
            iv = np.int32(np.rint(v + scale * down[q]))
            outside = (iu < first_u) | (iu > last_u) | (iv < first_v) | (iv > last_v)
            inside = (iu >= 0) & (iv >= 0) & (iu < width) & (iv < height)
            places[q] = np.int32(iv * width + iu) if inside else np.int32(-1)
            beyond[q] = -REACH if outside else REACH
        for q in range(start, questions.shape[1]):
            d = crop[max(places[q], 0)]
            measured = min(max(d * 0.001 - z, -REACH), REACH)
            measured = REACH if d == 0 else (-REACH if d == UNOBSERVED else measured)
            seen = beyond[q] if places[q] < 0 else measured
            out[q] += seen if probe == 0 else -seen


@njit(cache=True, nogil=True)
def answers(samples: Samples, rows: np.ndarray, question: np.ndarray, out: np.ndarray) -> None:
    """Answers of training samples `rows` to one question, probe offsets (4,) in metres: fills `out` (len(rows),)."""
    two = np.zeros((4, 2), dtype=np.float32)  # of two questions the second has two probes
    two[:, 1] = question
    places, beyond, both = np.empty(2, dtype=np.int32), np.empty(2), np.empty(2, dtype=np.float32)
    for n in range(rows.shape[0]):
        _ask(samples, rows[n], two, places, beyond, both)
        out[n] = both[1]


@njit(cache=True, nogil=True)
def best_split(
    samples: Samples, labels: np.ndarray, rows: np.ndarray, questions: np.ndarray, bins: int, classes: int
) -> tuple[int, float, float]:
    """The question and threshold that leave the least label entropy: (question, threshold, entropy).

    `questions` float32 (4, Q) are probe offsets in metres, of which the first half has the pixel itself as the second;
    thresholds are the borders of `bins` equal bins over +-REACH / 2. Entropy is summed over the samples `rows`, in
    nats; -1 as question where none separates them.
    """
    label_of, present = _numbered(labels, rows, classes)
    total = np.zeros(present, dtype=np.int32)
    for label in label_of:
        total[label] += 1
    scaled_log = np.zeros(rows.shape[0] + 1)  # logarithms are looked up, not taken
    for n in range(2, rows.shape[0] + 1):
        scaled_log[n] = n * np.log(n)
    bin_of = _bins(samples, rows, questions, bins)
    best, best_border, best_entropy = -1, 0, np.inf
    histogram = np.zeros((bins, present), dtype=np.int32)
    for q in range(questions.shape[1]):
        for n in range(rows.shape[0]):
            histogram[bin_of[q, n], label_of[n]] += 1
        border, entropy = _best_border(histogram, total, scaled_log)
        if entropy < best_entropy:
            best, best_border, best_entropy = q, border, entropy
    return best, -0.5 * REACH + (best_border + 1) * REACH / bins, best_entropy


@njit(cache=True, nogil=True)
def _numbered(labels: np.ndarray, rows: np.ndarray, classes: int) -> tuple[np.ndarray, int]:
    """Labels of `rows` numbered in the order in which they come, and how many there are: few near the leaves."""
    number = np.full(classes, -1, dtype=np.int32)
    label_of = np.empty(rows.shape[0], dtype=np.int32)
    present = 0
    for n in range(rows.shape[0]):
        label = labels[rows[n]]
        if number[label] < 0:
            number[label] = present
            present += 1
        label_of[n] = number[label]
    return label_of, present


@njit(cache=True, nogil=True)
def _bins(samples: Samples, rows: np.ndarray, questions: np.ndarray, bins: int) -> np.ndarray:
    """Bin of the answer of each of `rows` to each question: uint8 (Q, len(rows))."""
    count = questions.shape[1]
    bin_of = np.empty((count, rows.shape[0]), dtype=np.uint8)
    places, beyond = np.empty(count, dtype=np.int32), np.empty(count)
    answer = np.empty(count, dtype=np.float32)
    # All questions are put to one sample before the next: its image then stays in the cache.
    for n in range(rows.shape[0]):
        _ask(samples, rows[n], questions, places, beyond, answer)
        for q in range(count):
            b = np.int32(np.floor((answer[q] / REACH + 0.5) * bins))
            bin_of[q, n] = min(max(b, 0), bins - 1)
    return bin_of


@njit(cache=True, nogil=True)
def _best_border(histogram: np.ndarray, total: np.ndarray, scaled_log: np.ndarray) -> tuple[int, float]:
    """The last bin below the border that leaves the least entropy, and that entropy; infinite where none separates.

    `histogram` (bins, labels) counts the samples and is empty afterwards, `total` (labels,) all of a label;
    `scaled_log[n]` is n log n.
    """
    below = np.zeros(total.shape[0], dtype=np.int32)
    count, under = total.sum(), 0
    mixed = 0.0  # what the labels on both sides take off the entropy; changes only by those of the next bin
    for c in range(total.shape[0]):
        mixed += scaled_log[total[c]]
    best, least = -1, np.inf
    for b in range(histogram.shape[0]):
        before = under
        for c in range(total.shape[0]):
            more = histogram[b, c]
            if more > 0:
                histogram[b, c] = 0
                mixed -= scaled_log[below[c]] + scaled_log[total[c] - below[c]]
                below[c] += more
                mixed += scaled_log[below[c]] + scaled_log[total[c] - below[c]]
                under += more
        if under == before or under == count:
            continue
        entropy = scaled_log[under] + scaled_log[count - under] - mixed
        if entropy < least:
            best, least = b, entropy
    return best, least


@njit(cache=True, nogil=True)
def judges_of(rows: np.ndarray, most: int, state: np.ndarray) -> np.ndarray:
    """At most `most` of the rows: one at random of each of as many equal stretches."""
    if rows.shape[0] <= most:
        return rows
    judges = np.empty(most, dtype=rows.dtype)
    for n in range(most):
        judges[n] = rows[int((n + _random(state)) * rows.shape[0] / most)]
    return judges


@njit(cache=True, nogil=True)
def _parted(samples: Samples, rows: np.ndarray, question: np.ndarray, threshold: float) -> tuple[np.ndarray, int]:
    """The rows below the threshold, then the others, each in their order; and how many are below."""
    answer = np.empty(rows.shape[0], dtype=np.float32)
    answers(samples, rows, question, answer)
    parted, limit, below = np.empty_like(rows), np.float32(threshold), 0
    for n in range(rows.shape[0]):
        if answer[n] < limit:
            parted[below] = rows[n]
            below += 1
    at = below
    for n in range(rows.shape[0]):
        if not answer[n] < limit:
            parted[at] = rows[n]
            at += 1
    return parted, below


@njit(cache=True, nogil=True)
def grow(samples: Samples, labels: np.ndarray, rows: np.ndarray, path: int, seed: int, growth: Growth) -> Tree:
    """Grow the tree of samples `rows` (N,) by greedy splits of least label entropy; `rows` are put in leaves' order.

    The tree begins at the end of `path` (see `Tree`). Every node has a random stream of its own, of `seed` and its
    path, so that a part grows as it would in the whole.
    """
    most = max(rows.shape[0] // max(growth.smallest_leaf // 2, 1), 1)
    offsets, thresholds = np.empty((most, 4), dtype=np.float32), np.empty(most, dtype=np.float32)
    children = np.zeros((most, 2), dtype=np.int32)
    starts, paths = np.empty(most + 1, dtype=np.int64), np.empty(most, dtype=np.int64)
    nodes, leaves = 0, 0
    pending = [(0, rows.shape[0], path, -1, 0)]
    state = np.empty(1, dtype=np.uint64)
    while len(pending) > 0:
        begin, end, way, parent, side = pending.pop()
        part, below = rows[begin:end], 0
        state[0] = np.uint64(seed) ^ (np.uint64(way) * np.uint64(0xD1342543DE82EF95))
        level, up = 0, way
        while up > 1:
            level, up = level + 1, up >> 1
        if level < growth.deepest and part.shape[0] >= 2 * growth.smallest_leaf:
            judges = judges_of(part, growth.node_samples, state)
            count = min(max(judges.shape[0] // JUDGES_A_QUESTION, FEWEST_QUESTIONS), growth.questions)
            questions = random_questions(count, state)
            best, threshold, _ = best_split(samples, labels, judges, questions, growth.bins, growth.classes)
            if best >= 0:
                parted, below = _parted(samples, part, questions[:, best], threshold)
                if min(below, part.shape[0] - below) < max(growth.smallest_leaf // 2, 1):
                    below = 0
        if below == 0:
            here = -1 - leaves
            starts[leaves], paths[leaves] = begin, way
            leaves += 1
        else:
            here = nodes
            part[:] = parted
            offsets[nodes], thresholds[nodes] = questions[:, best], threshold
            nodes += 1
            pending.append((begin + below, end, 2 * way + 1, here, 1))
            pending.append((begin, begin + below, 2 * way, here, 0))
        if parent >= 0:
            children[parent, side] = here
    starts[leaves] = rows.shape[0]
    return Tree(
        offsets[:nodes].copy(), thresholds[:nodes].copy(), children[:nodes].copy(), starts[: leaves + 1].copy(),
        paths[:leaves].copy(),
    )  # fmt: skip
