"""Finder of several people who enter, leave, cross and touch, in any room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from toolkit.kernels.image.growth import refine_labels, take_label
from toolkit.people.connection import HELD
from toolkit.people.detection import (
    HEAD_DISTANCE,
    LEAST_PEAK,
    SURFACE_GAP,
    Head,
    find_heads,
    head_score,
    head_seeds,
    large_enough,
    near_head,
    share_out,
)
from toolkit.people.evidence import Evidence, possible_height
from toolkit.people.known_people import KnownPeople, match_heads
from toolkit.people.learning import share_of
from toolkit.people.newcomers import Newcomers, apart, in_a_mirror
from toolkit.people.person_network import PersonNetwork
from toolkit.people.sharing import body_seeds, stayed_seeds
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.people.surroundings import Surroundings, first_look, tolerances
from toolkit.people.tracks import KnownPerson
from toolkit.people.unassigned import attach_islands
from toolkit.people.view import CoarseCamera, View
from toolkit.people.visibility import hole_sizes, unobserved_pixels
from toolkit.sensing.camera import Camera
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.sensing_settings import SensingSettings

MOST_PEOPLE = 16
"""Default maximum number of tracked people."""


class MultiPersonFinder:
    """`PeopleFinder` of all people in view.

    Parameters
    ----------
    camera : camera of the raw frames, lens distortion included
    up_camera : (3,), the vertical in the camera frame
    surroundings : background model; None decides with the first frame
    sensing : settings of the depth filter
    most : maximum number of tracked people
    network : finds people in single frames; None = the network of the package

    Attributes
    ----------
    camera : camera of the sightings
    coarse : makes the coarse frames
    """

    CHECKPOINT: tuple[str, ...] = ("_known", "_newcomers", "_labels", "_depth", "_detected", "_surroundings")
    _surroundings: Surroundings | None

    def __init__(
        self,
        camera: Camera,
        up_camera: np.ndarray,
        surroundings: Surroundings | None = None,
        sensing: SensingSettings | None = None,
        most: int = MOST_PEOPLE,
        network: PersonNetwork | None = None,
    ) -> None:
        sensing = sensing or SensingSettings()
        self._made_of = camera, up_camera, sensing, most, network
        self._polisher = DepthFilter(camera, sensing)
        self.camera = self._polisher.camera
        self.coarse = CoarseCamera(self._polisher.flat_camera, up_camera, sensing, network=network)
        self._surroundings = surroundings
        self._known = KnownPeople(self.coarse, most)
        self._newcomers = Newcomers()
        self._labels = np.zeros(self.coarse.camera.shape, dtype=np.int32)
        self._depth = np.zeros(self.coarse.camera.shape, dtype=np.float32)
        self._padded = np.zeros((camera.height + 2, camera.width + 2), dtype=np.uint16)
        self._fine = np.zeros(camera.shape, dtype=np.int32)
        self._detected = -1e9  # before every timestamp

    def find(
        self,
        depth_mm: np.ndarray,
        timestamp: float,
        predicted: Mapping[int, PredictedBody],
        *,
        only: int | None = None,
    ) -> tuple[Sighting, ...]:
        """Find the people in the next frame, see `PeopleFinder.find`.

        Parameters
        ----------
        only : number of the person whose sighting is returned; None for all

        Raises
        ------
        RecordingError
            The frame has another size or type.
        """
        flat = self._polisher.checked(depth_mm)
        surroundings = self._follow(flat, timestamp, predicted)
        return self._sightings(flat, surroundings, only)

    def follow(self, depth_mm: np.ndarray, timestamp: float) -> tuple[np.ndarray, np.ndarray]:
        """Find people without predicted bodies: ids int32 (h, w), 0 = none, and depth float32 (h, w), metres."""
        self._follow(self._polisher.checked(depth_mm), timestamp, {})
        return self._labels, self._depth

    def coarse_pixel(self, u: float, v: float) -> tuple[int, int]:
        """Return row and column in the images of `follow` for a pixel of a frame."""
        height, width = self._labels.shape
        return min(round(v / self.coarse.step), height - 1), min(round(u / self.coarse.step), width - 1)

    def _follow(self, flat: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]) -> Surroundings:
        """Label the people of an undistorted frame at coarse resolution."""
        view, surroundings = self._look(flat, timestamp)
        present = self._known.present(timestamp, predicted)
        alone = surroundings.cut_out and not self.people  # what is measured is people, even without a probable head
        any_peak = -3.0  # log-odds of a head, of a person who lies
        found: list[Head] = []
        due = self._due(present, predicted, surroundings, timestamp)
        if due:
            found = find_heads(view, self.coarse, any_peak if alone else LEAST_PEAK)
            found = [head for head in found if possible_height(head.place, surroundings.floor)]
        heads = [head.place for head in found]
        matched = match_heads(present, heads, timestamp)
        for k, i in matched.items():
            present[k] = present[k].faced(heads[i], HEAD_DISTANCE)
        places = [heads[matched[k]] if k in matched else person.expected(timestamp) for k, person in enumerate(present)]
        left = [i for i in range(len(heads)) if i not in matched.values()]
        seeds = self._seeds(view, present, places, set(matched))
        view = self._shared_by_bodies(view, surroundings, present, places, predicted, seeds)
        self._stayed(view, present, places, seeds)
        labels = self._shared(view, surroundings, seeds, places)
        others = [found[i] for i in left if surroundings.known or found[i].score > 0]
        new, touching = self._candidates(view, surroundings, seeds, places, others)
        candidates = [head.place for head in new]
        sure = [self._sure(view, head, surroundings) for head in new]
        if alone:
            sure[:1] = [True] * len(sure[:1])
        touching = [touches and bool(self.people) for touches in touching]
        fresh = self._newcomers.promoted(candidates, touching, sure, timestamp)
        walls, everywhere = surroundings.planes, [*places, *candidates]
        fresh = [i for i in fresh if not in_a_mirror(candidates[i], everywhere, walls, self.coarse)]
        if fresh:
            for k, i in enumerate(fresh, start=len(places) + 1):
                seeds[near_head(view, candidates[i]) & view.foreground] = k
            places += [candidates[i] for i in fresh]
            labels = self._shared(view, surroundings, seeds, places)
        ids = self._updated(view, labels, present, places, set(matched), timestamp, surroundings.cut_out)
        self._labels, self._depth = ids[labels], view.depth
        heads_seen = {int(ids[k + 1]): place for k, place in enumerate(places) if k in matched or k >= len(present)}
        self._look_at(view, heads_seen, timestamp)
        if due and len(matched) == len(present) and not self._newcomers.waiting:
            self._detected = timestamp
        return surroundings

    def _due(
        self,
        present: Sequence[KnownPerson],
        predicted: Mapping[int, PredictedBody],
        surroundings: Surroundings,
        timestamp: float,
    ) -> bool:
        """Return True if heads are to be detected in a frame.

        Where each person has a verified body and was detected the last time, and no candidate waits, this is now and
        then.
        """
        followed = bool(present) and all(person.borne_out and person.id in predicted for person in present)
        detect_again = 0.1  # seconds between two detections while all people are followed by their bodies
        return not (surroundings.known and followed and 0 <= timestamp - self._detected < detect_again)

    def use_room(self, surroundings: Surroundings) -> None:
        """Use what was learned about the room in the frames that follow."""
        self._surroundings = surroundings

    def redetect(self) -> MultiPersonFinder:
        """Return a finder for the same room, see `PeopleFinder.redetect`."""
        camera, up_camera, sensing, most, network = self._made_of
        return MultiPersonFinder(camera, up_camera, self._surroundings, sensing, most, network)

    @property
    def people(self) -> list[KnownPerson]:
        """People detected so far, by rising id."""
        return self._known.people

    @property
    def evidence(self) -> dict[int, Evidence]:
        """Evidence by track id, see `PeopleFinder`; empty in a recording of segmented people."""
        if self._surroundings is None or self._surroundings.cut_out:
            return {}
        return {person.id: person.evidence for person in self.people}

    def check_restored(self) -> None:
        """Raise ValueError for pixels of unknown people or another room, see `toolkit.io.checkpoint.restore`."""
        if not set(np.unique(self._labels).tolist()) <= {0, *(person.id for person in self.people)}:
            raise ValueError("it labels people who are not in it")
        room = {} if self._surroundings is None else vars(self._surroundings)
        if any(isinstance(image, np.ndarray) and image.shape != self._labels.shape for image in room.values()):
            raise ValueError("its room is of another camera")

    def _look(self, flat: np.ndarray, timestamp: float) -> tuple[View, Surroundings]:
        coarse, surroundings = self.coarse, self._surroundings
        depth = coarse.downsampled(flat)
        seen = max((person.last for person in self.people), default=timestamp)
        if surroundings is None or (not surroundings.known and timestamp - seen > HELD):
            surroundings = first_look(depth, coarse)
        if depth.any():
            self._surroundings = surroundings
        foreground = surroundings.foreground(depth, coarse.rays, tolerances(depth, coarse))
        if not surroundings.known:
            foreground &= coarse.person_odds(depth) > 0
        return coarse.view(depth, foreground, surroundings.unclaimed), surroundings

    def _seeds(
        self, view: View, present: Sequence[KnownPerson], places: Sequence[np.ndarray], matched: set[int]
    ) -> np.ndarray:
        """Mark the visible heads of the present people with 1, 2, ...: int32 (h, w)."""
        seeds = np.zeros(view.depth.shape, dtype=np.int32)
        unseen = np.full(3, np.nan)
        head_seeds(view, [places[k] if k in matched else unseen for k in range(len(present))], seeds)
        return seeds

    def _shared_by_bodies(
        self,
        view: View,
        surroundings: Surroundings,
        present: Sequence[KnownPerson],
        places: Sequence[np.ndarray],
        predicted: Mapping[int, PredictedBody],
        seeds: np.ndarray,
    ) -> View:
        """Add the pixels near the predicted bodies to `seeds`, for people whose head is where the body has it.

        Where every person has a body, still pixels near none of them are furniture that a person touches; they are not
        in the foreground of the view that is returned.
        """
        if len(present) < 2 and not surroundings.still.any():
            return view  # one person has all pixels, but for what stands before a room that was learnt
        asked = {k: predicted[p.id] for k, p in enumerate(present, start=1) if p.id in predicted}
        bodies = {k: body for k, body in asked.items() if self._follows(body, places[k - 1])}
        if not bodies:
            return view
        body_seeds(view, self.coarse, bodies, seeds)
        if len(bodies) < len(present):
            return view
        return replace(view, foreground=view.foreground & ~(view.still & (seeds == 0)))

    def _follows(self, body: PredictedBody, place: np.ndarray) -> bool:
        """Return True if a body's surface is near the place (3,) of the person's head."""
        head = self.coarse.from_level(place[None])[0]
        return bool(((body.vertices - head) ** 2).sum(axis=1).min() < HEAD_DISTANCE**2)

    def _stayed(
        self, view: View, present: Sequence[KnownPerson], places: Sequence[np.ndarray], seeds: np.ndarray
    ) -> None:
        """Add expected heads, and torsos that did not move, to `seeds`."""
        numbers = np.zeros(1 + max((p.id for p in self.people), default=0), dtype=np.int32)
        for k, person in enumerate(present, start=1):
            numbers[person.id] = k
        # Still pixels may be the chair from which a person has just risen.
        here = ~view.still & self._lasting(view)
        stayed_seeds(view, np.where(here, numbers[self._labels], 0), places, seeds)

    def _lasting(self, view: View) -> np.ndarray:
        """Return the pixels that show the surface of the previous frame: bool (h, w)."""
        same_surface = 0.15  # metres of depth by which a surface moves between frames: 5 m/s at 30 Hz
        return np.asarray(np.abs(view.depth - self._depth) < same_surface)

    def _shared(
        self, view: View, surroundings: Surroundings, seeds: np.ndarray, places: Sequence[np.ndarray]
    ) -> np.ndarray:
        """Return labels of the people at `places` (1, 2, ...): int32 (h, w)."""
        labels = share_out(view, self.coarse, seeds, places)
        return attach_islands(view, self.coarse, labels, places, cut_out=surroundings.cut_out)

    def _candidates(
        self,
        view: View,
        surroundings: Surroundings,
        seeds: np.ndarray,
        places: Sequence[np.ndarray],
        heads: Sequence[Head],
    ) -> tuple[list[Head], list[bool]]:
        """Return head candidates of new people, and a flag for those on the surface of a person."""
        people, found, touching, seeds = list(places), [], [], seeds.copy()
        for head in heads:  # the most probable first
            labels = self._shared(view, surroundings, seeds, people)
            here = near_head(view, head.place) & view.foreground
            owners = np.unique(labels[here & (labels > 0)])
            if all(apart(head.place, people[k - 1]) for k in owners):
                people.append(head.place)
                found.append(head)
                seeds[here] = len(people)
                touching.append(len(owners) > 0 and not self._parted(view, surroundings, seeds, people, head))
        return found, touching

    def _parted(
        self, view: View, surroundings: Surroundings, seeds: np.ndarray, places: Sequence[np.ndarray], head: Head
    ) -> bool:
        """Return True if the last of `places` is a person by new surface alone, unlike a bent elbow."""
        share = self._shared(view, surroundings, seeds, places) == len(places)
        min_mask_overlap = 0.5  # minimum fraction of a surface that was a person's in the previous frame to keep it
        fresh = share_of((self._labels > 0) & self._lasting(view), share) < min_mask_overlap
        return fresh and head.score > 0 and large_enough(view, self.coarse, share)

    def _sure(self, view: View, head: Head, surroundings: Surroundings) -> bool:
        """Return True if a head candidate is certainly a person's, who then counts at once."""
        return Evidence().after(head.score, _moved(view, head.place, surroundings)).log_odds > 0

    def _look_at(self, view: View, heads: Mapping[int, np.ndarray], timestamp: float) -> None:
        """Add evidence to the tracks whose heads are visible, by id, a few times a second."""
        surroundings = self._surroundings
        if surroundings is None or surroundings.cut_out:
            return
        look_again = 0.3  # seconds between two evaluations of a track's evidence
        for person in self.people:
            if person.id in heads and timestamp - person.looked >= look_again:
                head = heads[person.id]
                score = head_score(view, self.coarse, head) or 0.0
                self._known.keep(person.with_sample(score, _moved(view, head, surroundings), timestamp))

    def _updated(
        self,
        view: View,
        labels: np.ndarray,
        present: Sequence[KnownPerson],
        places: Sequence[np.ndarray],
        matched: set[int],
        timestamp: float,
        cut_out: bool,
    ) -> np.ndarray:
        """Update the people and return the id of every label, int32 (n + 1,), 0 for background."""
        ids = np.zeros(len(places) + 1, dtype=np.int32)
        back: list[KnownPerson] | None = None
        least_part = 0.02  # smallest visible part of a present person, square metres: a shoulder beside another person
        middle_samples = 300  # points of a person that are sampled for the median position
        for k, place in enumerate(places):
            mask = labels == k + 1
            points, area = view.points[mask], self.coarse.area(view.depth[mask])
            middle = place
            if len(points):
                middle = np.median(points[:: max(1, len(points) // middle_samples)], axis=0).astype(np.float64)
            if k < len(present):
                self._known.keep(present[k])
                if area >= least_part:
                    head = place if k in matched else None
                    ids[k + 1] = self._known.keep(present[k].seen(head, middle, area, timestamp))
            elif len(points) and large_enough(view, self.coarse, mask, cut_out=cut_out):
                back = self._known.expected_back(timestamp) if back is None else back  # the present are up to date
                ids[k + 1] = self._known.meet(place, middle, area, timestamp, back)
        self._known.end_frame(timestamp)
        return ids

    def _sightings(self, flat: np.ndarray, surroundings: Surroundings, only: int | None) -> tuple[Sighting, ...]:
        """Return the sightings at full resolution, or that of one person."""
        millimetres = np.rint(1000 * self._depth).astype(np.uint16)
        refine_labels(flat, millimetres, self._labels, self.coarse.step, 1000 * SURFACE_GAP, self._fine)
        step = self._polisher.step
        whole = flat[::step, ::step]
        holes = None if surroundings.cut_out else hole_sizes(whole)
        found = []
        box = np.zeros(4, dtype=np.int64)
        for number in np.unique(self._labels[self._labels > 0]):
            if only is not None and number != only:
                continue
            if take_label(flat, self._fine, int(number), self._padded, box) == 0:
                continue
            depth = self._polisher.filtered(self._padded, box)
            if depth.any():
                found.append(Sighting(int(number), depth, unobserved_pixels(whole, depth, holes), self.camera))
        return tuple(found)


def _moved(view: View, head: np.ndarray, surroundings: Surroundings) -> float:
    """Return the fraction of a head's pixels, at a place (3,), before a known background."""
    return share_of(surroundings.background > 0, near_head(view, head) & view.foreground)
