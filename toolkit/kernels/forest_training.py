"""Training of a regression forest on depth images: questions to stored crops and the splits they make, compiled.

Questions are those of `toolkit.kernels.forest`, put to images of level cameras.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.forest import REACH, UNOBSERVED


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
