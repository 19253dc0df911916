"""Segmentation of one person in a depth image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from toolkit.io.archives import Column
from toolkit.io.errors import SegmentationError, SeveralPeopleError
from toolkit.kernels.cloud.nearest import smallest_gap
from toolkit.kernels.image import components
from toolkit.kernels.image import depth as kernels
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.sensing_settings import SegmentationMode, SensingSettings

HOW_TO_SEGMENT = (
    "give --segment person, seed:U,V (a pixel of the person), range:NEAR,FAR (metres) or empty-frames:N, "
    "or --background with the empty scene"
)
PERSON_AREA = (0.12, 2.0)  # m^2 seen head on: a child cut off at the waist to a wide adult with loose clothes


@dataclass(frozen=True, eq=False)
class Components:
    """Connected components of a frame: pixels (n,), area in m^2 (n,), extent in the level frame (n, 3, 2), metres."""

    pixels: np.ndarray
    areas: np.ndarray
    extents: np.ndarray

    def large(self) -> np.ndarray:
        """Return the indices of the components that are large enough for a person."""
        size = self.extents[:, :, 1] - self.extents[:, :, 0]
        person_height = 0.5  # m: the least extent along x or y of something taken for a person
        return np.flatnonzero((self.areas >= PERSON_AREA[0]) & (size[:, :2].max(axis=1, initial=0) >= person_height))

    def too_large(self) -> bool:
        """Return True if a component is larger than any person."""
        size = self.extents[:, :, 1] - self.extents[:, :, 0]
        person_extent = 2.6  # m: the largest in any direction
        return bool((self.areas > PERSON_AREA[1]).any() or (size > person_extent).any())

    def gaps(self, members: list[int]) -> np.ndarray:
        """Return the distance of each component's box from the nearest box of `members`: float64 (n,), metres."""
        low, high = self.extents[:, None, :, 0], self.extents[:, None, :, 1]
        gap = np.maximum(np.maximum(low - high[members, 0], low[members, 0] - high), 0.0)
        return np.linalg.norm(gap, axis=-1).min(axis=1)


