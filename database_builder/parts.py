"""Trains the joint regressor of a database on depth images drawn from its own poses over the shape space."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import repeat

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.errors import SettingsError
from toolkit.kernels import forest, kinematics, raster
from toolkit.landmarks.parts import OFFSET_UNIT, JointForest, sureness
from toolkit.sensing.camera import level_rotation

Progress = Callable[[int, int], None]


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
    turned : share of the images that show the person from any side; the others from within 60 degrees of the front
    cut : share of the images that show the person from the waist, the thighs or the knees up only
    """

    images: int = 24000
    pixels: int = 120
    trees: int = 3
    depth: int = 22
    smallest_leaf: int = 30
    questions: int = 120
    bins: int = 24
    node_samples: int = 1000
    turned: float = 0.5
    cut: float = 0.2

    def __post_init__(self) -> None:
        if min(self.images, self.pixels, self.trees, self.depth, self.questions) < 1 or self.bins < 2:
            raise SettingsError("parts: images, pixels, trees, depth and questions are at least 1, bins at least 2")


FOCAL = 150.0
"""Pixels: half the resolution of a Kinect; questions are in metres, so any other serves as well."""
MARGIN = 2
CUT = (0.4, 0.8)
"""Share of the person's height in the image above which the rest is beyond the border, where it is cut off."""
BALANCE = 0.7
"""Exponent that evens out the parts among an image's training pixels: 0 as they are seen, 1 all parts alike."""


@dataclass
class TrainingImages:
    """Drawn people: crops end to end in `depth` (uint16 millimetres), and the pixels chosen from them."""

    depth: np.ndarray
    starts: np.ndarray
    shapes: np.ndarray
    sample_image: np.ndarray
    sample_u: np.ndarray
    sample_v: np.ndarray
    labels: np.ndarray
    offsets: np.ndarray


def body_labels(body: Body) -> np.ndarray:
    """int64 (V,): two labels per joint, which the questions learn to tell apart.

    Parts on the body's midline split into left and right, limbs into the half near the joint and the far half.
    """
    label = np.empty(len(body.vertices), dtype=np.int64)
    for joint, name in enumerate(skeleton.JOINT_NAMES):
        members = body.part == joint
        along = body.vertices[members] - body.joints[joint]
        if name.startswith(("left_", "right_")):
            reach = np.linalg.norm(along, axis=1)
            far = reach > np.median(reach) if members.any() else reach
        else:
            far = along[:, 0] > 0.0
        label[members] = 2 * joint + far
    return label


def draw_images(
    poses: np.ndarray, settings: PartsSettings, rng: np.random.Generator, progress: Progress
) -> TrainingImages:
    """Draw people in database poses (N, P) over the shape space, from many views, with the faults of depth sensors."""
    space = ShapeSpace.load()
    labels_of_vertex = body_labels(space.body())
    faces = space.faces.astype(np.int64)
    intrinsics = np.array([FOCAL, FOCAL, 0.0, 0.0])
    count = len(skeleton.JOINTS)
    vectors, rotations, origins = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3))
    crops: list[np.ndarray] = []
    shapes: list[tuple[int, int]] = []
    columns: list[tuple[np.ndarray, ...]] = []
    for image in range(settings.images):
        if image % 500 == 0:
            progress(image, settings.images)
        coefficients = np.clip(rng.normal(0.0, 0.9, space.size), -2.0, 2.0)
        body = space.body(coefficients)
        pose = _view_pose(poses[rng.integers(len(poses))], settings.turned, rng)
        tilt = np.clip(rng.normal(0.0, 0.12), -0.35, 0.35)
        from_level = level_rotation(np.array([0.0, -np.cos(tilt), -np.sin(tilt)])).T
        kinematics.forward_kinematics(
            pose, skeleton.PARENTS, body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS, vectors, rotations, origins
        )
        vertices = np.empty_like(body.vertices)
        kinematics.skin(body.vertices, body.skin_joints, body.skin_weights, body.joints, rotations, origins, vertices)
        # The camera looks at the person from `distance`, who may stand aside and above or below the axis.
        direction = from_level.T @ np.array([rng.uniform(-0.35, 0.35), rng.uniform(-0.25, 0.25), 1.0])
        root = rng.uniform(1.7, 4.2) * direction
        camera = (vertices + root) @ from_level.T
        projected = np.empty_like(camera)
        raster.project(camera, intrinsics, projected)
        corner = np.floor(projected[:, :2].min(axis=0)) - MARGIN
        width, height = (np.ceil(projected[:, :2].max(axis=0)) - corner + MARGIN).astype(int)
        projected[:, :2] -= corner
        inverse, triangle = np.empty((height, width)), np.empty((height, width), dtype=np.int32)
        raster.rasterise(projected, faces, inverse, triangle)
        depth = _sensed(inverse, rng)
        if rng.random() < settings.cut:
            depth[int(rng.uniform(*CUT) * height) :] = 0
        v, u = np.nonzero(depth)
        if len(v) < settings.pixels:
            continue
        label = labels_of_vertex[faces[triangle[v, u], 0]]
        # Hands are one pixel in two hundred; without balance no question would ever be asked for them.
        balance = np.bincount(label)[label] ** -BALANCE
        pick = rng.choice(len(v), settings.pixels, replace=False, p=balance / balance.sum())
        v, u, label = v[pick], u[pick], label[pick]
        z = depth[v, u] * 0.001
        points = np.stack([(u + corner[0]) * z / FOCAL, (v + corner[1]) * z / FOCAL, z], axis=1) @ from_level
        joints = body.joint_positions(pose) + root
        columns.append(
            (
                np.full(len(v), len(crops), dtype=np.int32), u.astype(np.int32), v.astype(np.int32),
                label,
                (joints[None] - points[:, None]).astype(np.float16),
            )
        )  # fmt: skip
        crops.append(depth.ravel())
        shapes.append((height, width))
    progress(settings.images, settings.images)
    starts = np.concatenate([[0], np.cumsum([len(c) for c in crops])[:-1]]).astype(np.int64)
    return TrainingImages(
        np.concatenate(crops), starts, np.array(shapes, dtype=np.int64),
        *(np.concatenate(parts) for parts in zip(*columns, strict=True)),
    )  # fmt: skip


