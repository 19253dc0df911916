"""Backward tracking of a person from the first detection, so that rows begin when the person enters the image."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from toolkit.people.evidence import furniture
from toolkit.people.sighting import PeopleFinder, Sighting
from toolkit.sensing.recording import Recording
from toolkit.tracking.sightings import SightingFile, StoredSighting


def sightings_before(
    recording: Recording, finder: PeopleFinder, sightings: SightingFile, people: Iterable[int]
) -> Iterator[tuple[int, StoredSighting]]:
    """Yield the frames before the first detection of `people` (ids), each with the sighting of one person.

    `finder` detected them, and `sightings` holds their sightings. The recording is read once and in order, because
    random access restarts a compressed one; 2.5 s of depth are buffered.
    """
    seen = {person: own for person in people if len((own := sightings.of(person)).frames)}
    moments = recording.timestamps
    held: dict[int, np.ndarray] = {}
    yielded: dict[int, list[np.ndarray]] = {}
    # Seconds before the first detection that are searched, and after it in which the person has to be seen.
    before, after = 2.0, 0.5
    fewest = 3  # minimum number of frames with the person after the first detection; noise is shorter
    for person, own in sorted(seen.items(), key=lambda known: int(known[1].frames[0])):
        first = int(own.frames[0])
        start = max(int(np.searchsorted(moments, moments[first] + after)), first + fewest)
        end = int(np.searchsorted(moments, moments[first] - before))
        since, number = range(start, first - 1, -1), 0
        if first == 0 or not set(since) <= set(own.frames.tolist()):
            continue
        held = {frame: held[frame] if frame in held else recording.depth(frame) for frame in range(end, start + 1)}
        backwards = finder.redetect()
        if backwards is None:
            return
        for frame in range(start, end - 1, -1):
            found = {s.id: s for s in backwards.find(held[frame], moments[-1] - moments[frame], {})}
            if frame == first:
                number = _same(own[frame], found)
            if frame >= first:
                continue
            others = [there.depth > 0 for k in seen if k != person and (there := seen[k][frame]) is not None]
            others += yielded.get(frame, [])
            earlier = _apart_from(others, found.get(number))
            if earlier is None or number in furniture(backwards.evidence):
                break
            yielded.setdefault(frame, []).append(earlier.depth > 0)
            yield frame, StoredSighting.of(replace(earlier, id=person))


def _same(known: Sighting | None, found: Mapping[int, Sighting]) -> int:
    """Return the id among `found` with most pixels of a stored sighting; 0 if none has any."""
    if known is None:
        return 0
    shared = {k: int(np.count_nonzero((own.depth > 0) & (known.depth > 0))) for k, own in found.items()}
    best = max(shared, key=lambda k: shared[k], default=0)
    return best if best and shared[best] else 0


def _apart_from(others: Iterable[np.ndarray], sighting: Sighting | None) -> Sighting | None:
    """Return a sighting without the pixels (masks) of other people; None if too little is left."""
    if sighting is None:
        return None
    theirs = np.any([np.zeros(sighting.depth.shape, dtype=np.bool_), *others], axis=0)
    depth = np.where(theirs, np.float32(0.0), sighting.depth)
    # Minimum fraction of pixels that belong to no other person; below it the sighting is of another person.
    min_own_fraction = 0.5
    if np.count_nonzero(depth) <= min_own_fraction * np.count_nonzero(sighting.depth):
        return None
    unobserved = theirs if sighting.unobserved is None else sighting.unobserved | theirs
    return replace(sighting, depth=depth, unobserved=unobserved)
