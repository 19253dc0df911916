"""Scores of multi-person tracks against hand-annotated rooms.

All distances are in metres in the image plane at the measured depth of the annotated point (pixels * z / f).

heads
    A tracked head within `HEAD_RADIUS` of the annotated head and within `DEPTH_GATE` along the ray, matched one to one.
    People at the image border (`edge`) are optional: neither missed nor false.
false
    Tracked people in annotated frames without a match: on furniture (head, neck, middle of the trunk or pelvis in a
    distractor box at its depth), elsewhere, and apart from these on an annotated `person` with the head off or as a
    second track.
switches, handed
    Changes of the matched track of an annotated person from one matched frame to the next, and the reverse: a track
    that goes from one annotated person to another.
joints
    Per group: annotated joints of matched people within 100 and 150 mm, the same with left and right of the whole body
    exchanged where that fits better, and their number.
stature
    Matched people whose stature is within `STATURE`, and all matched people.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from toolkit.body.skeleton import REPORTED
from toolkit.tracks import TRACKED, Track
from toolkit.tracks.runs import load_people

HEAD_RADIUS, DEPTH_GATE, DEPTH_GATE_SMALL = 0.25, 0.75, 1.5
"""Metres between a tracked and an annotated head: in the image plane, along the ray, along the ray for small people."""
STATURE = (1.5, 2.0)
"""Metres: plausible statures of the annotated people, who are all adults."""
NEAR, FAR = 0.10, 0.15
"""Metres: the two thresholds of a joint."""
GROUPS = {
    "head": ["head"],
    "trunk": ["left_shoulder", "right_shoulder", "left_hip", "right_hip"],
    "arms": ["left_elbow", "right_elbow", "left_wrist", "right_wrist"],
    "legs": ["left_knee", "right_knee", "left_ankle", "right_ankle"],
}
_GROUP_OF = {joint: group for group, joints in GROUPS.items() for joint in joints}


def load_run(run: Path) -> list[dict[str, Any]]:
    """Return the tracks of a run of several people: name, stature, joint names, and joints (20, 3) by tracked frame."""
    tracks = []
    for person in load_people(run).people:
        track = Track.load(run / person.folder)
        shown = np.flatnonzero((track.state == TRACKED) & (track.joints[:, :, 2] > 0.05).all(axis=1)).tolist()
        frames = {frame: track.joints[frame].astype(np.float64) for frame in shown}
        tracks.append({"name": person.folder, "stature": person.stature, "names": REPORTED, "frames": frames})
    return tracks


def score(truth: Mapping[str, Any], tracks: list[dict[str, Any]], events: list[str] | None = None) -> dict[str, Any]:
    """Return the counts of one sequence.

    Parameters
    ----------
    truth : annotation file of the sequence
    tracks : as returned by `load_run`
    events : misses, switches and false people are appended, one line each
    """
    return _Scorer(truth, [] if events is None else events).score(tracks)


def add(total: dict[str, Any], counts: Mapping[str, Any]) -> dict[str, Any]:
    """Add the counts of a sequence to a total, in place, and return the total."""
    for key, value in counts.items():
        if isinstance(value, dict):
            add(total.setdefault(key, {}), value)
        elif isinstance(value, list):
            total[key] = [a + b for a, b in zip(total.get(key, [0] * len(value)), value, strict=True)]
        else:
            total[key] = total.get(key, 0) + value
    return total


class _Scorer:
    """Counts of one sequence while its frames are scored in order."""

    def __init__(self, truth: Mapping[str, Any], events: list[str]) -> None:
        self._truth, self._events = truth, events
        self._fx, self._fy, self._cx, self._cy = truth["intrinsics"]
        self._track_of: dict[int, str] = {}
        self._person_of: dict[str, int] = {}
        self._counts: dict[str, Any] = {
            "frames": 0, "heads": [0, 0], "clear": [0, 0], "occluded": [0, 0], "small": [0, 0], "optional": [0, 0],
            "false": {"furniture": 0, "elsewhere": 0, "person": 0}, "tracked": 0, "switches": 0, "handed": 0,
            "stature": [0, 0], "joints": {group: [0] * 5 for group in GROUPS}
        }  # fmt: skip

    def score(self, tracks: list[dict[str, Any]]) -> dict[str, Any]:
        for key in sorted(self._truth["frames"], key=int):
            frame = int(key)
            entries = self._truth["frames"][key]["people"]
            people = [person for person in entries if "joints" in person]
            present = [
                {"track": track, "joints": dict(zip(track["names"], track["frames"][frame], strict=True))}
                for track in tracks
                if frame in track["frames"]
            ]
            self._counts["frames"] += 1
            self._counts["tracked"] += len(present)
            pairs = self._matches(people, present)
            for index, person in enumerate(people):
                self._count_head(frame, person, present[pairs[index]] if index in pairs else None)
            matched = set(pairs.values())
            headless = [person["box"] for person in entries if "box" in person]
            for index, other in enumerate(present):
                if index not in matched:
                    self._count_false(frame, other, people, headless)
        return self._counts

    def _matches(self, people: list[dict[str, Any]], present: list[dict[str, Any]]) -> dict[int, int]:
        impossible = 1e4
        cost = np.full((len(people), len(present)), impossible)
        for a, person in enumerate(people):
            z = person["depth"]["head"]
            gate = DEPTH_GATE_SMALL if person.get("small") or person.get("no_depth") else DEPTH_GATE
            for b, track in enumerate(present):
                head = track["joints"]["head"]
                distance = self._distance(self._project(head), person["joints"]["head"], z)
                if abs(head[2] - z) <= gate and distance <= HEAD_RADIUS:
                    cost[a, b] = distance
        rows, columns = linear_sum_assignment(cost)
        pairs = zip(rows.tolist(), columns.tolist(), strict=True)
        return {a: b for a, b in pairs if cost[a, b] < impossible}

    def _count_head(self, frame: int, person: dict[str, Any], found: dict[str, Any] | None) -> None:
        counts = self._counts
        kind = next((kind for kind in ("edge", "small", "occluded") if person.get(kind)), "clear")
        kind = "optional" if kind == "edge" else kind
        for name in (kind, "heads") if kind != "optional" else (kind,):
            counts[name][0] += found is not None
            counts[name][1] += 1
        if found is None:
            self._events.append(f"frame {frame}: missed {person['id']} ({kind})")
            return
        self._count_identity(frame, person["id"], found["track"]["name"])
        counts["stature"][0] += STATURE[0] <= found["track"]["stature"] <= STATURE[1]
        counts["stature"][1] += 1
        self._count_joints(person, found["joints"])

    def _count_identity(self, frame: int, person: int, track: str) -> None:
        before = self._track_of.get(person, track)
        if before != track:
            self._counts["switches"] += 1
            self._events.append(f"frame {frame}: person {person} goes from {before} to {track}")
        self._track_of[person] = track
        owner = self._person_of.get(track, person)
        if owner != person:
            self._counts["handed"] += 1
            self._events.append(f"frame {frame}: {track} goes from person {owner} to {person}")
        self._person_of[track] = person

    def _count_joints(self, person: dict[str, Any], joints: Mapping[str, np.ndarray]) -> None:
        error, mirrored = {}, {}
        for name, pixel in person["joints"].items():
            z = person["depth"][name]
            error[name] = self._distance(self._project(joints[name]), pixel, z)
            mirrored[name] = self._distance(self._project(joints[_other_side(name)]), pixel, z)
        exchanged = sum(min(e, 0.4) for e in mirrored.values()) < sum(min(e, 0.4) for e in error.values())
        for name, own in error.items():
            free = mirrored[name] if exchanged else own
            group = self._counts["joints"][_GROUP_OF[name]]
            for k, hit in enumerate((own <= NEAR, own <= FAR, free <= NEAR, free <= FAR, True)):
                group[k] += hit

    def _count_false(
        self, frame: int, track: dict[str, Any], people: list[dict[str, Any]], headless: list[list[float]]
    ) -> None:
        joints = track["joints"]
        head, trunk = self._project(joints["head"]), self._project((joints["neck"] + joints["pelvis"]) / 2)
        if any(_inside(head, box, 15) or _inside(trunk, box, 15) for box in headless):
            return
        kind = self._kind_of_false(joints, head, trunk, people)
        if kind == "optional":
            return
        self._counts["false"][kind] += 1
        u, v = head
        z = joints["head"][2]
        self._events.append(
            f"frame {frame}: {track['track']['name']} false ({kind}), head at {u:.0f},{v:.0f} z {z:.2f}"
        )

    def _kind_of_false(
        self, joints: Mapping[str, np.ndarray], head: np.ndarray, trunk: np.ndarray, people: list[dict[str, Any]]
    ) -> str:
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
        spots = [head, trunk, self._project(joints["neck"]), self._project(joints["pelvis"])]
        for box, (nearest, farthest) in zip(self._truth["distractors"], self._truth["distractor_depth"], strict=True):
            at_depth = nearest - 0.5 <= joints["pelvis"][2] <= farthest + 0.5
            if at_depth and any(_inside(spot, box, 5) for spot in spots):
                return "furniture"
        return "elsewhere"

    def _project(self, point: np.ndarray) -> np.ndarray:
        return np.array([point[0] / point[2] * self._fx + self._cx, point[1] / point[2] * self._fy + self._cy])

    def _distance(self, a: Any, b: Any, z: float) -> float:
        return float(np.hypot((a[0] - b[0]) / self._fx, (a[1] - b[1]) / self._fy) * z)


def _inside(point: Any, box: Any, margin: float) -> bool:
    return bool(box[0] - margin <= point[0] <= box[2] + margin and box[1] - margin <= point[1] <= box[3] + margin)


def _other_side(name: str) -> str:
    exchange = {"left": "right", "right": "left"}
    side, _, rest = name.partition("_")
    return f"{exchange[side]}_{rest}" if side in exchange else name
