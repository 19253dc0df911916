"""Training images of the joint regressor: people alone and people in rooms, and the pixels that are chosen of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from database_builder.room_views import NO_PERSON, SHELL, RoomPainter
from database_builder.views import FOCAL, CroppedView, ViewSettings, body_labels, draw_view, is_seated
from toolkit.body.shape import ShapeSpace
from toolkit.io.progress import Count
from toolkit.kernels.learning import forest

BALANCE = 0.7
"""Exponent that evens out the parts among an image's training pixels: 0 as they are seen, 1 all parts alike."""
OF_NO_PERSON = 0.5
"""Share of the training pixels of a room with a person in it that are of no person."""
OF_WALLS = 0.25
"""Share of those pixels that show floor, walls and ceiling: in rooms most pixels do, and most of them are easy."""


@dataclass
class TrainingImages:
    """Drawn people and rooms, and the pixels chosen from them.

    Attributes
    ----------
    depth : uint16, millimetres: crops end to end, 0 = nothing, `forest.UNOBSERVED` = hidden or outside the image
    starts, shapes : int64 (I,) and (I, 2): where each crop begins, its height and width
    windows : int32 (I, 4): first and last column, first and last row of the image, in pixels of the crop
    in_view : bool (I, 20): joints inside the image with nothing but the person before them
    sample_image, sample_u, sample_v : int32 (S,): crop and pixel of each sample
    labels : uint8 (S,): see `body_labels`, `NO_PERSON` for what is no person
    points : float32 (S, 3), of each sample, metres, level frame
    joints : float32 (I, 20, 3), of each image's person, metres, level frame
    """

    depth: np.ndarray
    starts: np.ndarray
    shapes: np.ndarray
    windows: np.ndarray
    in_view: np.ndarray
    sample_image: np.ndarray
    sample_u: np.ndarray
    sample_v: np.ndarray
    labels: np.ndarray
    points: np.ndarray
    joints: np.ndarray

    def offsets(self, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
        """From the points of some samples to the joints: float32 (N, 20, 3), metres."""
        return self.joints[self.sample_image[rows]] - self.points[rows][:, None]


@dataclass(frozen=True, eq=False)
class Chosen:
    """A view and pixels of it: int64 (S,), column, row and label of each."""

    view: CroppedView
    u: np.ndarray
    v: np.ndarray
    label: np.ndarray


class ImageSource:
    """Draws images of people in canonical database poses (N, P), each another view, and chooses pixels of each."""

    def __init__(self, poses: np.ndarray, settings: ViewSettings) -> None:
        self._poses, self._settings = poses, settings
        self._space = ShapeSpace.load()
        self._sits = is_seated(poses, self._space.body())
        self._rooms = RoomPainter(poses, self._sits, settings)
        self._labels = body_labels(self._space.body())
        self._faces = self._space.faces.astype(np.int64)

    def draw(self, pixels: int, rng: np.random.Generator) -> Chosen | None:
        """The next image with `pixels` of its pixels; None where it does not show enough."""
        if self._settings.rooms and rng.random() < self._settings.rooms:
            return self._of_room(pixels, rng)
        view = draw_view(self._poses, self._sits, self._space, self._settings, rng)
        v, u = np.nonzero((view.depth > 0) & (view.depth < forest.UNOBSERVED))
        if len(v) < pixels:
            return None
        label = self._labels[self._faces[view.triangle[v, u], 0]]
        pick = _balanced(label, pixels, rng)
        return Chosen(view, u[pick], v[pick], label[pick])

    def _of_room(self, pixels: int, rng: np.random.Generator) -> Chosen | None:
        view = self._rooms.draw(rng)
        labels = self._rooms.label_image(view)
        measured = (view.depth > 0) & (view.depth < forest.UNOBSERVED)
        person, other = measured & (labels != NO_PERSON), measured & view.no_person
        chosen, wanted = [], pixels
        if person.sum() >= 0.5 * pixels:
            wanted = round(OF_NO_PERSON * pixels) if other.any() else 0
            rows = np.flatnonzero(person)
            chosen.append(rows[_balanced(labels.ravel()[rows], min(pixels - wanted, len(rows)), rng)])
        for kind, count in ((other & (view.owner == SHELL), round(OF_WALLS * wanted)), (other, wanted)):
            rows = np.flatnonzero(kind if count < wanted else kind & (view.owner != SHELL))
            chosen.append(rng.choice(rows, min(count, len(rows)), replace=False))
        picked = np.concatenate(chosen)
        if len(picked) < 0.2 * pixels:
            return None
        v, u = np.divmod(picked, view.depth.shape[1])
        return Chosen(view, u, v, labels[v, u])


def _balanced(label: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Rows of `count` pixels of these labels (N,), rare labels oftener than they are: hands are one pixel in 200."""
    balance = np.bincount(label)[label] ** -BALANCE
    return rng.choice(len(label), count, replace=False, p=balance / balance.sum())


def draw_images(
    poses: np.ndarray, settings: ViewSettings, images: int, pixels: int, rng: np.random.Generator, progress: Count
) -> TrainingImages:
    """Draw `images` images of canonical database poses (N, P) and choose `pixels` pixels of each, where it has them."""
    source = ImageSource(poses, settings)
    views: list[tuple[np.ndarray, ...]] = []
    columns: list[tuple[np.ndarray, ...]] = []
    for image in range(images):
        if image % 500 == 0:
            progress(image, images)
        if (one := source.draw(pixels, rng)) is None:
            continue
        view = one.view
        z = view.depth[one.v, one.u] * 0.001
        x, y = (one.u + view.corner[0]) * z / FOCAL, (one.v + view.corner[1]) * z / FOCAL
        points = np.stack([x, -y, -z], axis=1).astype(np.float32)
        number = np.full(len(z), len(views), dtype=np.int32)
        columns.append((number, one.u.astype(np.int32), one.v.astype(np.int32), one.label.astype(np.uint8), points))
        views.append((view.depth.ravel(), np.array(view.depth.shape), view.window, view.in_view, view.joints))
    progress(images, images)
    depths, shapes, windows, in_view, joints = zip(*views, strict=True)
    starts = np.cumsum([0, *(len(depth) for depth in depths[:-1])]).astype(np.int64)
    of_image, u, v, label, points = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    return TrainingImages(
        np.concatenate(depths), starts, np.array(shapes, dtype=np.int64), np.array(windows), np.array(in_view),
        of_image, u, v, label, points, np.array(joints, dtype=np.float32),
    )  # fmt: skip
