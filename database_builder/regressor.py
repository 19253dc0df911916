"""Trains the joint regressor of a database on views of its own poses (`database_builder.views`)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from database_builder.calibration import calibrated
from database_builder.growing import grow_trees, together
from database_builder.images import TrainingImages, draw_images
from database_builder.kept import KeptFile
from database_builder.processes import process_pool
from database_builder.room_views import NO_PERSON
from database_builder.views import FOCAL, ViewSettings
from toolkit.io.errors import SettingsError
from toolkit.io.progress import Count, silent
from toolkit.kernels.cache import sources_digest
from toolkit.kernels.learning.forest_training import Growth, Samples, Tree
from toolkit.landmarks.regressor import OFFSET_UNIT, JointRegressor, sureness


@dataclass(frozen=True)
class RegressorSettings:
    """How the regressor is trained.

    Attributes
    ----------
    images : depth images drawn, each of another pose, shape, view and distance
    pixels : training pixels per image
    trees, depth : size of the forest
    smallest_leaf : training pixels below which a node is not split
    questions : questions tried per node of many samples
    bins : thresholds per question
    node_samples : pixels of a node that judge the questions, at most
    views : what the images show
    calibration : further images on which it is found out what the forest's numbers are worth
    """

    images: int = 43000
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


IMAGES = "images-*.npz"
"""Files that keep what was drawn until trees have grown."""
DRAWN_TOGETHER = 1000
"""Images that a process draws in one go, about two seconds."""
FEWEST = 5
"""Samples of a leaf that must show a joint before they alone say where it is."""
COARSENESS = 0.5
"""Step of a leaf's offsets at most, of their standard deviation."""
SHARE_STEP = 8.5
"""In which a leaf's shares in view are told, of 255."""
JUDGED_TOGETHER = 100_000
"""Samples whose leaves are worked out in one go: 24 MB of offsets."""


def train_regressor(
    poses: np.ndarray,
    settings: RegressorSettings | None = None,
    *,
    seed: int = 0,
    workers: int = 1,
    kept: Path | None = None,
    progress: Count = silent,
) -> JointRegressor:
    """Train the joint regressor of canonical database poses (N, P).

    Images are drawn in `workers` processes and trees grow in as many threads, from random streams of their own, so that
    the result does not depend on their number. What was drawn and what was grown is kept in the folder `kept`, where
    there is one, and used again. `progress(done, total)` counts images, then parts of trees, then views.
    """
    settings = settings or RegressorSettings()
    drawing, growing, judging = np.random.default_rng(seed).spawn(3)
    key = _key(poses, settings, seed)
    grown = KeptFile(kept and kept / "forest.npz", key)
    if (arrays := grown.load()) is not None:
        trained = JointRegressor(**arrays)
    else:
        data = _drawn(poses, settings, drawing, workers, kept, key, progress)
        trained = _grown(data, settings, growing, workers, progress)
        if kept and not grown.save(trained.arrays()):
            for path in kept.glob(IMAGES):  # of no more use: the forest takes their place on a full disk
                path.unlink(missing_ok=True)
            grown.save(trained.arrays())
    return calibrated(trained, poses, settings.views, settings.calibration, judging, progress)


