"""People in real rooms, annotated by hand: `depthmocap bench rooms [--names um,filinha] [--database POSES]`.

Six sequences of a structured-light camera: a classroom, five people in a row, two views of people who cross a
laboratory. Each is tracked with `--people all` and no other option, and scored against `annotations/rooms/`.
`--joints colour` registers the colour to the depth by the calibration below. `--single` finds the heads of each
annotated frame alone, without tracking.

All distances are in metres in the image plane at the measured depth of the annotated point (pixels * z / f). Counts:

clear, occluded, small
    A tracked head within `HEAD_RADIUS` of the annotated head and within `DEPTH_GATE` along the ray, matched one to one,
    and all annotated heads. People at the image border (`edge`) are optional: neither missed nor false.
false
    Tracked people in annotated frames without a match: on furniture (head, neck, middle of the trunk or pelvis in a
    distractor box at its depth), elsewhere, and apart from these on an annotated `person` with the head off or as a
    second track.
switches, handed
    Changes of the matched track of an annotated person from one matched frame to the next, and the reverse: a track
    that goes from one annotated person to another.
joints
    Per group: annotated joints of matched people within `NEAR`, the same with left and right of the whole body
    exchanged where that fits better, and their number.
stature
    Matched people whose stature is within `STATURE`, and all matched people.
"""

import argparse
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks._record import benchmark, script
from benchmarks._rows import DATABASE, poses_of, track_each
from tests.support.suite import ROOT
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline import TrackerRecipe
from toolkit.app.pipeline.image_joints import JointChoice
from toolkit.body.skeleton import REPORTED
from toolkit.datasets.folder import data_folder
from toolkit.landmarks.joint_network import OPPOSITE
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.recordings.opening import open_recording
from toolkit.recordings.readers.mkv import FactoryCalibration, registered
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.camera import Camera
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import TRACKED, Track
from toolkit.tracks.runs import load_people

ROOMS = data_folder() / "rooms"
ANNOTATIONS = ROOT / "benchmarks" / "annotations" / "rooms"
RATES = {"filinha": 5.0, "um": 3.5, "lab1_cam1": 1.7, "lab1_cam2": 1.7, "lab2_cam1": 1.7, "lab2_cam2": 1.7}
"""Frame rates of the sequences, within a quarter."""
OFFSETS = {
    **dict.fromkeys(("filinha", "um"), (9.0, 2.5)),
    **dict.fromkeys(("lab1_cam1", "lab2_cam1"), (10.4, -4.8)),
    **dict.fromkeys(("lab1_cam2", "lab2_cam2"), (5.4, 1.4)),
}
"""Sequence -> offset of the colour's edges from the depth's after calibration, pixels."""
COLOR_CAMERA = (534.286, 534.745, 309.567, 243.072)
COLOR_SHIFT = (-0.0263, 0.0003, -0.0008)
"""Intrinsics of the colour camera, and metres from depth to colour; both cameras have the same orientation."""
FILLED = 41
"""Side of the window from which an unmeasured pixel takes its depth, so that the network sees no black holes."""


HEAD_RADIUS, DEPTH_GATE, DEPTH_GATE_SMALL = 0.25, 0.75, 1.5
"""Metres between a tracked and an annotated head: in the image plane, along the ray, along the ray for small people."""
STATURE = (1.5, 2.0)
"""Metres: plausible statures of the annotated people, who are all adults."""
NEAR = 0.15
"""Maximum error of a correct joint, metres."""
GROUPS = {
    "head": ["head"],
    "trunk": ["left_shoulder", "right_shoulder", "left_hip", "right_hip"],
    "arms": ["left_elbow", "right_elbow", "left_wrist", "right_wrist"],
    "legs": ["left_knee", "right_knee", "left_ankle", "right_ankle"],
}


_OTHER_SIDE = {name: REPORTED[other] for name, other in zip(REPORTED, OPPOSITE, strict=True)}


def annotations_of(name: str) -> dict[str, Any]:
    """Return the annotations of a sequence."""
    truth: dict[str, Any] = json.loads((ANNOTATIONS / f"{name}.json").read_text(encoding="utf-8"))
    return truth


def in_colour(name: str, rooms: Path, work: Path) -> Path:
    """Return a sequence with its colour registered to the depth, as a recording in `work`, made if missing."""
    import cv2

    path = work / "rooms" / f"{name}_colour.npz"
    if path.exists():
        return path
    plain = open_recording(rooms / name, intrinsics=tuple(annotations_of(name)["intrinsics"]))
    (fx, fy, cx, cy), (right, down) = COLOR_CAMERA, OFFSETS[name]
    color_camera = Camera(fx, fy, cx + right, cy + down, plain.camera.width, plain.camera.height)
    lenses = FactoryCalibration(plain.camera, color_camera, np.eye(3), np.array(COLOR_SHIFT), np.eye(3))
    with RecordingWriter(path, plain.camera) as writer:
        for i in range(len(plain)):
            depth, color = plain.depth(i), plain.color(i)
            assert color is not None
            near, share = (cv2.blur(image.astype(np.float64), (FILLED, FILLED)) for image in (depth, depth > 0))
            filled = np.where(depth > 0, depth, near / np.maximum(share, 1e-6))
            writer.append(depth, i / RATES[name], color=registered(filled, color, lenses))
    return path


