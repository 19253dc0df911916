"""Finder of one person among several, selected over the whole recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from toolkit.io.errors import SegmentationError
from toolkit.people.evidence import Evidence, furniture
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SegmentationMode, SensingSettings

ID = 1
TOGETHER = 0.5
"""Maximum fraction of frames in common with a rival for a person to be the only one."""


class SelectedPersonFinder:
    """`PeopleFinder` of one id of another finder.

    Parameters
    ----------
    finder : of all people, before its first frame
    meant : the id
    """

    evidence: Mapping[int, Evidence] = MappingProxyType({})

    def __init__(self, finder: MultiPersonFinder, meant: int) -> None:
        self._finder, self._meant = finder, meant
        self.camera = finder.camera

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        """Find the person, see `PeopleFinder.find`: one sighting in every frame, empty where the person is not
        visible.
        """
        told = {self._meant: predicted[ID]} if ID in predicted else {}
        for sighting in self._finder.find(depth_mm, timestamp, told):
            if sighting.id == self._meant:
                return (replace(sighting, id=ID),)
        return (Sighting(ID, np.zeros(self.camera.shape, dtype=np.float32), None, self.camera),)

    def redetect(self) -> MultiPersonFinder:
        """Return the finder of all people, see `PeopleFinder.redetect`."""
        return self._finder.redetect()

    def export_state(self) -> dict[str, Any]:
        """Return the state, see `PeopleFinder.export_state`."""
        return self._finder.export_state()

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Restore a state, see `PeopleFinder.restore_state`."""
        self._finder.restore_state(state)


@dataclass
class Presence:
    """Presence of a person over a recording: frames, total area in m^2, distance in each frame in metres."""

    frames: set[int] = field(default_factory=set)
    area: float = 0.0
    distances: list[float] = field(default_factory=list)


def meant_person(recording: Recording, finder: MultiPersonFinder, sensing: SensingSettings) -> int:
    """Return the id of the person that `sensing.subject` selects; `finder` is used up.

    The ids are those of the tracking pass: a person gets theirs in the first frame in which they are seen.

    Raises
    ------
    SegmentationError
        No person is found, none at the pixel of "seed:U,V", or `subject` is "only" and there are several
        for most of the time.
    """
    mode = SegmentationMode.parse(sensing.segment)
    seen: dict[int, Presence] = {}
    at_seed = 0
    for i in range(len(recording)):
        labels, depth = finder.follow(recording.depth(i), float(recording.timestamps[i]))
        if mode.name == "seed" and at_seed == 0 and not seen:
            at_seed = int(labels[finder.coarse_pixel(mode.numbers[0], mode.numbers[1])])
        for number in np.unique(labels[labels > 0]).tolist():
            own = depth[labels == number]
            presence = seen.setdefault(number, Presence())
            presence.frames.add(i)
            presence.area += finder.lens.area(own)
            presence.distances.append(float(np.median(own)))
    if mode.name == "seed":
        if at_seed == 0:
            raise SegmentationError(
                f"no person is found at the pixel of --segment {sensing.segment}; give a pixel of the person in the "
                "first frame, or --segment person"
            )
        return at_seed
    dropped = furniture(finder.evidence)
    people = {number: p for number, p in seen.items() if number not in dropped}
    if not people:
        return next(iter(seen), ID)  # no sighting of this id will come; every row of the track is empty
    first = max(people, key=lambda number: people[number].area)
    if sensing.subject == "nearest":
        return min(people, key=lambda number: float(np.median(people[number].distances)))
    if sensing.subject == "only":
        rivals = [n for n, p in people.items() if n != first and _together(people[first], p) > TOGETHER]
        if rivals:
            raise SegmentationError(
                f"{1 + len(rivals)} people are in view; give --people all, --subject nearest or largest, or --segment "
                "seed:U,V (a pixel of the person)"
            )
    return first


def _together(first: Presence, other: Presence) -> float:
    """Return the fraction of the first one's frames with the other in view."""
    return len(first.frames & other.frames) / max(len(first.frames), 1)
