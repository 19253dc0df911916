"""Background model of a recording, computed before its people are detected frame by frame."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from toolkit.io.errors import SegmentationError
from toolkit.people.connection import HELD
from toolkit.people.learning import camera_moved, learnt, rooms_differ
from toolkit.people.multi_person import MOST_PEOPLE, MultiPersonFinder
from toolkit.people.selected_person import SelectedPersonFinder, meant_person
from toolkit.people.sighting import PeopleFinder
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.people.surroundings import Surroundings, empty_scene, first_look, is_cut_out, nothing_but_people
from toolkit.people.vertical import floor_of
from toolkit.people.view import CoarseCamera
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SegmentationMode, SensingSettings

logger = logging.getLogger(__name__)

SAMPLES = 40  # frames over a recording: a walking person leaves each pixel free in most of them


def find(recording: Recording, people: int | None, sensing: SensingSettings) -> PeopleFinder:
    """Return the finder of the selected person (1), of up to `people` people, or (None) of all."""
    return find_person(recording, sensing) if people == 1 else find_people(recording, sensing, most=people)


def find_people(
    recording: Recording, sensing: SensingSettings | None = None, most: int | None = None
) -> MultiPersonFinder:
    """Return a finder of all people in a recording, or of the first `most`.

    Raises
    ------
    SegmentationError
        `sensing.segment` requires a background that the recording lacks.
    """
    sensing = sensing or SensingSettings()
    surroundings = survey(recording, sensing)
    most = MOST_PEOPLE if most is None else most
    return MultiPersonFinder(recording.camera, recording.up_camera, surroundings, sensing, most)


def find_person(recording: Recording, sensing: SensingSettings | None = None) -> PeopleFinder:
    """Return a finder of the person that `sensing` selects; in a room the whole recording decides.

    Raises
    ------
    SegmentationError
        `sensing.segment` requires a background that the recording lacks, or several people fit.
    """
    sensing = sensing or SensingSettings()
    mode = SegmentationMode.parse(sensing.segment).name
    if mode in ("person", "seed") or (mode == "auto" and recording.background is None):
        room = survey(recording, sensing)
        if not room.cut_out:
            finder = MultiPersonFinder(recording.camera, recording.up_camera, room, sensing)
            return SelectedPersonFinder(finder, meant_person(recording, finder.redetect(), sensing))
    return SinglePersonSegmenter.of(recording, sensing)


def survey(recording: Recording, sensing: SensingSettings) -> Surroundings:
    """Return the background model of a recording: its empty scene, people only, or a model of sampled frames.

    `sensing.segment` selects the model; "person" and "seed" mean that people are not segmented.

    Raises
    ------
    SegmentationError
        It requires a background that the recording lacks.
    """
    polisher = DepthFilter(recording.camera, sensing)
    mode = SegmentationMode.parse(sensing.segment)
    coarse = CoarseCamera(polisher.flat_camera, recording.up_camera, sensing)
    if mode.name == "background" and recording.background is None:
        raise SegmentationError(
            "--segment is background and the recording has none; give --background or --segment auto"
        )
    if mode.name in ("auto", "background") and recording.background is not None:
        background = coarse.downsampled(polisher.undistort(recording.background))
        return empty_scene(background, coarse, sensing.background_margin)
    if mode.name in ("segmented", "range"):
        return nothing_but_people(coarse)
    if mode.name == "empty-frames":
        count = min(int(mode.numbers[0]), len(recording))
        stack = np.stack([coarse.downsampled(polisher.checked(recording.depth(i))) for i in range(count)])
        return empty_scene(np.median(stack, axis=0).astype(np.float32), coarse, sensing.background_margin)
    first_frames = 3  # frames that decide whether people are segmented already
    if mode.name == "auto":
        first = list(_coarse(recording, polisher, coarse, np.arange(min(first_frames, len(recording)))))
        if all(is_cut_out(depth, coarse) for depth in first):
            return nothing_but_people(coarse)
    spread = np.unique(np.linspace(0, len(recording) - 1, min(SAMPLES, len(recording))).astype(np.int64))
    floor = floor_of(recording)
    frames = list(_coarse(recording, polisher, coarse, spread))
    if np.median(np.diff(recording.timestamps[spread], prepend=-np.inf)) > HELD and rooms_differ(frames, coarse):
        return first_look(frames[0], coarse)
    if camera_moved(frames, coarse):
        logger.warning(
            "%s: its first half shows another room than its second, the camera was moved; furniture may be taken for "
            "people, track the parts before and after as two recordings",
            recording.name,
        )
    room = learnt(frames, coarse, floor)
    return replace(room, floor=floor)


def _coarse(
    recording: Recording, polisher: DepthFilter, coarse: CoarseCamera, frames: np.ndarray
) -> Iterator[np.ndarray]:
    return (coarse.downsampled(polisher.checked(recording.depth(int(i)))) for i in frames)