def track_rooms(
    names: Sequence[str], rooms: Path, work: Path, tracker: Tracker, joints: str = "none"
) -> tuple[dict[str, Path], dict[str, str]]:
    """Track the sequences in `rooms` by name; return run folders in `work`, and the reasons of failures."""
    runs: dict[Path, tuple[Path, dict[str, Any]]] = {}
    for name in names:
        run = work / "runs" / "rooms" / name
        if joints == "colour":
            runs[run] = in_colour(name, rooms, work), {}
        else:
            camera = annotations_of(name)["intrinsics"]
            runs[run] = rooms / name, {"intrinsics": tuple(camera), "frame_rate": RATES.get(name, 5.0)}
    failed = track_each(runs, tracker, people=None, joints=JointChoice(joints))
    return {run.name: run for run in runs}, {run.name: reason for run, reason in failed.items()}


class RoomTrack(NamedTuple):
    """Track of one person: name, stature in metres, and joints (20, 3) by tracked frame."""

    name: str
    stature: float
    frames: dict[int, np.ndarray]


def load_run(run: Path) -> list[RoomTrack]:
    """Return the tracks of a run of several people."""
    tracks = []
    for person in load_people(run).people:
        track = Track.load(run / person.folder)
        shown = np.flatnonzero((track.state == TRACKED) & (track.joints[:, :, 2] > 0.05).all(axis=1)).tolist()
        frames = {frame: track.joints[frame].astype(np.float64) for frame in shown}
        tracks.append(RoomTrack(person.folder, person.stature, frames))
    return tracks


def heads_alone(name: str, rooms: Path) -> list[RoomTrack]:
    """Return the heads found in each annotated frame alone, as tracks of one frame; all joints are the head."""
    truth, tracks = annotations_of(name), []
    recording = open_recording(rooms / name, intrinsics=tuple(truth["intrinsics"]))
    for frame in map(int, truth["frames"]):
        finder = MultiPersonFinder(recording.camera, recording.up_camera)
        finder.follow(recording.depth(frame), 0.0)
        for person in finder.people:
            joints = np.tile(finder.coarse.from_level(person.head[None]), (len(REPORTED), 1))
            tracks.append(RoomTrack(f"{frame}_{person.id}", 0.0, {frame: joints}))
    return tracks


