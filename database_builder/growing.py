"""Grows the trees of a joint regressor in threads, which share the training images."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np

from toolkit.io.progress import Count
from toolkit.kernels.learning.forest_training import Growth, Samples, Tree, grow

TOP = 6
"""Level of a tree from which on its parts grow by themselves, in any order."""


def grow_trees(
    samples: Samples, labels: np.ndarray, growth: Growth, seeds: Sequence[int], workers: int, progress: Count
) -> list[tuple[Tree, np.ndarray]]:
    """One tree for each seed, and the samples int32 (N,) in the order of its leaves.

    Every node has a random stream of its own, so that the trees do not depend on the number of threads.
    `progress(done, total)` counts the parts that have grown.
    """
    tops, tasks = [], []
    for seed in seeds:
        rows = np.arange(len(labels), dtype=np.int32)
        top = grow(samples, labels, rows, 1, seed, growth._replace(deepest=min(TOP, growth.deepest)))
        tops.append((top, rows))
        tasks += [(rows[a:b], int(path), seed) for (a, b), path in zip(pairwise(top.starts), top.paths, strict=True)]
    with ThreadPoolExecutor(max(workers, 1)) as pool:
        grown = []
        for part in pool.map(lambda task: grow(samples, labels, task[0], task[1], task[2], growth), tasks):
            grown.append(part)
            progress(len(grown), len(tasks))
    parts = iter(grown)
    return [(_joined(top, [next(parts) for _ in top.paths]), rows) for top, rows in tops]


def together(trees: Sequence[Tree]) -> tuple[Tree, np.ndarray]:
    """Trees one after the other, as of one; and the first node of each, -1 - leaf where it is but a leaf."""
    first_node = np.cumsum([0, *(len(tree.thresholds) for tree in trees)])
    first_leaf = np.cumsum([0, *(len(tree.paths) for tree in trees)])
    children = [
        np.where(tree.children < 0, tree.children - leaf, tree.children + node)
        for tree, node, leaf in zip(trees, first_node[:-1], first_leaf[:-1], strict=True)
    ]
    begun = np.cumsum([0, *(tree.starts[-1] for tree in trees)])
    starts = [tree.starts[:-1] + start for tree, start in zip(trees, begun[:-1], strict=True)]
    roots = np.where(np.diff(first_node) > 0, first_node[:-1], -1 - first_leaf[:-1])
    one = Tree(
        np.concatenate([tree.offsets for tree in trees]),
        np.concatenate([tree.thresholds for tree in trees]),
        np.concatenate(children).astype(np.int32),
        np.concatenate([*starts, begun[-1:]]),
        np.concatenate([tree.paths for tree in trees]),
    )
    return one, roots.astype(np.int32)


def _joined(top: Tree, parts: Sequence[Tree]) -> Tree:
    """The tree whose leaf k goes on as `parts[k]`."""
    below, roots = together(parts)
    nodes = len(top.thresholds)
    begins = np.where(roots >= 0, roots + nodes, roots)
    return Tree(
        np.concatenate([top.offsets, below.offsets]),
        np.concatenate([top.thresholds, below.thresholds]),
        np.concatenate(
            [
                np.where(top.children < 0, begins[-1 - top.children], top.children),
                np.where(below.children < 0, below.children, below.children + nodes),
            ]
        ).astype(np.int32),
        below.starts,
        below.paths,
    )
