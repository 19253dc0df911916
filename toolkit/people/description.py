"""Description of a recording: camera, vertical, room, people, and helpful options (`depthmocap info`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.people.evidence import Evidence, furniture
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.people.plausibility import Concern, plausibility
from toolkit.people.sighting import Sighting
from toolkit.people.surroundings import Surroundings
from toolkit.people.survey import survey
from toolkit.people.view import CoarseCamera
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings

CUTS = ((0.35, "head"), (0.6, "chest"), (1.0, "waist"), (1.35, "knees"))
"""Metres below the centre of the head at which the image truncates an adult, and the body part there."""


@dataclass(frozen=True, eq=False)
class FirstLook:
    """Description of the first seconds of a recording.

    Attributes
    ----------
    lines : camera; up; room; people; advice
    frame : number of the frame with the most people, the first of them
    depth_mm : uint16 (H, W), that frame
    sightings : the people in it
    concerns : reasons to doubt the recording
    """

    lines: tuple[str, str, str, str, str]
    frame: int
    depth_mm: np.ndarray
    sightings: tuple[Sighting, ...]
    concerns: tuple[Concern, ...] = ()


def describe(recording: Recording, sensing: SensingSettings | None = None) -> FirstLook:
    """Describe the first seconds of a recording.

    Raises
    ------
    RecordingError
        A frame cannot be read.
    """
    sensing = sensing or SensingSettings()
    surroundings = survey(recording, sensing)
    finder = MultiPersonFinder(recording.camera, recording.up_camera, surroundings, sensing)
    first_seconds = 3.0
    end = int(np.searchsorted(recording.timestamps, recording.timestamps[0] + first_seconds))
    frames = 45  # maximum number of examined frames
    numbers = np.unique(np.linspace(0, max(end - 1, 0), min(max(end, 1), frames)).astype(np.int64))
    best: tuple[int, tuple[Sighting, ...]] = (0, ())
    for i in numbers:
        sightings = finder.find(recording.depth(int(i)), float(recording.timestamps[i]), {})
        if len(sightings) > len(best[1]):
            best = (int(i), sightings)
    frame, sightings = best[0], tuple(s for s in best[1] if s.id not in furniture(finder.evidence))
    depth = recording.depth(frame)
    coarse = CoarseCamera(recording.camera.undistorted(), recording.up_camera, sensing)
    people = [person_text(s, coarse, finder.evidence.get(s.id)) for s in sightings]
    concerns = plausibility(recording)
    advice = _advice(recording, surroundings, sightings)
    lines = (
        _camera_line(recording),
        _up_line(recording),
        _room_line(surroundings),
        f"people: {len(people)} in the first {first_seconds:g} s" + "".join(f"\n  {text}" for text in people),
        f"advice: {'; '.join(advice) if advice else 'none, the defaults fit' if not concerns else 'see the doubts'}",
    )
    return FirstLook(lines, frame, depth, sightings, concerns)


def _camera_line(recording: Recording) -> str:
    camera, times = recording.camera, recording.timestamps
    rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0
    rated = f", {rate:.1f} frames a second" if rate else ""
    bent = ", lens distortion taken out" if camera.distortion is not None else ""
    angle = np.rad2deg(2 * np.arctan(camera.width / (2 * camera.fx)))
    return f"camera: {camera.width} x {camera.height}, {angle:.0f} degrees wide{bent}, {len(times)} frames{rated}"


def _up_line(recording: Recording) -> str:
    vertical = recording.vertical
    tilt = np.rad2deg(np.arcsin(np.clip(-vertical.up_camera[2], -1, 1)))
    roll = np.rad2deg(np.arctan2(vertical.up_camera[0], -vertical.up_camera[1]))
    where = f", {vertical.height:.2f} m above the floor" if vertical.height is not None else ""
    return (
        f"up: {vertical.source}; the camera looks {abs(tilt):.0f} degrees {'down' if tilt >= 0 else 'up'}, "
        f"rolled by {roll:.0f}{where}"
    )


def _room_line(surroundings: Surroundings) -> str:
    if surroundings.cut_out:
        return "room: none, people are cut out already"
    how = "known or learnt" if surroundings.known else "not known, too few frames to learn it"
    return f"room: {how}, {len(surroundings.planes)} walls and floors"


def person_text(sighting: Sighting, coarse: CoarseCamera, evidence: Evidence | None = None) -> str:
    """Return number, distance, truncation by the image border, and the evidence that it is a person."""
    v, u = np.nonzero(largest_surface(sighting.depth))
    distance = float(np.median(sighting.depth[v, u]))
    height, width = sighting.depth.shape
    border_pixels = 3
    border = border_pixels * max(1, coarse.step)
    cuts = []
    border_share = 0.05  # fraction of a person's width or height on such a border
    if np.count_nonzero(v >= height - border) > border_share * np.ptp(u):
        cuts.append(f"cut off at the {_cut_at(sighting, coarse)}")
    if np.count_nonzero(v < border) > border_share * np.ptp(u):
        cuts.append("cut off above")
    if min(u.min(), width - 1 - u.max()) < border:
        cuts.append("cut off at the side")
    why = "" if evidence is None else f" ({evidence.text()})"
    return f"{sighting.id} at {distance:.1f} m, {' and '.join(cuts) if cuts else 'whole'}{why}"


def largest_surface(depth: np.ndarray) -> np.ndarray:
    """Return the largest connected surface, bool (H, W): specks are not part of a person.

    `depth` is float32 (H, W) in metres, 0 where nothing was measured.
    """
    import cv2

    count, labels, stats, _ = cv2.connectedComponentsWithStats((depth > 0).astype(np.uint8), connectivity=8)
    if count < 2:
        return np.zeros(depth.shape, dtype=bool)
    return np.asarray(labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))


def _cut_at(sighting: Sighting, coarse: CoarseCamera) -> str:
    """Return the body part at the lower image border, by the height from there to the top of the head."""
    v, u = np.nonzero(largest_surface(sighting.depth))
    z = sighting.depth[v, u].astype(np.float64)
    camera: Camera = sighting.camera
    points = np.column_stack([(u - camera.cx) * z / camera.fx, (v - camera.cy) * z / camera.fy, z])
    heights = points[:, 0] * coarse.up[0] + points[:, 1] * coarse.up[1] + points[:, 2] * coarse.up[2]
    drop = float(np.percentile(heights, 98) - np.percentile(heights, 1)) - 0.1
    return next((name for limit, name in CUTS if drop < limit), "shins")


def _advice(
    recording: Recording,
    surroundings: Surroundings,
    sightings: tuple[Sighting, ...],
) -> list[str]:
    found = []
    if len(sightings) > 1:
        found.append("--people all follows all of them")
    if not sightings:
        found.append("no person is seen: check --depth-unit and --intrinsics, or give --segment seed:U,V")
    elif len(sightings) == 1 and not surroundings.cut_out and recording.background is None:
        found.append("--people all separates the person from the room, or give --background")
    if recording.vertical.source == "assumed" and not surroundings.cut_out:
        found.append("--up X,Y,Z if the camera is tilted: no floor is seen")
    full_size = 300_000  # pixels of an image above which half resolution is used, four times as fast
    if recording.camera.width * recording.camera.height >= full_size:
        found.append("--set sensing.half_resolution=true is faster")
    if sightings and recording.has_color:
        found.append("--joints colour also uses the colour images, if registered to the depth (extra `joints`)")
    return found