def added(counts: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the sums of the counts of several sequences."""
    total: dict[str, Any] = {}
    for own in counts:
        for key, value in own.items():
            if isinstance(value, dict):
                total[key] = added([total.get(key, {}), value])
            elif isinstance(value, list):
                total[key] = [a + b for a, b in zip(total.get(key, [0] * len(value)), value, strict=True)]
            else:
                total[key] = total.get(key, 0) + value
    return total


class RoomScorer:
    """Counts of one sequence, of which `truth` is the annotation file, while its frames are scored in order."""

    def __init__(self, truth: Mapping[str, Any]) -> None:
        self._truth, (self._fx, self._fy, self._cx, self._cy) = truth, truth["intrinsics"]
        self._track_of: dict[int, str] = {}
        self._person_of: dict[str, int] = {}
        self._counts: dict[str, Any] = {
            "frames": 0, "clear": [0, 0], "occluded": [0, 0], "small": [0, 0],
            "false": {"furniture": 0, "elsewhere": 0, "person": 0}, "switches": 0, "handed": 0, "stature": [0, 0],
            "joints": {group: [0, 0, 0] for group in GROUPS},
        }  # fmt: skip

    def score(self, tracks: Sequence[RoomTrack]) -> dict[str, Any]:
        """Return the counts of the tracks of the sequence."""
        for key in sorted(self._truth["frames"], key=int):
            entries = self._truth["frames"][key]["people"]
            people = [person for person in entries if "joints" in person]
            present = [track for track in tracks if int(key) in track.frames]
            joints = [dict(zip(REPORTED, track.frames[int(key)], strict=True)) for track in present]
            self._counts["frames"] += 1
            pairs = self._matches(people, joints)
            for index, person in enumerate(people):
                kind = next((kind for kind in ("edge", "small", "occluded") if person.get(kind)), "clear")
                if kind != "edge":
                    self._counts[kind][0] += index in pairs
                    self._counts[kind][1] += 1
                if index in pairs:
                    self._count_identity(person["id"], present[pairs[index]])
                    self._count_joints(person, joints[pairs[index]])
            headless = [person["box"] for person in entries if "box" in person]
            for index in set(range(len(present))) - set(pairs.values()):
                kind = self._kind_of_false(joints[index], people, headless)
                if kind != "optional":
                    self._counts["false"][kind] += 1
        return self._counts

    def _matches(self, people: list[dict[str, Any]], present: list[dict[str, Any]]) -> dict[int, int]:
        impossible = 1e4
        cost = np.full((len(people), len(present)), impossible)
        for a, person in enumerate(people):
            z = person["depth"]["head"]
            gate = DEPTH_GATE_SMALL if person.get("small") or person.get("no_depth") else DEPTH_GATE
            for b, joints in enumerate(present):
                distance = self._distance(self._project(joints["head"]), person["joints"]["head"], z)
                if abs(joints["head"][2] - z) <= gate and distance <= HEAD_RADIUS:
                    cost[a, b] = distance
        pairs = zip(*(found.tolist() for found in linear_sum_assignment(cost)), strict=True)
        return {a: b for a, b in pairs if cost[a, b] < impossible}

    def _count_identity(self, person: int, track: RoomTrack) -> None:
        self._counts["switches"] += self._track_of.get(person, track.name) != track.name
        self._counts["handed"] += self._person_of.get(track.name, person) != person
        self._track_of[person], self._person_of[track.name] = track.name, person
        self._counts["stature"][0] += STATURE[0] <= track.stature <= STATURE[1]
        self._counts["stature"][1] += 1

    def _count_joints(self, person: dict[str, Any], joints: Mapping[str, np.ndarray]) -> None:
        error, mirrored = {}, {}
        for name, pixel in person["joints"].items():
            z = person["depth"][name]
            error[name] = self._distance(self._project(joints[name]), pixel, z)
            mirrored[name] = self._distance(self._project(joints[_OTHER_SIDE[name]]), pixel, z)
        exchanged = sum(min(e, 0.4) for e in mirrored.values()) < sum(min(e, 0.4) for e in error.values())
        for group, names in GROUPS.items():
            for name in error.keys() & set(names):
                free = mirrored[name] if exchanged else error[name]
                for k, hit in enumerate((error[name] <= NEAR, free <= NEAR, True)):
                    self._counts["joints"][group][k] += hit

    def _kind_of_false(
        self, joints: Mapping[str, np.ndarray], people: list[dict[str, Any]], headless: list[list[float]]
    ) -> str:
        head, neck, pelvis = (self._project(joints[name]) for name in ("head", "neck", "pelvis"))
        trunk = self._project((joints["neck"] + joints["pelvis"]) / 2)
        if any(_inside(head, box, 15) or _inside(trunk, box, 15) for box in headless):
            return "optional"
        for person in people:
            z = person["depth"]["head"]
            near = [person["joints"][n] for n in ("head", *GROUPS["trunk"]) if n in person["joints"]]
            middle = np.mean(near, axis=0)
            if len(near) == 1:
                middle[1] += 0.35 * self._fy / z  # the trunk lies below the head
            same_depth = abs(joints["pelvis"][2] - z) < 1.2
            at_trunk = self._distance(trunk, middle, z) < 0.4
            if same_depth and (at_trunk or self._distance(head, person["joints"]["head"], z) < HEAD_RADIUS):
                return "optional" if person.get("edge") else "person"
        for box, (nearest, farthest) in zip(self._truth["distractors"], self._truth["distractor_depth"], strict=True):
            at_depth = nearest - 0.5 <= joints["pelvis"][2] <= farthest + 0.5
            if at_depth and any(_inside(spot, box, 5) for spot in (head, trunk, neck, pelvis)):
                return "furniture"
        return "elsewhere"

    def _project(self, point: np.ndarray) -> np.ndarray:
        return np.array([point[0] / point[2] * self._fx + self._cx, point[1] / point[2] * self._fy + self._cy])

    def _distance(self, a: Any, b: Any, z: float) -> float:
        return float(np.hypot((a[0] - b[0]) / self._fx, (a[1] - b[1]) / self._fy) * z)


def _inside(point: Any, box: Any, margin: float) -> bool:
    return bool(box[0] - margin <= point[0] <= box[2] + margin and box[1] - margin <= point[1] <= box[3] + margin)


@benchmark(
    DATABASE, rooms=ROOMS, names=",".join(path.stem for path in sorted(ANNOTATIONS.glob("*.json"))),
    joints=("none", "colour"), single=False,
)  # fmt: skip
def measured(options: argparse.Namespace) -> tuple[str, Any]:
    """Track and score the sequences, or find the heads of single frames."""
    if options.single:
        found = [RoomScorer(annotations_of(n)).score(heads_alone(n, options.rooms)) for n in options.names.split(",")]
        return "rooms_single", {"all": {"counts": added(found)}}
    tracker = TrackerRecipe(overrides=parse_overrides(options.set), database=poses_of(options)).build()
    runs, failed = track_rooms(options.names.split(","), options.rooms, options.work, tracker, options.joints)
    figures: dict[str, Any] = {}
    for name, run in runs.items():
        figures[name] = {"counts": RoomScorer(annotations_of(name)).score(load_run(run) if run.is_dir() else [])}
    figures["all"] = {"counts": added(own["counts"] for own in figures.values()), "failed": failed}
    return "rooms" + "_colour" * (options.joints == "colour"), figures


main = script(__name__, __doc__, measured)
