"""Plausibility of a recording: size of people, unit, intrinsics, orientation and times, checked before it is tracked.

A wrong unit, the intrinsics of another image size or a camera upside down raise no error by themselves: the tracker
fits a body to whatever surface there is. The checks compare the recording with what is known of people and cameras.
The person network scores heads. In 12 real recordings of people who are cut out the best head has 1.7 to 4.9 log-odds
in upright images at true scale, 1.2 to 3.8 at half the scale, at most 1.1 at twice the scale and at most 0.3 in turned
images; in 9 real rooms 0.6 to 4.7, at half the scale at most 2.2, and at most 0.5 in turned images.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from toolkit.io.errors import PlausibilityWarning
from toolkit.people.connection import FASTEST, HELD, connected
from toolkit.people.detection import LEAST_CUT_OUT, find_heads
from toolkit.people.learning import share_of
from toolkit.people.surroundings import Surroundings, first_look, tolerances
from toolkit.people.unassigned import surfaces
from toolkit.people.view import CoarseCamera, View
from toolkit.sensing.camera import DEFAULT_UP, Camera
from toolkit.sensing.conversion import DEPTH_UNITS, unit_in_metres
from toolkit.sensing.image_sizes import size_of_centre
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings

HELP = "see docs/troubleshooting.md"
"""The end of every warning: the page with symptoms, causes and options."""
Kind = Literal["intrinsics", "unit", "size", "orientation", "times"]


SAMPLED_SECONDS = 10.0
"""First seconds of a recording that are sampled."""
SURE, SURE_IN_ROOM = 1.5, 0.5
"""Minimum log-odds of a head at which no other unit or orientation is tried: segmented people; people in a room."""
STATURE = (0.95, 2.7)
"""Metres from head to foot of a person who is cut out: a child of two years to an adult with raised arms."""


@dataclass(frozen=True)
class Concern:
    """One reason to doubt that a recording was read as it was meant.

    Attributes
    ----------
    kind : subject of the concern
    text : the measurement, and the option that helps
    """

    kind: Kind
    text: str

    def warning(self, name: str) -> PlausibilityWarning:
        """Return the concern about the recording of that name as a warning."""
        return PlausibilityWarning(f"{name}: {self.text}; {HELP}")


@dataclass(frozen=True)
class PersonEvidence:
    """Evidence for people in sampled frames, under one unit and orientation.

    Attributes
    ----------
    score : mean over the frames of the best log odds of a head, at least 0
    stature : metres, median height of what is cut out and whole; None where nothing is
    cut_out : True where most frames hold nothing but people
    doubtful : True where the height of the camera above the floor contradicts unit and orientation
    """

    score: float
    stature: float | None
    cut_out: bool
    doubtful: bool = False

    def sure(self) -> bool:
        """Return True where the heads alone show that unit and orientation are right."""
        return self.score >= (SURE if self.cut_out else SURE_IN_ROOM)

    def worse_than(self, other: PersonEvidence) -> bool:
        """Return True where another unit or orientation is clearly better."""
        person = SURE  # log-odds that a head needs in another unit or orientation
        margin = 0.5 if self.cut_out or self.doubtful else 1.5  # required improvement of the score there
        return other.score >= (person if not self.fits() else max(person, self.score + margin))

    def plausible(self) -> float:
        """Return the score less the cost of the stature, to compare units."""
        adult, spread = 1.68, 0.2  # metres: adults (ANSUR II), and children beside them
        return self.score - (0.0 if self.stature is None else 0.5 * ((self.stature - adult) / spread) ** 2)

    def fits(self) -> bool:
        """Return True where the stature is that of a person, or is not known."""
        return self.stature is None or STATURE[0] <= self.stature <= STATURE[1]


def plausibility(recording: Recording) -> tuple[Concern, ...]:
    """Return the reasons to doubt a recording, the gravest first; none where everything is plausible.

    Raises
    ------
    RecordingError
        A frame cannot be read.
    """
    intrinsics = intrinsics_concern(recording)
    frames = sampled_frames(recording)
    found = [intrinsics, *_people_concerns(recording, frames, known=intrinsics is not None)]
    found += [times_concern(recording)]
    if not any(found) and are_unconnected(recording):
        found += [Concern("times", "people move faster than a sprinter between the frames; check --frame-rate")]
    return tuple(concern for concern in found if concern is not None)


def intrinsics_concern(recording: Recording) -> Concern | None:
    """Return a concern if the principal point lies far from the image centre, if cx and cy seem exchanged, or if the
    focal lengths differ.
    """
    # Maximum distance of the principal point from the image centre, as a share of width or height: below 0.06 in
    # registered and binned images of 14 depth cameras.
    farthest = 0.15
    fitting = 0.03  # the same where cx and cy fit each other's side
    oblong = 1.1  # maximum ratio of the focal lengths: below 1.02 in these cameras
    camera = recording.raw_camera
    centre = (camera.width - 1) / 2, (camera.height - 1) / 2
    aside = abs(camera.cx - centre[0]) / camera.width, abs(camera.cy - centre[1]) / camera.height
    exchanged = abs(camera.cy - centre[0]) / camera.width, abs(camera.cx - centre[1]) / camera.height
    numbers = f"the principal point {camera.cx:g},{camera.cy:g} of {camera.width}x{camera.height} pixels"
    if max(exchanged) < fitting < min(aside):
        return Concern("intrinsics", f"{numbers} has cx and cy exchanged; give --intrinsics fx,fy,cx,cy")
    if max(aside) <= farthest:
        if max(camera.fx / camera.fy, camera.fy / camera.fx) < oblong:
            return None
        text = f"the focal lengths {camera.fx:g} and {camera.fy:g} differ, so that people are wide or narrow"
        return Concern("intrinsics", f"{text}; check --intrinsics fx,fy,cx,cy")
    size = size_of_centre(camera.cx, camera.cy)
    like = f"; these look like the intrinsics of {size[0]}x{size[1]}" if size else ""
    return Concern(
        "intrinsics",
        f"{numbers} is {100 * max(aside):.0f} % of the image away from its centre{like}: give the --intrinsics of this "
        "image size",
    )


def times_concern(recording: Recording) -> Concern | None:
    """Return a concern if frames were dropped because their timestamp repeats that of the frame before."""
    repeated = recording.stored_frames - len(recording)
    if not repeated:
        return None
    return Concern(
        "times",
        f"{repeated} of {recording.stored_frames} frames repeat the timestamp of the frame before and are left out; "
        "write the time of each frame",
    )


def are_unconnected(recording: Recording) -> bool:
    """Return True if in no sampled pair of consecutive frames a person can have moved from one place to the other.

    The frames are photographs then, or a film at a wrong rate. Pairs without people in both frames, or more than `HELD`
    seconds apart, are no evidence.
    """
    times = recording.timestamps
    end = int(np.searchsorted(times, times[0] + SAMPLED_SECONDS))
    pairs = 6  # compared pairs of consecutive frames; one that a film can have is enough for a film
    another_room = 0.5  # share of the pixels that are so much nearer or farther that two frames show different rooms
    firsts = np.unique(np.linspace(0, max(end, 2) - 2, pairs).astype(np.int64))
    coarse = CoarseCamera(recording.camera.undistorted(), recording.up_camera, SensingSettings())
    moved = False
    for i in firsts[times[firsts + 1] - times[firsts] <= HELD].tolist() if len(recording) > 1 else ():
        seconds, images = float(times[i + 1] - times[i]), [coarse.downsampled(recording.depth(k)) for k in (i, i + 1)]
        measured = (images[0] > 0) & (images[1] > 0)
        if share_of(np.abs(images[1] - images[0]) > FASTEST * seconds, measured) > another_room:
            moved = True
            continue
        (_, sure), (after, _) = (_places(image, coarse) for image in images)
        if not sure or not after:
            continue
        if any(connected(a, b, seconds) for a in sure for b in after):
            return False
        moved = True
    return moved


def _places(depth: np.ndarray, coarse: CoarseCamera) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the places (3,), level frame, where people may be in a coarse frame (h, w), and those where they are:
    medians of surfaces where people are cut out, heads in a room.
    """
    view, surroundings = _seen(depth, coarse)
    if surroundings.cut_out:
        labels, count, areas = surfaces(view, coarse, np.zeros(depth.shape, dtype=np.int32))
        large = [k for k in range(1, count + 1) if areas[k] >= LEAST_CUT_OUT]
        places = [np.median(view.points[labels == k], axis=0) for k in large]
        return places, places
    heads = find_heads(view, coarse)
    return [head.place for head in heads], [head.place for head in heads if head.score >= SURE_IN_ROOM]


