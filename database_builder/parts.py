"""Trains the joint regressor of a database on views of its own poses (`database_builder.views`)."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from itertools import repeat

import numpy as np

from database_builder.calibration import calibrated
from database_builder.views import FOCAL, TrainingImages, ViewSettings, draw_images
from toolkit.errors import SettingsError
from toolkit.kernels.learning import forest_training
from toolkit.landmarks.parts import OFFSET_UNIT, JointForest, sureness
from toolkit.progress import Count


@dataclass(frozen=True)
class PartsSettings:
    """How the regressor is trained.

    Attributes
    ----------
    images : depth images drawn, each of another pose, shape, view and distance
    pixels : training pixels per image
    trees, depth : size of the forest
    smallest_leaf : training pixels below which a node is not split
    questions, bins : questions tried per node, and thresholds per question
    node_samples : pixels of a node that judge the questions, at most
    views : what the images show
    calibration : further images on which it is found out what the forest's numbers are worth
    """

    images: int = 30000
    pixels: int = 120
    trees: int = 3
    depth: int = 22
    smallest_leaf: int = 30
    questions: int = 120
    bins: int = 24
    node_samples: int = 1000
    views: ViewSettings = field(default_factory=ViewSettings)
    calibration: int = 600

    def __post_init__(self) -> None:
        if min(self.images, self.pixels, self.trees, self.depth, self.questions) < 1 or self.bins < 2:
            raise SettingsError("parts: images, pixels, trees, depth and questions are at least 1, bins at least 2")


Tree = tuple[list[np.ndarray], list[float], list[list[int]], list[np.ndarray]]


def _grow_trees(
    data: TrainingImages, settings: PartsSettings, streams: list[np.random.Generator], workers: int
) -> Iterator[Tree]:
    if workers <= 1:
        yield from (grow_tree(data, settings, stream) for stream in streams)
        return
    with ProcessPoolExecutor(min(workers, len(streams))) as pool:
        yield from pool.map(grow_tree, repeat(data), repeat(settings), streams)


def grow_tree(data: TrainingImages, settings: PartsSettings, rng: np.random.Generator) -> Tree:
    """One tree by greedy splits of least label entropy: probe offsets, thresholds, children, the rows of each leaf."""
    offsets: list[np.ndarray] = []
    thresholds: list[float] = []
    children: list[list[int]] = []
    leaves: list[np.ndarray] = []
    classes = int(data.labels.max()) + 1
    pending: list[tuple[np.ndarray, int, int, int]] = [(np.arange(len(data.labels), dtype=np.int64), 0, -1, 0)]
    while pending:
        rows, level, parent, side = pending.pop()
        split = None
        if level < settings.depth and len(rows) >= 2 * settings.smallest_leaf:
            split = _split(data, rows, settings, classes, rng)
        if split is None:
            here = -1 - len(leaves)
            leaves.append(rows)
        else:
            here = len(thresholds)
            probes, threshold, answer = split
            offsets.append(probes)
            thresholds.append(threshold)
            children.append([0, 0])
            pending.append((rows[answer >= threshold], level + 1, here, 1))
            pending.append((rows[answer < threshold], level + 1, here, 0))
        if parent >= 0:
            children[parent][side] = here
    return offsets, thresholds, children, leaves


def _split(
    data: TrainingImages, rows: np.ndarray, settings: PartsSettings, classes: int, rng: np.random.Generator
) -> tuple[np.ndarray, float, np.ndarray] | None:
    """Best question of a node, its threshold and its answers for all rows; None where no good one separates them."""
    # Probes reach up to 0.8 m, most of them less; every other question compares one probe with the pixel itself.
    radius = 0.8 * rng.random((settings.questions, 2)) ** 1.5
    angle = rng.uniform(0.0, 2.0 * np.pi, (settings.questions, 2))
    radius[::2, 1] = 0.0
    candidates = np.stack(
        [radius[:, 0] * np.cos(angle[:, 0]), radius[:, 0] * np.sin(angle[:, 0]),
         radius[:, 1] * np.cos(angle[:, 1]), radius[:, 1] * np.sin(angle[:, 1])], axis=1,
    )  # fmt: skip
    judges = rows if len(rows) <= settings.node_samples else rng.choice(rows, settings.node_samples, replace=False)
    samples = forest_training.Samples(
        data.depth, data.starts, data.shapes, data.windows, FOCAL, data.sample_image, data.sample_u, data.sample_v
    )
    best, threshold, _ = forest_training.best_split(samples, data.labels, judges, candidates, settings.bins, classes)
    if best < 0:
        return None
    answer = np.empty(len(rows), dtype=np.float32)
    forest_training.answers(samples, rows, candidates[best], answer)
    below = int((answer < threshold).sum())
    if min(below, len(rows) - below) < settings.smallest_leaf // 2:
        return None
    return candidates[best], threshold, answer


def train_forest(
    poses: np.ndarray,
    settings: PartsSettings | None = None,
    *,
    seed: int = 0,
    workers: int = 1,
    progress: Count | None = None,
) -> JointForest:
    """Train the joint regressor of canonical database poses (N, P).

    Trees grow in `workers` processes, each from a random stream of its own, so that the result does not depend on their
    number. `progress(done, total)` counts images, then finished trees.
    """
    settings = settings or PartsSettings()
    report = progress or (lambda done, total: None)
    streams = np.random.default_rng(seed).spawn(settings.trees + 2)
    data = draw_images(poses, settings.views, settings.images, settings.pixels, streams[0], report)
    offsets: list[np.ndarray] = []
    thresholds: list[float] = []
    children: list[list[int]] = []
    roots: list[int] = []
    means: list[np.ndarray] = []
    sure: list[np.ndarray] = []
    shares: list[np.ndarray] = []
    for number, grown in enumerate(_grow_trees(data, settings, streams[1:-1], workers)):
        tree_offsets, tree_thresholds, tree_children, leaves = grown
        report(number + 1, settings.trees)
        nodes, first_leaf = len(thresholds), len(means)
        roots.append(nodes if tree_thresholds else -1 - first_leaf)
        offsets += tree_offsets
        thresholds += tree_thresholds
        children += [[c + nodes if c >= 0 else c - first_leaf for c in pair] for pair in tree_children]
        for rows in leaves:
            mean, variance, share = leaf_votes(data, rows)
            means.append(np.clip(np.rint(mean / OFFSET_UNIT), -127, 127))
            sure.append(sureness(variance))
            shares.append(np.rint(255.0 * share))
    trained = JointForest(
        np.array(offsets, dtype=np.float32).reshape(-1, 4),
        np.array(thresholds, dtype=np.float32),
        np.array(children, dtype=np.int32).reshape(-1, 2),
        np.array(roots, dtype=np.int32),
        np.array(means, dtype=np.int8),
        np.array(sure, dtype=np.uint8),
        np.array(shares, dtype=np.uint8),
    )
    return calibrated(trained, poses, settings.views, settings.calibration, streams[-1], report)


FEWEST = 5
"""Samples of a leaf that must show a joint before they alone say where it is."""


def leaf_votes(data: TrainingImages, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What samples `rows` of a leaf know of the joints: mean offset (20, 3), its variance (20,), share in view (20,).

    Mean (metres) and variance (square metres) are those of the samples whose image shows the joint, of all samples
    where hardly any does.
    """
    votes = data.offsets[rows].astype(np.float32)
    shown = data.in_view[data.sample_image[rows]].astype(np.float32)
    share = shown.mean(axis=0)
    shown[:, shown.sum(axis=0) < FEWEST] = 1.0
    count = shown.sum(axis=0)
    mean = (votes * shown[:, :, None]).sum(axis=0) / count[:, None]
    variance = (((votes - mean) ** 2).sum(axis=2) * shown).sum(axis=0) / count
    return mean, variance, share
