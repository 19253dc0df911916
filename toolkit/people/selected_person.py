"""Finder of one person among several, selected over the whole recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from toolkit.io.errors import SegmentationError, SeveralPeopleError
from toolkit.people.evidence import Evidence, furniture
from toolkit.people.known_people import SHORTER, WALK
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.people.sighting import PredictedBody, Sighting, WrappedFinder
from toolkit.people.tracks import GATE, LEVEL, KnownPerson
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SegmentationMode, SensingSettings

ID = 1
FIRST_SECONDS = 10.0
"""Seconds after which two people in view together are refused, so that a long recording is not followed to its end."""


class SelectedPersonFinder(WrappedFinder):
    """`PeopleFinder` of one person of another finder.

    Parameters
    ----------
    finder : finder of all people, before its first frame
    pieces : ids of the person, see `meant_person`
    """

    _finder: MultiPersonFinder
    evidence: Mapping[int, Evidence] = MappingProxyType({})

    def __init__(self, finder: MultiPersonFinder, pieces: frozenset[int]) -> None:
        self._finder, self._pieces = finder, pieces
        self.camera = finder.camera

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        """Find the person, see `PeopleFinder.find`: one sighting in every frame, empty without the person."""
        known = [person for person in self._finder.people if person.id in self._pieces]
        current = max(known, key=lambda person: person.last).id if known else min(self._pieces)
        bodies = {current: predicted[ID]} if ID in predicted else {}
        found = {s.id: s for s in self._finder.find(depth_mm, timestamp, bodies) if s.id in self._pieces}
        if not found:
            return (Sighting(ID, np.zeros(self.camera.shape, dtype=np.float32), None, self.camera),)
        return (replace(found.get(current) or found[min(found)], id=ID),)


@dataclass
class Presence:
    """Presence of a person over a recording.

    Attributes
    ----------
    first, last : state of the track in the first and the last frame with the person
    frames : numbers of the frames
    area : total, m^2
    distances : in each frame, metres
    """

    first: KnownPerson
    last: KnownPerson
    frames: set[int] = field(default_factory=set)
    area: float = 0.0
    distances: list[float] = field(default_factory=list)


def meant_person(recording: Recording, finder: MultiPersonFinder, sensing: SensingSettings) -> frozenset[int]:
    """Return the ids of the person that `sensing.subject` selects; `finder` is used up.

    A person who was lost and found again may have several: those of pieces that can be one person, see `joined`.

    The ids are those of the tracking pass: a person gets theirs in the first frame in which they are seen.

    Raises
    ------
    SeveralPeopleError
        `subject` is "only" and there are several for most of the time, or of the first `FIRST_SECONDS`.
    SegmentationError
        No person is at the pixel of "seed:U,V" in the first frame with a person.
    """
    mode = SegmentationMode.parse(sensing.segment)
    seen: dict[int, Presence] = {}
    at_seed = 0
    unchecked = sensing.subject == "only" and mode.name != "seed"
    for i, time in enumerate(recording.timestamps - recording.timestamps[0]):
        labels, depth = finder.follow(recording.depth(i), float(recording.timestamps[i]))
        if mode.name == "seed" and not seen and labels.any():
            at_seed = int(labels[finder.coarse_pixel(mode.numbers[0], mode.numbers[1])])
            if at_seed == 0:
                raise SegmentationError(
                    f"no person is found at the pixel of --segment {sensing.segment}; give a pixel of the person in "
                    "the first frame with a person, or --segment person"
                )
        for number in np.unique(labels[labels > 0]).tolist():
            own = depth[labels == number]
            state = finder.people[number - 1]
            presence = seen.setdefault(number, Presence(state, state))
            presence.last = state
            presence.frames.add(i)
            presence.area += finder.coarse.area(own)
            presence.distances.append(float(np.median(own)))
        if unchecked and time >= FIRST_SECONDS:
            _check_alone(_without_furniture(seen, finder))
            unchecked = False
    if at_seed:
        return joined(at_seed, seen)
    people = _without_furniture(seen, finder)
    if not people:
        return frozenset({next(iter(seen), ID)})  # no sighting of this id will come; every row of the track is empty
    if sensing.subject == "nearest":
        return joined(min(people, key=lambda number: float(np.median(people[number].distances))), people)
    if sensing.subject == "only":
        _check_alone(people)
    return joined(_largest(people), people)


def _without_furniture(seen: Mapping[int, Presence], finder: MultiPersonFinder) -> dict[int, Presence]:
    dropped = furniture(finder.evidence)
    return {number: presence for number, presence in seen.items() if number not in dropped}


def _largest(people: Mapping[int, Presence]) -> int:
    return max(people, key=lambda number: people[number].area)


def _check_alone(people: Mapping[int, Presence]) -> None:
    """Raise SeveralPeopleError if others are in view in most frames of the largest person."""
    if not people:
        return
    first = _largest(people)
    together = 0.5  # maximum fraction of frames in common with a rival for a person to be the only one
    rivals = [n for n, p in people.items() if n != first and _together(people[first], p) > together]
    if rivals:
        raise SeveralPeopleError.of(1 + len(rivals))


def joined(meant: int, people: Mapping[int, Presence]) -> frozenset[int]:
    """Return the ids of the pieces that can be the person `meant`, the largest pieces first.

    Two pieces can be one person if they have no frame in common, the way between them is walked in the time between
    them, and they are of one height and a similar area.
    """
    pieces = [people[meant]]
    numbers = {meant}
    for number in sorted(people.keys() - numbers, key=lambda number: -people[number].area):
        if all(_can_be_one(piece, people[number]) for piece in pieces):
            pieces.append(people[number])
            numbers.add(number)
    return frozenset(numbers)


def _can_be_one(one: Presence, other: Presence) -> bool:
    """Return True if two pieces can be of one person."""
    if one.frames & other.frames:
        return False
    early, late = (one, other) if one.last.last < other.first.first else (other, one)
    if early.last.last >= late.first.first:
        return False  # one piece lies in a gap of the other: that person returned without this one
    away = (late.first.head - early.last.head) * LEVEL
    if float(np.hypot(away[0], away[2])) > GATE + WALK * (late.first.first - early.last.last):
        return False
    least_area = 0.5  # minimum ratio of the areas: a side view shows half of a front view
    areas = sorted((one.last.area, other.last.area))
    return abs(one.last.tallest - other.last.tallest) < SHORTER and areas[0] >= least_area * areas[1]


def _together(first: Presence, other: Presence) -> float:
    """Return the fraction of the first one's frames with the other in view."""
    return len(first.frames & other.frames) / max(len(first.frames), 1)