def _seen(depth: np.ndarray, coarse: CoarseCamera) -> tuple[View, Surroundings]:
    """Return a coarse frame (h, w) without walls and floor, and what it shows of the room."""
    surroundings = first_look(depth, coarse)
    return coarse.view(
        depth, surroundings.foreground(depth, coarse.rays, tolerances(depth, coarse)), surroundings.still
    ), surroundings


def sampled_frames(recording: Recording) -> list[np.ndarray]:
    """Return up to three frames with a measurement, spread over the first seconds: uint16 (H, W), millimetres, each."""
    end = int(np.searchsorted(recording.timestamps, recording.timestamps[0] + SAMPLED_SECONDS))
    numbers = np.unique(np.linspace(0, max(end - 1, 0), min(max(end, 1), 3)).astype(np.int64))
    frames = [recording.depth(int(i)) for i in numbers]
    return [frame for frame in frames if frame.any()]


def person_evidence(
    frames: Sequence[np.ndarray], camera: Camera, up_camera: np.ndarray, *, scale: float = 1.0
) -> PersonEvidence:
    """Return the evidence for people in frames (uint16 (H, W), millimetres) whose depth is multiplied by `scale`.

    `camera` and `up_camera` (3,) are those of the frames.
    """
    coarse = CoarseCamera(camera.undistorted(), up_camera, SensingSettings())
    scores, statures, cut_out = [], [], 0
    for frame in frames:
        depth = coarse.downsampled(frame if scale == 1.0 else np.minimum(np.rint(frame * scale), 65535.0))
        view, surroundings = _seen(depth, coarse)
        cut_out += surroundings.cut_out
        if (stature := _stature(depth, view.points)) is not None:
            statures.append(stature)
        scores.append(max([0.0, *(head.score for head in find_heads(view, coarse))]))
    return PersonEvidence(
        float(np.mean(scores)) if scores else 0.0,
        float(np.median(statures)) if statures else None,
        2 * cut_out > len(frames),
    )


