"""Sequences: recordings of several clips of one actor, joined, whose motion classes are known.

Eight sequences per split: kicks and elbow to knee from the front and from the side, arm rotations, throws, grabs from
the side, hops and squats. The `tune` split is HDM05 actor bk, the `report` split actor dg. With filler, excerpts of
other motions of CMU stand between the clips; neither they nor the joins belong to a class.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.support.scenes import distance_needed
from tests.support.suite import MOCAP, RATE, digest_of, in_place
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.retrieval.annotation.measures import Segment
from toolkit.simulation.joining import joined
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, simulate_scene

ACTORS = {"tune": "bk", "report": "dg"}
FILLERS = ("02_05", "49_10", "49_06")
"""CMU clips with filler for the second set."""
FILLER = 60
"""Frames of a filler excerpt."""
HEIGHT = 1.1
"""Height of the camera above the floor, metres."""


@dataclass(frozen=True)
class MotionSequence:
    """Description of a sequence.

    Attributes
    ----------
    name : in tables
    motions : kinds of motion as in the names of the files, with the most clips of each
    body, sensor, yaw : as in `casting`
    """

    name: str
    motions: tuple[tuple[str, int], ...]
    body: str
    sensor: str = "kinect"
    yaw: float = 0.0


SEQUENCES = (
    MotionSequence("kick_front", (("kick", 5),), "slim_male", "tof", 10.0),
    MotionSequence("kick_side", (("kick", 5),), "short_female", yaw=-60.0),
    MotionSequence("elbow_front", (("elbowToKnee", 4),), "tall_male", yaw=-15.0),
    MotionSequence("elbow_side", (("elbowToKnee", 4),), "heavy_female", "tof", 70.0),
    MotionSequence("arms", (("rotateArms", 4),), "average_female", yaw=20.0),
    MotionSequence("throw", (("throwBasketball", 3),), "athletic_male", "tof", 30.0),
    MotionSequence("grab_side", (("grabHigh", 4),), "elderly", yaw=50.0),
    MotionSequence("hop_squat", (("hop", 3), ("squat", 3)), "heavy_male", yaw=-25.0),
)


@dataclass(frozen=True, eq=False)
class Performed:
    """Sequence on its subject's body: poses at `suite.RATE`, and the true segments, seconds."""

    clip: PoseClip
    body: Body
    segments: tuple[Segment, ...]


def label_of(path: Path) -> str:
    """Return the motion class of an HDM05 clip: the third word of its name."""
    return path.stem.split("_")[2]


def clips_of(actor: str, motion: str = "") -> list[Path]:
    """Return the clips of an HDM05 actor whose class begins with `motion`, sorted."""
    return sorted(MOCAP.glob(f"hdm05/HDM_{actor}_{motion}*.amc"))


def class_clips(split: str) -> dict[Path, str]:
    """Return the clips of the actors outside the split, with their classes, for learning."""
    others = sorted({"bd", "bk", "dg"} - {ACTORS[split]})
    return {path: label_of(path) for actor in others for path in clips_of(actor)}


def perform(sequence: MotionSequence, split: str, *, filler: bool = False) -> Performed:
    """Return the sequence by the split's actor."""
    body = subject_body(sequence.body, seed=7 if split == "tune" else 107)
    paths = [path for motion, most in sequence.motions for path in clips_of(ACTORS[split], motion)[:most]]
    parts: list[tuple[np.ndarray, str | None]] = []
    for number, path in enumerate(paths):
        parts.append((retarget(read_clip(path).resampled(RATE), body).poses, label_of(path)))
        if filler and number % 2:
            other = retarget(read_clip(MOCAP / f"cmu/{FILLERS[number // 2 % 3]}.bvh").resampled(RATE), body).poses
            parts.append((other[20 : 20 + FILLER], None))
    poses, starts = joined([part for part, _ in parts])
    segments = tuple(
        Segment(start / RATE, (start + len(part)) / RATE, label)
        for start, (part, label) in zip(starts, parts, strict=True)
        if label is not None
    )
    return Performed(PoseClip(sequence.name, in_place(poses), RATE, sequence.name), body, segments)


def record_sequence(sequence: MotionSequence, split: str, work: Path) -> tuple[Path, Performed]:
    """Return the sequence as a recording in `work`, made if missing, and its poses."""
    folders = ["toolkit/simulation", "toolkit/mocap", "toolkit/body"]
    digest = digest_of((perform,), folders, sequence, split)
    path = work / "sequences" / f"{sequence.name}_{split}_{digest}.npz"
    done = perform(sequence, split)
    if not path.exists():
        person = SimulatedPerson(done.clip, done.body, yaw=sequence.yaw)
        shot = CaptureSettings(
            sensor=sequence.sensor, distance=distance_needed(person, sequence.sensor, HEIGHT), height=HEIGHT,
            seed=len(sequence.name), furnished=False,
        )  # fmt: skip
        simulate_scene([person], path, shot)
    return path, done
