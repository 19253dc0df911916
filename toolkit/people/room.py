"""Finding a person in one depth image of a room, without a background.

The floor is taken away, what is left falls into surfaces where depth jumps, surfaces of a person's size are taken
for people, and the smaller ones that touch them for their limbs. From the second frame on the person is where it was.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.archives import Column
from toolkit.checkpoint import check_state
from toolkit.errors import SegmentationError
from toolkit.kernels.cloud.planes import largest_plane
from toolkit.kernels.image import components
from toolkit.people.floor import SEED, Floor, find_floor
from toolkit.sensing.camera import Camera, level_rotation

COARSE_WIDTH = 320  # pixels: finer images show the steps of the sensor, not of the scene
SURFACE_GAP = 0.03  # m between neighbouring coarse pixels of one surface, on top of the quantisation
EDGE = 0.015  # m by which a pixel lies behind its nearest neighbour where one surface ends and the next begins
BRIDGE = 0.022  # m: half the width of a bridge between two surfaces, at `USUAL_DISTANCE`
USUAL_DISTANCE = 2.5  # m
CORE_AREA = 0.008  # m^2: a hand's core
FLOOR_CLEARANCE = 0.06  # m: above the floor's noise, below the ankle
SPECK_AREA = 0.003  # m^2: half a hand
SEED_AREA = (0.12, 1.4)  # m^2 seen head on: half a child to a wide adult
SEED_HEIGHT = (0.6, 2.2)  # m
SEED_WIDTH = 2.2  # m
SEED_DEPTH = 1.3  # m
LONGEST_DEPTH = 1.8  # m: a followed person with an arm stretched out, and a stray pixel
CORE_OF_PERSON = 0.08  # m^2: the largest surface of a person, torso or coat
PLANE_SHARE = 0.72  # of a surface in one plane; people have 0.3 to 0.7, furniture 0.75 to 1
PLANE_DISTANCE = 0.02  # m, on top of half the quantisation
PLANE_SAMPLES, PLANE_ITERATIONS = 1500, 500
UPRIGHT = 1.0  # height over width of a seed: a sofa lies, a person stands or sits
LIMB_AREA = 0.06  # m^2: an arm with its hand
PART_AREA = 0.3  # m^2: half a body, where the other half's column holds it
COLUMN = np.array(
    [0.05, 0.35, 0.15]
)  # m by which a part may stand out of the body's box: x, upwards, z (a head, a hand)
CONTACT_REACH = 0.1  # m between a limb's edge and the body before or behind it
CONTACT_RADIUS = 3  # coarse pixels
CONTACTS = 100  # pairs of pixels: a wrist's width; furniture that is brushed against has fewer
FOUND_AGAIN = 0.6  # m from where the person was last seen
SEED_RADIUS = 4  # coarse pixels: a seed may fall into a gap
FOLLOWED_OVERLAP = 0.5  # share of a surface's pixels that lay on the person in the frame before
FOLLOWED_SHARE = 0.3  # of the person's pixels that are still the same surface
GROWTH = 1.3  # of a person's area at once; more is a wall that it touched
LASTING_GROWTH = 1.02  # a frame, for a person who comes closer into view
FOLLOWED_DEPTH = 0.25  # m it may have moved along z since then


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Connected surfaces of a coarse depth image, specks left out.

    Attributes
    ----------
    labels : int32 (h, w), 1..n, 0 = nothing
    areas : float64 (n,), m^2 seen head on
    low, high : float64 (n, 3), extent in the level frame, metres
    """

    labels: np.ndarray
    areas: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def centre(self, k: int) -> np.ndarray:
        """Middle of a surface's extent, float64 (3,), metres, level frame."""
        return np.asarray(self.low[k] + self.high[k]) / 2

    def fits(self, members: list[int]) -> bool:
        """Whether these surfaces together (indices from 0) are not larger than a person."""
        size = self.high[members].max(axis=0) - self.low[members].min(axis=0)
        return bool(
            self.areas[members].sum() <= SEED_AREA[1]
            and size[0] <= SEED_WIDTH
            and size[1] <= SEED_HEIGHT[1]
            and size[2] <= LONGEST_DEPTH
        )