def _view_pose(pose: np.ndarray, turned: float, rng: np.random.Generator) -> np.ndarray:
    """A canonical pose (facing yaw 0) at the origin, turned about the vertical."""
    from scipy.spatial.transform import Rotation

    yaw = rng.uniform(-np.pi, np.pi) if rng.random() < turned else rng.uniform(-np.pi / 3, np.pi / 3)
    out = np.array(pose, dtype=np.float64)
    out[skeleton.ROOT_POSITION] = 0.0
    root = Rotation.from_rotvec([0.0, yaw, 0.0]) * Rotation.from_rotvec(out[skeleton.ROOT_ROTATION])
    out[skeleton.ROOT_ROTATION] = root.as_rotvec()
    return out


def _sensed(inverse_depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """uint16 millimetres with noise that grows with depth, coarse steps for half the images, gaps and worn contours."""
    seen = inverse_depth > 0.0
    z = np.where(seen, 1.0 / np.where(seen, inverse_depth, 1.0), 0.0)
    z += rng.normal(0.0, 0.003 * rng.random(), z.shape) * z
    if rng.random() < 0.5:
        step = 0.0028 * z * z
        z = np.where(seen, np.rint(z / np.maximum(step, 1e-6)) * step, 0.0)
    if rng.random() < 0.5:
        import cv2

        worn = cv2.erode(seen.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
        seen = np.where(rng.random(seen.shape) < rng.random(), worn, seen)
    seen = seen & (rng.random(seen.shape) > 0.02)
    return np.where(seen, np.rint(z * 1000.0), 0.0).astype(np.uint16)


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
    where = (data.depth, data.starts, data.shapes, FOCAL, data.sample_image, data.sample_u, data.sample_v)
    best, threshold, _ = forest.best_split(*where, data.labels, judges, candidates, settings.bins, classes)
    if best < 0:
        return None
    answer = np.empty(len(rows), dtype=np.float32)
    forest.answers(*where, rows, candidates[best], answer)
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
    progress: Progress | None = None,
) -> JointForest:
    """Train the joint regressor of canonical database poses (N, P).

    Trees grow in `workers` processes, each from a random stream of its own, so that the result does not depend on their
    number. `progress(done, total)` counts images, then finished trees.
    """
    settings = settings or PartsSettings()
    report = progress or (lambda done, total: None)
    streams = np.random.default_rng(seed).spawn(settings.trees + 1)
    data = draw_images(poses, settings, streams[0], report)
    offsets: list[np.ndarray] = []
    thresholds: list[float] = []
    children: list[list[int]] = []
    roots: list[int] = []
    means: list[np.ndarray] = []
    sure: list[np.ndarray] = []
    for number, grown in enumerate(_grow_trees(data, settings, streams[1:], workers)):
        tree_offsets, tree_thresholds, tree_children, leaves = grown
        report(number + 1, settings.trees)
        nodes, first_leaf = len(thresholds), len(means)
        roots.append(nodes if tree_thresholds else -1 - first_leaf)
        offsets += tree_offsets
        thresholds += tree_thresholds
        children += [[c + nodes if c >= 0 else c - first_leaf for c in pair] for pair in tree_children]
        for rows in leaves:
            votes = data.offsets[rows].astype(np.float32)
            mean = votes.mean(axis=0)
            variance = ((votes - mean) ** 2).sum(axis=2).mean(axis=0)
            means.append(np.clip(np.rint(mean / OFFSET_UNIT), -127, 127))
            sure.append(sureness(variance))
    return JointForest(
        np.array(offsets, dtype=np.float32).reshape(-1, 4),
        np.array(thresholds, dtype=np.float32),
        np.array(children, dtype=np.int32).reshape(-1, 2),
        np.array(roots, dtype=np.int32),
        np.array(means, dtype=np.int8),
        np.array(sure, dtype=np.uint8),
    )