def _stature(depth: np.ndarray, points: np.ndarray) -> float | None:
    """Return the largest extent along an axis of the largest surface, metres: the stature also of people who lie.

    None where the image border truncates the surface, as it does in a room, or where most of what is measured lies
    elsewhere.

    Parameters
    ----------
    depth : depth of a coarse frame (h, w)
    points : float64 (h, w, 3), of its pixels, level frame, metres
    """
    import cv2

    count, labels, stats, _ = cv2.connectedComponentsWithStats((depth > 0).astype(np.uint8), connectivity=8)
    if count < 2:
        return None
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    left, top, width, height, area = (int(n) for n in stats[largest])
    if 2 * area < np.count_nonzero(depth):
        return None
    if top == 0 or left == 0 or top + height == depth.shape[0] or left + width == depth.shape[1]:
        return None
    own = points[labels == largest]
    return float((np.percentile(own, 99, axis=0) - np.percentile(own, 1, axis=0)).max())


def _people_concerns(recording: Recording, frames: Sequence[np.ndarray], *, known: bool) -> list[Concern]:
    """Return concerns about the visible people: unit, orientation, size; `known`: the intrinsics are wrong."""
    if not frames or known:
        return []
    own = person_evidence(frames, recording.camera, recording.up_camera)
    floor = None if own.cut_out else _floor_fits(recording)
    if own.fits() and floor is not False and (floor or own.sure()):
        return []
    own = replace(own, doubtful=floor is False)
    unit = _fitting_unit(recording, frames, own)
    if unit:
        present = recording.converter.unit
        size = unit_in_metres(present) / DEPTH_UNITS[unit]
        text = f"people have {size:.2g} times life size with --depth-unit {present}; give --depth-unit {unit}"
        return [Concern("unit", text)]
    turns = better_turns(frames, recording.camera)
    if turns:
        return [Concern("orientation", f"people stand upright in turned images; give --rotate {90 * turns}")]
    if own.stature is not None and not own.fits():
        size_text = f"the person measures {own.stature:.2f} m from head to foot"
        return [Concern("size", f"{size_text}; check --depth-unit and the focal length in --intrinsics")]
    unlike_person = 0.7  # log odds of a head below which what is cut out is not a person
    if own.cut_out and own.score < unlike_person:
        return [
            Concern(
                "size",
                "what is measured does not have the shape of a person; check --depth-unit, --rotate and --intrinsics, "
                "and that the images hold depth, neither disparity nor infra-red",
            )
        ]
    return []


def _floor_fits(recording: Recording) -> bool | None:
    """Return whether the camera stands as high above the floor as cameras do in rooms; None where no floor is seen."""
    height = recording.vertical.height
    low, high = 0.8, 2.6  # metres, evidence for the unit in a room where no person is seen
    return None if height is None else low <= height <= high


def _fitting_unit(recording: Recording, frames: Sequence[np.ndarray], own: PersonEvidence) -> str:
    """Return the unit in `DEPTH_UNITS` in which people have a person's size; "" if none fits better."""
    present = unit_in_metres(recording.converter.unit)
    small, large = STATURE
    best = ("", own)
    for name, metres in DEPTH_UNITS.items():
        scale = metres / present
        if abs(scale - 1.0) < 0.01 or (own.stature is not None and not small <= own.stature * scale <= large):
            continue
        there = person_evidence(frames[:2], recording.camera, recording.up_camera, scale=scale)
        if own.worse_than(there) and (not best[0] or there.plausible() > best[1].plausible()):
            best = (name, there)
    return best[0]


def better_turns(frames: Sequence[np.ndarray], camera: Camera) -> int:
    """Return the quarter turns clockwise after which people stand upright in frames (uint16 (H, W), millimetres).

    0 where they stand upright as the images are, and where no turn is clearly better.
    """
    if not frames:
        return 0

    def evidence(turns: int) -> PersonEvidence:
        turned = [np.ascontiguousarray(np.rot90(frame, -turns)) for frame in frames]
        return person_evidence(turned, camera.rotated(turns), np.array(DEFAULT_UP))

    own = evidence(0)
    if own.sure():
        return 0
    others = {turns: evidence(turns) for turns in (1, 2, 3)}
    best = max(others, key=lambda turns: others[turns].score)
    return best if own.worse_than(others[best]) else 0
