"""People before a live camera in a room that is learned while they are found.

A recording's room is learned from frames spread over all of it (`toolkit.people.survey`). A live camera has only the
frames so far: the room is learned from samples of the first seconds, several times, one part beside every fourth frame.
The same frames give the same people on every machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.optimize  # noqa: F401  (assigns heads to people; importing it in a frame takes 0.4 s)

from toolkit.io.parts import Parts
from toolkit.people.evidence import Evidence, furniture
from toolkit.people.learning import FEWEST, learnt_parts
from toolkit.people.multi_person import MOST_PEOPLE, MultiPersonFinder
from toolkit.people.sighting import PeopleFinder, PredictedBody, Sighting, WrappedFinder
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.people.surroundings import Surroundings, first_look
from toolkit.people.survey import SAMPLES, find_people
from toolkit.people.vertical import floor_of
from toolkit.people.view import CoarseCamera
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SegmentationMode, SensingSettings

LEARNING_PERIOD = 4
"""Frames of which one has a part of learning, 20 to 40 ms, while a background is learned."""
LEARNED_AFTER = (FEWEST, 2 * FEWEST, SAMPLES)
"""Numbers of samples after which the room is learned: the fewest (4 s), twice as many, and all that are used (20 s)."""


def live_finder(first: Recording, sensing: SensingSettings, people: int | None) -> PeopleFinder:
    """Return a finder of one person, of several or with None of all people, for the frames that follow `first`.

    Parameters
    ----------
    first : a recording of the first frame, with the background if there is one
    sensing : settings of segmentation and depth filter
    people : number of people, None = all

    Raises
    ------
    SegmentationError
        `sensing.segment` is a mode that needs a whole recording.
    """
    mode = SegmentationMode.parse(sensing.segment).name
    cut_out, look = mode not in ("auto", "person") or first.background is not None, None
    if not cut_out:
        polisher = DepthFilter(first.camera, sensing)
        coarse = CoarseCamera(polisher.flat_camera, first.up_camera, sensing)
        look = first_look(coarse.downsampled(polisher.checked(first.depth(0))), coarse)
        cut_out = mode == "auto" and look.cut_out
    if cut_out and people == 1:
        return SinglePersonSegmenter.of(first, sensing)
    if cut_out:
        return find_people(first, sensing, most=people)
    most = MOST_PEOPLE if people in (None, 1) else people
    finder = MultiPersonFinder(first.camera, first.up_camera, look, sensing, most)
    learning = RoomLearningFinder(finder, sensing, first, floor_of(first))
    return FirstPersonFinder(learning) if people == 1 else learning


class RoomLearningFinder(WrappedFinder):
    """A `PeopleFinder` that learns the room from the frames it is given; its state is without them.

    Parameters
    ----------
    finder : finder of all people, before its first frame
    sensing : settings of the depth filter
    first : recording with the camera of the frames
    floor : y of the floor, metres, level frame, None where it is not known
    """

    _finder: MultiPersonFinder

    def __init__(
        self, finder: MultiPersonFinder, sensing: SensingSettings, first: Recording, floor: float | None
    ) -> None:
        self._finder, self._floor = finder, floor
        self._filter = DepthFilter(first.camera, sensing)
        self.camera = finder.camera
        self._samples: list[np.ndarray] = []
        self._due = -np.inf
        self._learning: Parts[Surroundings] | None = None
        self._frames = 0

    @property
    def evidence(self) -> Mapping[int, Evidence]:
        """See `PeopleFinder.evidence`."""
        return self._finder.evidence

    def find(
        self,
        depth_mm: np.ndarray,
        timestamp: float,
        predicted: Mapping[int, PredictedBody],
        *,
        only: int | None = None,
    ) -> tuple[Sighting, ...]:
        """See `PeopleFinder.find`; with `only`, that of one person."""
        if timestamp >= self._due and len(self._samples) < SAMPLES:
            self._sample(depth_mm, timestamp)
        if self._learning is not None and self._frames % LEARNING_PERIOD == LEARNING_PERIOD // 2:
            self._learn(self._learning)
        self._frames += 1
        return self._finder.find(depth_mm, timestamp, predicted, only=only)

    def _sample(self, depth_mm: np.ndarray, timestamp: float) -> None:
        """Store a sample, and start learning when it is due and the room of fewer samples is known."""
        sample_seconds = 0.5  # interval of the room samples: the `SAMPLES` of a recording take 20 s
        self._due = timestamp + sample_seconds
        self._samples.append(self._finder.coarse.downsampled(self._filter.checked(depth_mm)))
        if len(self._samples) in LEARNED_AFTER:
            finder = self._finder
            self._learning = learnt_parts(list(self._samples), finder.coarse, self._floor)

    def _learn(self, learning: Parts[Surroundings]) -> None:
        """Compute the next part, and use the room after the last one."""
        try:
            next(learning)
        except StopIteration as ended:
            self._finder.use_room(replace(ended.value, floor=self._floor))
            self._learning = None


class FirstPersonFinder(WrappedFinder):
    """A `PeopleFinder` of one person in a room: the largest one when a person is first seen, and then the same.

    If the evidence shows that it is furniture, the largest of the other people takes its place.
    """

    _finder: RoomLearningFinder
    evidence: Mapping[int, Evidence] = {}

    def __init__(self, finder: RoomLearningFinder) -> None:
        self._finder, self.camera = finder, finder.camera
        self._selected: int | None = None

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        """See `PeopleFinder.find`: no sighting before the first person, then one in every frame, which may be empty."""
        only = 1
        bodies = {self._selected: predicted[only]} if self._selected is not None and only in predicted else {}
        no_people = furniture(self._finder.evidence)
        only_selected = None if self._selected in no_people else self._selected
        found = self._finder.find(depth_mm, timestamp, bodies, only=only_selected)
        no_people = furniture(self._finder.evidence)
        if self._selected is None or self._selected in no_people:
            people = [sighting for sighting in found if sighting.id not in no_people]
            largest = max(people, key=lambda sighting: int(np.count_nonzero(sighting.depth)), default=None)
            self._selected = self._selected if largest is None else largest.id
        if self._selected is None:
            return ()
        for sighting in found:
            if sighting.id == self._selected:
                return (replace(sighting, id=only),)
        return (Sighting(only, np.zeros(self.camera.shape, dtype=np.float32), None, self.camera),)