class Segmenter:
    """Segmenter of one person in the frames of one recording, in order.

    Parameters
    ----------
    camera : without lens distortion
    background : uint16 (H, W), millimetres, or None
    settings : `SensingSettings`
    up_camera : (3,), the vertical in the camera frame

    Raises
    ------
    SegmentationError
        The settings ask for a background and there is none, or for a person in a room (see `find_person`).
    """

    CHECKPOINT = ("_background", "_empty_wanted", "_empty_frames", "_seen", "_last", "_last_box")
    _empty_frames: list[Annotated[np.ndarray, Column("u", ("height", "width"))]]

    def __init__(
        self, camera: Camera, background: np.ndarray | None, settings: SensingSettings, up_camera: np.ndarray
    ) -> None:
        self._camera, self._settings = camera, settings
        mode = SegmentationMode.parse(settings.segment)
        if mode.name == "auto" and background is not None:
            mode = SegmentationMode("background")
        if mode.name in ("person", "seed"):
            raise SegmentationError(f"--segment {settings.segment} needs a recording, see `toolkit.people.survey`")
        if mode.name == "background" and background is None:
            raise SegmentationError(f"--segment is background and the recording has none; {HOW_TO_SEGMENT}")
        self._mode = mode
        near, far = mode.numbers if mode.name == "range" else (settings.near, settings.far)
        self._near, self._far = int(1000 * near), min(int(1000 * far), 65535)
        used = background if mode.name == "background" else None
        self._background = np.zeros(camera.shape, dtype=np.uint16) if used is None else used
        self._rotation = level_rotation(up_camera)
        self._empty_wanted = int(mode.numbers[0]) if mode.name == "empty-frames" else 0
        self._empty_frames = []
        self._seen = False
        padded = (camera.height + 2, camera.width + 2)
        self._padded = np.zeros(padded, dtype=np.uint16)
        self._last = np.zeros(padded, dtype=np.uint16)
        self._last_box = np.ones(4, dtype=np.int64)
        self._labels = np.zeros(padded, dtype=np.int32)
        self._parents = np.zeros(camera.height * camera.width + 2, dtype=np.int32)
        self._box = np.zeros(4, dtype=np.int64)

    def person(self, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Segment the person in one frame, uint16 (H, W), millimetres.

        Returns
        -------
        A padded depth image, uint16 (H + 2, W + 2), that is valid until the next call, and the window (v0, v1, u0,
        u1, ends excluded, padded indices) that holds the person, or None for a frame without one.

        Raises
        ------
        SegmentationError
            The person cannot be separated from the scene, or there are several in the first frame that shows any.
        """
        if self._mode.name == "empty-frames" and not self._learnt(depth):
            return self._padded, None
        near, far = self._near, self._far
        count = kernels.take_foreground(
            depth, self._background, 1000 * self._settings.background_margin, 1000 * self._settings.quantisation,
            near, far, self._padded, self._box,
        )  # fmt: skip
        empty_share = 0.1  # of each frame is 0 where it is already segmented (recording format)
        if self._mode.name == "auto" and count > (1 - empty_share) * depth.size:
            raise SegmentationError(
                f"{count / depth.size:.0%} of the image is measured: no person is cut out of it yet; {HOW_TO_SEGMENT}"
            )
        if count == 0 or not self._choose_person():
            return self._padded, None
        return self._padded, self._box

    @property
    def cut_out(self) -> bool:
        """True if the frames are segmented already: zero depth is then background."""
        return self._mode.name in ("auto", "segmented")

    def check_restored(self) -> None:
        """Raise ValueError for empty frames of another camera, see `toolkit.io.checkpoint.restore`."""
        if any(frame.shape != self._camera.shape for frame in self._empty_frames):
            raise ValueError("its empty frames are of another camera")

    def _learnt(self, depth: np.ndarray) -> bool:
        """Collect the empty frames; return True once the background is known."""
        if self._empty_wanted == 0:
            return True
        self._empty_frames.append(depth.copy())
        self._empty_wanted -= 1
        if self._empty_wanted == 0:
            self._background = median_background(self._empty_frames)
            self._empty_frames = []
        return False

    def _choose_person(self) -> bool:
        """Remove everything but the person from the foreground; return True if a person is left."""
        parts = self._components()
        smallest_area = 0.02  # m^2: less is noise and no part of a person worth tracking
        if parts.areas.sum() < smallest_area:
            return False
        if self._mode.name == "auto" and not self._seen and parts.too_large():
            raise SegmentationError(f"what is measured is larger than a person; {HOW_TO_SEGMENT}")
        groups = self._people(parts)
        kept = np.ones(len(parts.areas), dtype=bool)
        part_gap = 0.5  # m: what lies farther from the person is not a part of it (Baak 2013, 5.4.2)
        if groups:
            person = groups[0] if len(groups) == 1 else self._one_of(groups, parts)
            gaps = parts.gaps(person)
            kept &= gaps <= part_gap
            for other in groups:
                if other is not person:
                    kept &= gaps <= parts.gaps(other)
            kept[person] = True
            self._seen = True
        if not kept.all():
            components.keep_labels(self._padded, self._box, self._labels, np.concatenate([[False], kept]))
        self._remember()
        return True

    def _components(self) -> Components:
        surface_gap = 0.04  # m: neighbouring pixels of one surface differ by less, on top of the quantisation
        count = components.label_components(
            self._padded, self._box, 1000 * surface_gap, 1000 * self._settings.quantisation, self._labels, self._parents
        )
        sizes, extents = np.empty((count, 2)), np.empty((count, 3, 2))
        components.component_extents(
            self._padded, self._box, self._labels, count, self._camera.intrinsics, self._rotation, sizes, extents
        )
        return Components(sizes[:, 0], sizes[:, 1], extents)

    def _people(self, parts: Components) -> list[list[int]]:
        """Return large components; those that one person's arm separates are joined."""
        groups: list[list[int]] = []
        occluded_gap = 0.3  # m: the parts of one person on both sides of an arm are closer, two people are not
        for k in parts.large():
            near = [g for g in groups if self._distance(g, int(k)) <= occluded_gap]
            groups = [g for g in groups if g not in near]
            groups.append([int(k), *(member for g in near for member in g)])
        return groups

    def _distance(self, group: list[int], k: int) -> float:
        """Return the smallest distance between the surfaces of `group` and component `k`, metres."""
        return float(smallest_gap(self._points([k]), self._points(group)))

    def _points(self, members: list[int]) -> np.ndarray:
        v0, v1, u0, u1 = self._box
        inside = np.isin(self._labels[v0:v1, u0:u1], np.asarray(members) + 1)
        v, u = np.nonzero(inside)
        v, u = v[::4], u[::4]
        z = self._padded[v + v0, u + u0] * 1e-3
        camera = self._camera
        return np.column_stack([(u + u0 - 1 - camera.cx) * z / camera.fx, (v + v0 - 1 - camera.cy) * z / camera.fy, z])

    def _one_of(self, groups: list[list[int]], parts: Components) -> list[int]:
        """Return the person of the previous frames, else the one that the setting `subject` selects."""
        if self._seen:
            shared = np.empty(len(parts.areas), dtype=np.int64)
            components.label_overlap(self._labels, self._box, len(shared), self._last, shared)
            return max(groups, key=lambda g: int(shared[g].sum()))
        if self._settings.subject == "only":
            raise SeveralPeopleError.of(len(groups))
        if self._settings.subject == "nearest":
            return min(groups, key=lambda g: float(np.median(self._points(g)[:, 2])))
        return max(groups, key=lambda g: float(parts.areas[g].sum()))

    def _remember(self) -> None:
        v0, v1, u0, u1 = self._last_box
        self._last[v0:v1, u0:u1] = 0
        v0, v1, u0, u1 = self._box
        self._last[v0:v1, u0:u1] = self._padded[v0:v1, u0:u1]
        self._last_box[:] = self._box


def median_background(frames: list[np.ndarray]) -> np.ndarray:
    """Return the median per pixel of depth frames (uint16 (H, W), 0 = no measurement), unmeasured values left out."""
    stack = np.sort(np.stack(frames), axis=0)
    missing = (stack == 0).sum(axis=0)
    middle = np.minimum(missing + (len(frames) - missing) // 2, len(frames) - 1)
    return np.take_along_axis(stack, middle[None], axis=0)[0]