def _key(poses: np.ndarray, settings: RegressorSettings, seed: int) -> str:
    """Names everything that drawn images and grown trees depend on, the code that makes them too."""
    digest = hashlib.sha256(repr((asdict(settings), seed, sources_digest())).encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    digest.update(np.ascontiguousarray(poses).tobytes())
    return digest.hexdigest()


def _drawn(
    poses: np.ndarray, settings: RegressorSettings, rng: np.random.Generator, workers: int, kept: Path | None, key: str,
    progress: Count,
) -> TrainingImages:  # fmt: skip
    """All training images, drawn side by side."""
    counts = [min(DRAWN_TOGETHER, settings.images - i) for i in range(0, settings.images, DRAWN_TOGETHER)]
    tasks = [
        (count, stream, KeptFile(kept and kept / IMAGES.replace("*", f"{number:04}"), f"{key} {number}"))
        for number, (count, stream) in enumerate(zip(counts, rng.spawn(len(counts)), strict=True))
    ]
    with process_pool(workers if len(tasks) > 1 else 1) as mapped:
        return gathered(_told(mapped(partial(_draw, poses, settings), tasks), counts, progress))


def _told(parts: Iterable[TrainingImages], counts: list[int], progress: Count) -> Iterator[TrainingImages]:
    """The parts, of so many images each, as they are drawn."""
    for number, part in enumerate(parts, start=1):
        yield part
        progress(sum(counts[:number]), sum(counts))


def _draw(
    poses: np.ndarray, settings: RegressorSettings, task: tuple[int, np.random.Generator, KeptFile]
) -> TrainingImages:
    count, stream, kept = task
    if (arrays := kept.load()) is not None:
        return TrainingImages(**arrays)
    data = draw_images(poses, settings.views, count, settings.pixels, stream, lambda done, total: None)
    kept.save(vars(data))
    return data


def gathered(parts: Iterable[TrainingImages]) -> TrainingImages:
    """Images of several drawings as of one. Arrays grow where they lie, so that memory is taken once."""
    drawn = iter(parts)
    whole = TrainingImages(**{name: column.copy() for name, column in vars(next(drawn)).items()})
    for part in drawn:
        part.starts = part.starts + len(whole.depth)
        part.sample_image = part.sample_image + np.int32(len(whole.starts))
        for name, column in vars(part).items():
            grown = getattr(whole, name)
            first = len(grown)
            grown.resize((first + len(column), *grown.shape[1:]), refcheck=False)
            grown[first:] = column
    return whole


def _grown(
    data: TrainingImages, settings: RegressorSettings, rng: np.random.Generator, workers: int, progress: Count
) -> JointRegressor:
    """The forest of training images, not yet calibrated. Their depth is let go of when trees have grown."""
    grown = _trees(data, settings, rng, workers, progress)
    data.depth = np.empty(0, dtype=np.uint16)
    leaves = [leaf for tree, rows in grown for leaf in _leaves(data, tree, rows)]
    offsets, sure, share, person = (np.concatenate(column) for column in zip(*leaves, strict=True))
    forest, roots = together([tree for tree, _ in grown])
    return JointRegressor(
        forest.offsets, forest.thresholds, forest.children, roots, offsets, sure, share, leaf_person=person
    )


def _trees(
    data: TrainingImages, settings: RegressorSettings, rng: np.random.Generator, workers: int, progress: Count
) -> list[tuple[Tree, np.ndarray]]:
    """See `grow_trees`."""
    samples = Samples(
        data.depth, data.starts, data.shapes, data.windows, FOCAL, data.sample_image, data.sample_u, data.sample_v
    )
    growth = Growth(
        settings.depth, settings.smallest_leaf, settings.questions, settings.bins,
        settings.node_samples, int(data.labels.max()) + 1,
    )  # fmt: skip
    seeds = [int(seed) for seed in rng.integers(1 << 62, size=settings.trees)]
    return grow_trees(samples, data.labels, growth, seeds, workers, progress)


def coarse_offsets(mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Mean offsets (K, 20, 3), metres, of these variances (K, 20), square metres, as `JointRegressor.leaf_offsets`.

    They are rounded to centimetres, those of a large spread to 2, 4, ... 32 cm, a quarter of it to a half: no more is
    known of a mean of a few dozen samples, and half of the bytes are saved.
    """
    spread = np.sqrt(np.clip(variance, 1e-6, 1.0)) / OFFSET_UNIT
    step = 2.0 ** np.clip(np.floor(np.log2(COARSENESS * spread)), 0, 5)[..., None]
    most = np.floor(127 / step)
    return (step * np.clip(np.rint(mean / OFFSET_UNIT / step), -most, most)).astype(np.int8)


def coarse_sureness(variance: np.ndarray) -> np.ndarray:
    """`sureness` of variances (K, 20), square metres, rounded by at most a sixteenth of itself."""
    sure = sureness(variance).astype(np.float64)
    step = 2.0 ** np.floor(np.log2(np.maximum(sure, 8.0)) - 3.0)
    return np.minimum(step * np.rint(sure / step), 255.0).astype(np.uint8)


def _leaves(data: TrainingImages, tree: Tree, rows: np.ndarray) -> Iterator[tuple[np.ndarray, ...]]:
    """`leaf_votes` of all leaves of a tree as a forest stores them, some leaves at a time."""
    first = 0
    while first < len(tree.paths):
        last = int(np.searchsorted(tree.starts, tree.starts[first] + JUDGED_TOGETHER, side="right")) - 1
        last = min(max(last, first + 1), len(tree.paths))
        starts = tree.starts[first : last + 1]
        mean, variance, share, person = leaf_votes(data, rows[starts[0] : starts[-1]], starts - starts[0])
        yield (
            coarse_offsets(mean, variance),
            coarse_sureness(variance),
            (SHARE_STEP * np.rint(255.0 / SHARE_STEP * share)).astype(np.uint8),
            np.rint(255.0 * person).astype(np.uint8),
        )
        first = last


def leaf_votes(
    data: TrainingImages, rows: np.ndarray, starts: np.ndarray | Sequence[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What leaves of samples `rows[starts[k] : starts[k + 1]]` know of the joints, and of who is there at all.

    Returns
    -------
    mean offset (K, 20, 3) and its variance (K, 20), metres and square metres, of the people's samples whose image shows
    the joint, of all of people where hardly any does, endless where hardly any is of people; share of the people's
    samples (K, 20) whose image shows it; share of the samples (K,) that are of people
    """
    begins, sizes = np.asarray(starts)[:-1], np.diff(starts)
    leaf = np.repeat(np.arange(len(sizes)), sizes)
    person = (data.labels[rows] != NO_PERSON).astype(np.float32)
    people = np.add.reduceat(person, begins)
    votes = data.offsets(rows)
    shown = data.in_view[data.sample_image[rows]] * person[:, None]
    count = np.add.reduceat(shown, begins)
    share = np.where(people[:, None] > 0, count / np.maximum(people, 1.0)[:, None], 0.5)
    few = count < FEWEST
    shown = np.where(few[leaf], person[:, None], shown)
    count = np.maximum(np.where(few, people[:, None], count), 1.0)
    mean = np.add.reduceat(votes * shown[:, :, None], begins) / count[:, :, None]
    apart = ((votes - mean[leaf]) ** 2).sum(axis=2) * shown
    variance = np.add.reduceat(apart, begins) / count
    variance[people < np.minimum(FEWEST, sizes)] = np.inf
    return mean, variance, share, people / sizes
