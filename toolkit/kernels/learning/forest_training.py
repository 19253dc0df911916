"""Training of a regression forest on depth images: questions to stored crops and the splits they make, compiled.

Questions are those of `toolkit.kernels.learning.forest`, put to images of level cameras.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from toolkit.kernels.learning.forest import REACH, UNOBSERVED


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


@njit(cache=True)
def _stored_probe(samples: Samples, k: int, iu: int, iv: int, z: float) -> float:
    """`probe` at pixel (iu, iv) of training image k."""
    height, width = samples.shapes[k, 0], samples.shapes[k, 1]
    if iu < 0 or iv < 0 or iv >= height or iu >= width:
        window = samples.windows[k]
        outside = iu < window[0] or iu > window[1] or iv < window[2] or iv > window[3]
        return -REACH if outside else REACH
    d = samples.images[samples.starts[k] + iv * width + iu]
    if d == 0:
        return REACH
    if d == UNOBSERVED:
        return -REACH
    return min(max(d * 0.001 - z, -REACH), REACH)


@njit(cache=True)
def _ask(samples: Samples, s: int, candidates: np.ndarray, out: np.ndarray) -> None:
    """Answers of sample s to the questions `candidates` (Q, 4), probe offsets in metres: fills `out` (Q,)."""
    k, u, v = samples.image[s], samples.u[s], samples.v[s]
    z = samples.images[samples.starts[k] + v * samples.shapes[k, 1] + u] * 0.001
    scale = samples.focal / z  # pixels that a metre covers there
    for q in range(candidates.shape[0]):
        iu = int(np.floor(u + scale * candidates[q, 0] + 0.5))
        iv = int(np.floor(v + scale * candidates[q, 1] + 0.5))
        answer = _stored_probe(samples, k, iu, iv, z)
        if candidates[q, 2] != 0.0 or candidates[q, 3] != 0.0:  # else the second probe is the pixel itself
            iu = int(np.floor(u + scale * candidates[q, 2] + 0.5))
            iv = int(np.floor(v + scale * candidates[q, 3] + 0.5))
            answer -= _stored_probe(samples, k, iu, iv, z)
        out[q] = answer


@njit(cache=True)
def answers(samples: Samples, rows: np.ndarray, offsets: np.ndarray, out: np.ndarray) -> None:
    """Answers of training samples `rows` to one question, probe offsets (4,) in metres: fills `out` (len(rows),)."""
    one = offsets.reshape(1, 4)
    for n in range(rows.shape[0]):
        _ask(samples, rows[n], one, out[n : n + 1])


@njit(cache=True)
def best_split(
    samples: Samples, labels: np.ndarray, rows: np.ndarray, candidates: np.ndarray, bins: int, classes: int
) -> tuple[int, float, float]:
    """The candidate question and threshold that leave the least label entropy: (candidate, threshold, entropy).

    `candidates` (Q, 4) are probe offsets in metres; thresholds are the borders of `bins` equal bins over +-REACH / 2.
    Entropy is summed over the samples `rows`, in nats; -1 as candidate where no question separates them.
    """
    low, width = -0.5 * REACH, REACH / bins
    label_of, present = _numbered(labels, rows, classes)
    total = np.zeros(present, dtype=np.int64)
    for label in label_of:
        total[label] += 1
    scaled_log = np.zeros(rows.shape[0] + 1)  # logarithms are looked up, not taken
    for n in range(2, rows.shape[0] + 1):
        scaled_log[n] = n * np.log(n)
    bin_of = _bins(samples, rows, candidates, bins)
    best, best_threshold, best_entropy = -1, 0.0, np.inf
    histogram = np.zeros((bins, present), dtype=np.int64)
    for q in range(candidates.shape[0]):
        histogram[:] = 0
        for n in range(rows.shape[0]):
            histogram[bin_of[q, n], label_of[n]] += 1
        border, entropy = _best_border(histogram, total, scaled_log)
        if entropy < best_entropy:
            best, best_threshold, best_entropy = q, low + (border + 1) * width, entropy
    return best, best_threshold, best_entropy


@njit(cache=True)
def _numbered(labels: np.ndarray, rows: np.ndarray, classes: int) -> tuple[np.ndarray, int]:
    """Labels of `rows` numbered in the order in which they come, and how many there are: few near the leaves."""
    number = np.full(classes, -1, dtype=np.int64)
    label_of = np.empty(rows.shape[0], dtype=np.int64)
    present = 0
    for n in range(rows.shape[0]):
        label = labels[rows[n]]
        if number[label] < 0:
            number[label] = present
            present += 1
        label_of[n] = number[label]
    return label_of, present


@njit(cache=True)
def _bins(samples: Samples, rows: np.ndarray, candidates: np.ndarray, bins: int) -> np.ndarray:
    """Bin of the answer of each of `rows` to each candidate question: uint8 (Q, len(rows))."""
    low, width = -0.5 * REACH, REACH / bins
    bin_of = np.empty((candidates.shape[0], rows.shape[0]), dtype=np.uint8)
    answer = np.empty(candidates.shape[0], dtype=np.float32)
    # All questions are put to one sample before the next: its image then stays in the cache.
    for n in range(rows.shape[0]):
        _ask(samples, rows[n], candidates, answer)
        for q in range(candidates.shape[0]):
            b = int(np.floor((answer[q] - low) / width))
            bin_of[q, n] = min(max(b, 0), bins - 1)
    return bin_of


@njit(cache=True)
def _best_border(histogram: np.ndarray, total: np.ndarray, scaled_log: np.ndarray) -> tuple[int, float]:
    """The last bin below the border that leaves the least entropy, and that entropy; infinite where none separates.

    `histogram` (bins, labels) counts the samples, `total` (labels,) all of a label; `scaled_log[n]` is n log n.
    """
    below = np.zeros(total.shape[0], dtype=np.int64)
    count, under = total.sum(), 0
    mixed = 0.0  # what the labels on both sides take off the entropy; changes only by those of the next bin
    for c in range(total.shape[0]):
        mixed += scaled_log[total[c]]
    best, least = -1, np.inf
    for b in range(histogram.shape[0] - 1):
        before = under
        for c in range(total.shape[0]):
            more = histogram[b, c]
            if more > 0:
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
