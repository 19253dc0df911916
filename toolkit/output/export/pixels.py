"""Person index of each pixel: body index maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import UsageError
from toolkit.io.files import atomic_path
from toolkit.people.sighting import PeopleFinder, PredictedBody, Sighting
from toolkit.people.survey import find_people, find_person
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracks.runs import Person

BACKGROUND = 255
"""Value of background pixels (K4ABT_BODY_INDEX_MAP_BACKGROUND of the Azure Kinect SDK)."""
HEAD = skeleton.REPORTED.index("head")


def label_images(
    people: Sequence[Person], recording: Recording, sensing: SensingSettings, *, several: bool
) -> Iterator[np.ndarray]:
    """Yield uint8 (H, W) for each frame: the person id (`people.json`) of a measured pixel, or `BACKGROUND`.

    The segmentation is that of the tracker, but at full resolution and with the contour that cleaning removes; the
    pixels of people who touch are divided by the tracked bodies of the previous frame. A person has no pixels in frames
    without the person.

    Raises
    ------
    UsageError
        An id exceeds 8 bits.
    """
    if max(person.id for person in people) >= BACKGROUND:
        raise UsageError(f"a body index map has room for {BACKGROUND - 1} people; this run has more")
    whole = replace(sensing, half_resolution=False)
    finder: PeopleFinder = find_people(recording, whole) if several else find_person(recording, whole)
    lookup = _pixels_of(recording.camera, finder.camera)
    frames = min(len(recording), min(len(person.track) for person in people))
    contour_width = 2  # pixels
    for i, frame in zip(range(frames), recording.stream(), strict=False):
        predicted = {person.id: _predicted(person, i - 1) for person in people if i > 0 and person.there[i - 1]}
        labels = np.full(frame.depth_mm.shape, BACKGROUND, dtype=np.uint8)
        for person, sighting in _matched(finder.find(frame.depth_mm, frame.timestamp, predicted), people, i):
            labels[(sighting.depth > 0)[lookup] & (frame.depth_mm > 0)] = person.id
        for _ in range(contour_width):
            regain_contour(labels, frame.depth_mm)
        yield labels


def regain_contour(labels: np.ndarray, depth_mm: np.ndarray) -> None:
    """Assign unlabelled pixels beside a person, at the same depth, to that person; changes `labels` (H, W)."""
    before = labels.copy()
    height, width = labels.shape
    largest_step = 60  # between neighbouring pixels of one person, millimetres
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            here = np.s_[max(0, down) : height + min(0, down), max(0, right) : width + min(0, right)]
            there = np.s_[max(0, -down) : height + min(0, -down), max(0, -right) : width + min(0, -right)]
            near = np.abs(depth_mm[here].astype(np.int32) - depth_mm[there]) < largest_step
            taken = (labels[here] == BACKGROUND) & (depth_mm[here] > 0) & (before[there] != BACKGROUND) & near
            labels[here][taken] = before[there][taken]


def _predicted(person: Person, frame: int) -> PredictedBody:
    vertices = person.body.vertex_positions(person.track.pose[frame]) @ person.R_level_camera
    head = person.track.joints[frame, HEAD].astype(np.float64)
    return PredictedBody(vertices, person.body.faces, person.body.height, head)


def _pixels_of(camera: Camera, flat: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return the row and column of each pixel, int64 (H, W), in the images without lens distortion."""
    rays = camera.rays()
    columns = np.rint(rays[..., 0] * flat.fx + flat.cx).astype(np.int64)
    rows = np.rint(rays[..., 1] * flat.fy + flat.cy).astype(np.int64)
    return np.clip(rows, 0, flat.height - 1), np.clip(columns, 0, flat.width - 1)


def _matched(sightings: Sequence[Sighting], people: Sequence[Person], frame: int) -> list[tuple[Person, Sighting]]:
    """Return the person of each sighting in a frame: the same id if the joints are near, else the nearest person."""
    from scipy.optimize import linear_sum_assignment

    here = [person for person in people if person.there[frame]]
    seen = [sighting for sighting in sightings if sighting.depth.any()]
    if not here or not seen:
        return []
    far = np.array([[_distance(sighting, person, frame) for person in here] for sighting in seen])
    same = np.array([[sighting.id == person.id for person in here] for sighting in seen])
    reach = 0.35  # maximum median distance from the points of a sighting to the joints of its person, metres
    rows, columns = linear_sum_assignment(far - 0.5 * reach * same)
    return [(here[c], seen[r]) for r, c in zip(rows, columns, strict=True) if far[r, c] < reach]


def _distance(sighting: Sighting, person: Person, frame: int) -> float:
    """Return the median distance of a sighting's points to the nearest joint of a person, metres."""
    v, u = np.nonzero(sighting.depth)
    z = sighting.depth[v, u].astype(np.float64)
    points = np.column_stack([sighting.camera.rays()[v, u] * z[:, None], z])
    samples = 300  # number of points of a sighting that are compared with the joints
    points = points[:: max(1, len(points) // samples)]
    joints = person.track.joints[frame].astype(np.float64)
    return float(np.median(np.linalg.norm(points[:, None] - joints[None], axis=2).min(axis=1)))


def write_body_index(folder: Path, images: Iterable[np.ndarray]) -> None:
    """Write 8-bit PNG `frame_000000.png`, ... into a folder: ids of `people.json`, or `BACKGROUND`.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    from PIL import Image

    for i, labels in enumerate(images):
        with atomic_path(folder / f"frame_{i:06d}.png") as temporary, temporary.open("wb") as stream:
            Image.fromarray(labels).save(stream, format="PNG")