class RoomSegmenter:
    """Finds and follows one person in a room.

    Parameters
    ----------
    camera : without lens distortion
    subject : "only", "largest" or "nearest", where several people are in view
    quantisation : metres at 1 m, growing with the square of the distance
    up_camera : (3,), the vertical in the camera frame
    seed : pixel (u, v) of the person in the first frame, or None to look for a person-sized surface
    """

    def __init__(
        self,
        camera: Camera,
        subject: str,
        quantisation: float,
        up_camera: np.ndarray,
        seed: tuple[float, float] | None = None,
    ) -> None:
        self._step = max(1, round(camera.width / COARSE_WIDTH))
        self._camera, self._coarse = camera, camera.subsampled(self._step)
        self._subject, self._quantisation, self._seed = subject, quantisation, seed
        self._rotation = level_rotation(up_camera)
        self._floor: Floor | None = None
        self._slopes: np.ndarray | None = None
        self._last: np.ndarray | None = None
        self._area = 0.0
        self._place: np.ndarray | None = None
        shape = (self._coarse.height + 2, self._coarse.width + 2)
        self._padded = np.zeros(shape, dtype=np.uint16)
        self._labels = np.zeros(shape, dtype=np.int32)
        self._bridge = int(np.clip(round(BRIDGE * self._coarse.fx / USUAL_DISTANCE), 1, 4))
        self._parents = np.zeros(shape[0] * shape[1], dtype=np.int32)

    def find(self, depth: np.ndarray, padded: np.ndarray, box: np.ndarray) -> int:
        """Write the person in `depth` (uint16 (H, W), millimetres) to `padded` and its window to `box`.

        Returns
        -------
        The number of its pixels; 0 where nobody is.

        Raises
        ------
        SegmentationError
            Several things of a person's size are in the first frame with anybody, and `subject` is "only".
        """
        if self._slopes is None:
            self._stand_on(find_floor(depth, self._camera))
        coarse = np.ascontiguousarray(depth[:: self._step, :: self._step])
        self._remove_floor(coarse)
        surfaces = self._surfaces(coarse)
        surfaces, members = self._followed(surfaces, coarse)
        members = members or self._chosen(surfaces, coarse)
        if not members:
            return 0
        person = self._with_limbs(surfaces, coarse, members)
        area = float(surfaces.areas[members[0]])
        self._area = min(area, LASTING_GROWTH * self._area) if self._area > 0 else area
        self._place = surfaces.centre(members[0])
        mask = np.isin(surfaces.labels, np.asarray(person) + 1)
        self._last = np.where(mask, coarse, 0).astype(np.uint16)
        return int(components.refine_mask(depth, self._last, self._step, 1000 * SURFACE_GAP, padded, box))

    def export_state(self) -> dict[str, Any]:
        """What the next frame depends on, see `PeopleFinder.export_state`."""
        return {
            "begun": self._slopes is not None,
            "floor": None if self._floor is None else dict(vars(self._floor)),
            "last": self._last,
            "area": self._area,
            "place": self._place,
        }

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `export_state` gave; raises TrackError for the state of something else."""
        columns = {
            "begun": Column("b", ()), "last": Column("u", self._coarse.shape, optional=True),
            "area": Column("iuf", (), 0, 1e9), "place": Column("f", (3,), -1e3, 1e3, optional=True),
        }  # fmt: skip
        check_state(state, columns, ("floor",), "room")
        if state["floor"] is not None:
            plane = {"up_camera": Column("f", (3,), -1, 1), "height": Column("iuf", (), -1e3, 1e3)}
            check_state(state["floor"], plane, what="floor")
        self._last, self._area, self._place = state["last"], state["area"], state["place"]
        if state["begun"]:
            self._stand_on(None if state["floor"] is None else Floor(**state["floor"]))

    def _stand_on(self, floor: Floor | None) -> None:
        self._floor = floor
        self._slopes = np.zeros(self._coarse.shape)
        if self._floor is not None:
            up = self._floor.up_camera
            self._slopes = self._floor.slopes(self._coarse)
            self._rotation = level_rotation(up)

    def _remove_floor(self, coarse: np.ndarray) -> None:
        if self._floor is not None and self._slopes is not None:
            coarse[self._slopes * coarse * 1e-3 + self._floor.height < FLOOR_CLEARANCE] = 0

    def _surfaces(self, coarse: np.ndarray) -> Surfaces:
        """Surfaces grown from their cores: what is left of them away from edges and narrow bridges."""
        self._label(self._cores(coarse))
        cores = self._labels.copy()
        self._padded[1:-1, 1:-1] = coarse
        gap = (1000 * SURFACE_GAP, 1000 * self._quantisation)
        components.grow_labels(self._padded, *gap, cores, self._parents)
        self._padded[cores > 0] = 0
        rest = self._label(None)
        labels = np.where(self._labels > 0, self._labels, np.where(cores > 0, cores + rest, 0)).astype(np.int32)
        return self._large(coarse, labels)

    def _cores(self, coarse: np.ndarray) -> np.ndarray:
        """Depth of the pixels that lie inside a surface: not behind an edge, and away from the border of what is
        left.
        """
        import cv2

        smooth = np.where(coarse > 0, cv2.medianBlur(coarse, 3), np.uint16(0))
        far = np.where(smooth == 0, np.uint16(65535), smooth)
        behind = smooth - np.minimum(cv2.erode(far, np.ones((3, 3), np.uint8)), smooth)
        inside = (coarse > 0) & (behind <= 1000 * EDGE + 1000 * self._quantisation * (coarse * 1e-3) ** 2)
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * self._bridge + 1, 2 * self._bridge + 1))
        core = cv2.erode(inside.astype(np.uint8), disc, borderType=cv2.BORDER_CONSTANT, borderValue=1)
        return np.where(core > 0, coarse, np.uint16(0))

    def _label(self, depth: np.ndarray | None) -> int:
        """Components of `depth`, or of the work image as it is, in `self._labels`; those of cores that are too small
        go.
        """
        if depth is not None:
            self._padded[1:-1, 1:-1] = depth
        box = np.array([1, self._coarse.height + 1, 1, self._coarse.width + 1])
        count = int(
            components.label_components(
                self._padded, box, 1000 * SURFACE_GAP, 1000 * self._quantisation, self._labels, self._parents
            )
        )
        if depth is not None:
            areas = np.bincount(self._labels.ravel(), (self._padded.ravel() * 1e-3) ** 2, minlength=count + 1)
            small = areas < CORE_AREA * self._coarse.fx * self._coarse.fy
            self._labels[small[self._labels]] = 0
        return count

    def _large(self, coarse: np.ndarray, labels: np.ndarray) -> Surfaces:
        """Size and extent of the labelled surfaces, numbered anew without the specks."""
        self._padded[1:-1, 1:-1] = coarse
        box = np.array([1, coarse.shape[0] + 1, 1, coarse.shape[1] + 1])
        count = int(labels.max())
        sizes, extents = np.empty((count, 2)), np.empty((count, 3, 2))
        components.component_extents(
            self._padded, box, labels, count, self._coarse.intrinsics, self._rotation, sizes, extents
        )
        large = sizes[:, 1] >= SPECK_AREA
        renumbered = np.zeros(count + 1, dtype=np.int32)
        renumbered[1:][large] = np.arange(1, large.sum() + 1)
        return Surfaces(renumbered[labels[1:-1, 1:-1]], sizes[large, 1], extents[large, :, 0], extents[large, :, 1])

    def _followed(self, surfaces: Surfaces, coarse: np.ndarray) -> tuple[Surfaces, list[int]]:
        """The surface that covers most of where the person was; its limbs are found anew, so that nothing piles up.

        One that has merged with the room for a while is cut back to where the person was last seen apart.
        """
        if self._last is None:
            return surfaces, []
        near = (self._last > 0) & (np.abs(coarse.astype(np.int32) - self._last) <= 1000 * FOLLOWED_DEPTH)
        count = len(surfaces.areas)
        shared = np.bincount(surfaces.labels[near], minlength=count + 1)[1:]
        if not shared.any() or shared.max() < FOLLOWED_SHARE * np.count_nonzero(self._last):
            return surfaces, []
        k = int(np.argmax(shared))
        apart = shared[k] >= FOLLOWED_OVERLAP * np.count_nonzero(surfaces.labels == k + 1)
        if apart and surfaces.fits([k]) and surfaces.areas[k] <= GROWTH * self._area:
            return surfaces, [k]
        outside = (surfaces.labels == k + 1) & ~self._around(self._last)
        cut = self._large(coarse, np.pad(np.where(outside, 0, surfaces.labels), 1).astype(np.int32))
        # Specks are gone from both alike, so the numbers stay unless the cut piece itself is one.
        mostly = shared[k] >= FOLLOWED_OVERLAP * np.count_nonzero(cut.labels == k + 1)
        return (cut, [k]) if len(cut.areas) == count and mostly and cut.fits([k]) else (surfaces, [])

    def _around(self, mask: np.ndarray) -> np.ndarray:
        import cv2

        reach = 2 * self._bridge * 3 + 1
        return cv2.dilate((mask > 0).astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0

    def _chosen(self, surfaces: Surfaces, coarse: np.ndarray) -> list[int]:
        """The surface to start from: at the seed pixel, or the largest one of the person that is meant."""
        if self._seed is not None and self._last is None:
            return self._at_seed(surfaces)
        people = self._people(surfaces, coarse)
        if not people:
            return []
        if self._place is not None:
            away = [math.dist(surfaces.centre(p[0]), self._place) for p in people]
            return people[int(np.argmin(away))][:1] if min(away) <= FOUND_AGAIN else []
        if self._subject == "only" and len(people) > 1:
            raise SegmentationError(
                f"{len(people)} things of a person's size are in view; give --subject nearest or largest, or "
                "--segment seed:U,V (a pixel of the person)"
            )
        if self._subject == "nearest":
            return min(people, key=lambda p: float(np.median(coarse[surfaces.labels == p[0] + 1])))[:1]
        return max(people, key=lambda p: float(surfaces.areas[p].sum()))[:1]

    def _people(self, surfaces: Surfaces, coarse: np.ndarray) -> list[list[int]]:
        """Surfaces with their limbs that have a person's size and are no furniture, the largest surface of each
        first.
        """
        people: list[list[int]] = []
        taken: set[int] = set()
        for k in (int(k) for k in np.argsort(-surfaces.areas, kind="stable")):
            if surfaces.areas[k] < CORE_OF_PERSON:
                break
            if k in taken or not surfaces.fits([k]) or self._furniture(surfaces, coarse, k):
                continue
            group = self._with_limbs(surfaces, coarse, [k])
            width, height, length = surfaces.high[group].max(axis=0) - surfaces.low[group].min(axis=0)
            upright = height >= max(SEED_HEIGHT[0], UPRIGHT * width) and length <= SEED_DEPTH
            if upright and surfaces.areas[group].sum() >= SEED_AREA[0]:
                people.append(group)
                taken.update(group)
        return people

    def _furniture(self, surfaces: Surfaces, coarse: np.ndarray, k: int) -> bool:
        """Whether most of a surface lies in one plane, as walls, doors and cupboards do and people do not."""
        v, u = np.nonzero(surfaces.labels == k + 1)
        picked = np.linspace(0, len(v) - 1, min(PLANE_SAMPLES, len(v))).astype(np.int64)
        v, u = v[picked], u[picked]
        z = coarse[v, u] * 1e-3
        points = np.column_stack([self._coarse.rays()[v, u] * z[:, None], z])
        tolerance = PLANE_DISTANCE + self._quantisation * float(np.median(z)) ** 2 / 2
        _, members = largest_plane(points, tolerance, PLANE_ITERATIONS, np.random.default_rng(SEED))
        return len(members) > PLANE_SHARE * len(points)

    def _at_seed(self, surfaces: Surfaces) -> list[int]:
        u, v = (int(round(s / self._step)) for s in self._seed or ())
        if not (0 <= v < self._coarse.height and 0 <= u < self._coarse.width):
            raise SegmentationError(
                f"the seed {self._seed} lies outside the image of {self._camera.width}x{self._camera.height} pixels; "
                "give U,V of a pixel of the person"
            )
        rows = slice(max(v - SEED_RADIUS, 0), v + SEED_RADIUS + 1)
        around = surfaces.labels[rows, max(u - SEED_RADIUS, 0) : u + SEED_RADIUS + 1]
        votes = np.bincount(around[around > 0], minlength=1)
        if not votes.any():
            raise SegmentationError(f"there is no surface at the seed {self._seed}; give U,V of a pixel of the person")
        return [int(np.argmax(votes)) - 1]

    def _with_limbs(self, surfaces: Surfaces, coarse: np.ndarray, members: list[int]) -> list[int]:
        """Add the surfaces that touch the person, the best touching first, and those that stand in its column (a
        head behind a raised arm), as long as the whole stays a person's size."""
        count = len(surfaces.areas)
        contacts = np.zeros((count + 1, count + 1), dtype=np.int64)
        components.contacts_between(
            coarse, surfaces.labels, CONTACT_RADIUS, CONTACT_REACH, self._coarse.intrinsics, contacts
        )
        low, high = surfaces.low[members[0]], surfaces.high[members[0]]
        centres = (surfaces.low + surfaces.high) / 2
        beside = (centres >= low - COLUMN) & (centres <= high + COLUMN)
        column = beside.all(axis=1) & (centres[:, 1] >= low[1])
        contacts[1:, members[0] + 1] += CONTACTS * column
        person = list(members)
        refused = surfaces.areas > np.where(beside[:, [0, 2]].all(axis=1), PART_AREA, LIMB_AREA)
        while True:
            touching = contacts[1:, np.asarray(person) + 1].sum(axis=1)
            touching[refused] = 0
            touching[person] = 0
            best = int(np.argmax(touching))
            if touching[best] < CONTACTS:
                return person
            if surfaces.fits([*person, best]):
                person.append(best)
            else:
                refused[best] = True
