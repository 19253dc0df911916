"""People before their detection: search with reversed time."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, scene
from toolkit.app.pipeline.earlier import sightings_before
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.people.sighting import Sighting
from toolkit.people.survey import find_people
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.recording import Recording
from toolkit.tracking.sightings import SightingFile

ROOM = {"height": 1.2, "wall": 4.0, "floor": True}
RATE, FRAMES = 10, 40


def walking(folder: Path, others: Sequence[tuple[float, float]] = ()) -> tuple[Recording, list[np.ndarray]]:
    """Return a recording in which person 1 enters from the left and stays and others stand, and the person of each
    pixel.
    """
    shown = [scene(KINECT, ((-1.9 + 0.12 * min(k, 16), 2.4), *others), **ROOM) for k in range(FRAMES)]
    background, path = scene(KINECT, (), **ROOM)[0], folder / "walk.npz"
    save_recording(
        path, depth=[depth for depth, _ in shown], camera=KINECT, timestamps=np.arange(FRAMES) / RATE,
        background=background, up_camera=np.array([0.0, -1.0, 0.0]),
    )  # fmt: skip
    return open_recording(path), [who for _, who in shown]


def found(folder: Path, recording: Recording, left_out: Iterable[int] = ()) -> tuple[MultiPersonFinder, SightingFile]:
    """Return a finder after all frames, and its sightings without some frames of the first person."""
    finder, without = find_people(recording), set(left_out)
    kept = SightingFile(folder / "kept", finder.camera)
    for frame in range(len(recording)):
        sightings = finder.find(recording.depth(frame), recording.timestamps[frame], {})
        kept.append(frame, [s for s in sightings if s.id != 1 or frame not in without])
    return finder, kept


def found_as(folder: Path, finder: MultiPersonFinder, kept: SightingFile, since: Mapping[int, int]) -> SightingFile:
    """Return the first person's sightings as those of several people, each from a frame on (`since`, by id)."""
    walker, late = kept.of(1), SightingFile(folder, finder.camera)
    for frame in range(min(since.values()), FRAMES):
        sighting = walker[frame]
        assert sighting is not None
        late.append(frame, [replace(sighting, id=person) for person, first in since.items() if frame >= first])
    return late


def before(
    recording: Recording, finder: MultiPersonFinder, kept: SightingFile, people: Iterable[int] = (1,)
) -> dict[int, Sighting]:
    """Return earlier sightings by frame."""
    return {frame: own.sighting() for frame, own in sightings_before(recording, finder, kept, people)}


def test_who_was_found_late_is_seen_back_to_where_they_came_in(tmp_path: Path) -> None:
    recording, who = walking(tmp_path)
    finder, kept = found(tmp_path, recording, left_out=range(18))
    earlier = before(recording, finder, kept)
    frames = sorted(earlier)
    assert frames == list(range(frames[0], 18)) and frames[0] <= 6, "without a gap"
    assert np.count_nonzero(who[frames[0] - 1]) < 1500, "before that little of them is in the image"
    assert {sighting.id for sighting in earlier.values()} == {1}
    for frame in frames[4:]:
        own, true = earlier[frame].depth > 0, who[frame] == 1
        assert (own & true).sum() > 0.85 * (own | true).sum()


@pytest.mark.parametrize("left_out", [[*range(18), 20], range(36)], ids=["with a gap", "at the end"])
def test_what_is_not_seen_for_half_a_second_is_noise_and_has_no_past(tmp_path: Path, left_out: Iterable[int]) -> None:
    recording, _ = walking(tmp_path)
    finder, kept = found(tmp_path, recording, left_out)
    assert before(recording, finder, kept) == {}


def test_who_is_there_from_the_first_frame_on_has_no_past_and_keeps_their_pixels(tmp_path: Path) -> None:
    recording, _ = walking(tmp_path, others=[(0.9, 2.8)])
    finder, kept = found(tmp_path, recording)
    standing, walker = kept.of(1), kept.of(2)
    assert standing.frames[0] == 0 < walker.frames[0]
    assert before(recording, finder, kept, [1]) == {}
    late = int(walker.frames[0])
    assert set(before(recording, finder, kept, [1, 2])) <= set(range(late))
    own = {frame: [s for s in (standing[frame], walker[frame]) if s is not None] for frame in range(FRAMES)}
    taken = SightingFile(tmp_path / "taken", finder.camera)
    for frame, sightings in own.items():  # the first has all pixels of the second, who was found at frame 20
        depth = np.max([s.depth for s in sightings], axis=0)
        taken.append(
            frame, [Sighting(1, depth, None, finder.camera), *(s for s in sightings if s.id == 2 and frame >= 20)]
        )
    assert before(recording, finder, taken, [1, 2]) == {}, "what is somebody else's is not theirs"


def test_a_recording_is_read_in_order_for_all_people(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compressed recording starts again for each step backwards."""
    recording, _ = walking(tmp_path)
    finder, kept = found(tmp_path, recording)
    late = found_as(tmp_path / "late", finder, kept, {1: 23, 2: 18})
    asked, depth = [], recording.depth
    monkeypatch.setattr(recording, "depth", lambda frame: asked.append(frame) or depth(frame))
    assert {own.id for _, own in sightings_before(recording, finder, late, [1, 2])} == {2}, "1 had all pixels of 2"
    assert asked == list(range(asked[0], 29))
    assert before(recording, finder, late, [3]) == {}, "of whom nothing was kept"


def test_the_part_of_a_person_behind_another_is_unobserved(tmp_path: Path) -> None:
    recording, _ = walking(tmp_path)
    finder, kept = found(tmp_path, recording)
    walker, split = kept.of(1), SightingFile(tmp_path / "split", finder.camera)
    for frame in range(FRAMES):
        sighting = walker[frame]
        if sighting is None:
            continue
        theirs = sighting.depth.copy()  # the feet belong to a person who is present all the time
        theirs[: int(np.quantile(np.nonzero(sighting.depth)[0], 0.7))] = 0.0
        split.append(frame, [replace(sighting, depth=theirs), *([replace(sighting, id=2)] if frame >= 20 else [])])
    earlier = [(frame, own.sighting()) for frame, own in sightings_before(recording, finder, split, [1, 2])]
    earlier, other = [(frame, own) for frame, own in earlier if own.id == 2], split.of(1)
    assert len(earlier) > 5
    for frame, own in earlier:
        there = other[frame]
        if there is None:
            continue
        assert (
            own.unobserved is not None
            and own.unobserved[there.depth > 0].all()
            and not own.depth[there.depth > 0].any()
        )
        assert own.depth.any()
