"""The person classifier by itself: `depthmocap bench classifier [--split report]`.

Rooms that the network was not trained on, furnished at random, are seen by the two sensors of the simulator from 0.5 to
2.5 m above the floor, with people in them: standing, seated, and none. Standing motions are those of the suite's split,
seated ones the bundled `SEATED_SUBJECT_MOTIONS`; bodies are subjects with local deformations outside the shape space.
Figures of pixels, and of surfaces (all people, and each patch of 64 pixels without people): area under the ROC curve,
expected calibration error at even odds (people and the rest weigh alike), and the fractions over one half.
"""

import argparse
from typing import Any

import numpy as np
from sklearn.metrics import roc_auc_score

from benchmarks._record import benchmark, script
from benchmarks._rows import SPLIT
from tests.support.calibration import calibration_error
from tests.support.scenes import people_of
from tests.support.suite import BODIES, RATE, takes
from toolkit.body.shape import subject_body
from toolkit.database.canonical import canonicalise
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SEATED_SUBJECT_MOTIONS, procedural_clips
from toolkit.people.view import CoarseCamera
from toolkit.sensing.camera import DEFAULT_UP
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, prepare
from training.interiors.room import KINDS as ROOM_KINDS
from training.interiors.room import around_people

PATCH = 8
"""Pixels of a side of a patch without people."""
MIN_PIXELS = 3
"""Measured pixels of a surface."""


def standing_poses(split: str) -> np.ndarray:
    """Return canonical poses (N, P) of the suite's motions, ten a second."""
    body = subject_body("neutral")
    clips = [people_of(take, take.frames, body)[0].clip for take in takes(split)]
    poses = [clip.poses[:: round(RATE / 10)] for clip in clips if isinstance(clip, PoseClip)]
    return canonicalise(np.concatenate(poses))[0]


def seated_poses(split: str) -> np.ndarray:
    """Return canonical poses (N, P) of seated subjects, ten a second."""
    clips = procedural_clips(SEATED_SUBJECT_MOTIONS, 10.0, body=subject_body("neutral"), seed=int(split == "report"))
    return canonicalise(np.concatenate([clip.poses for clip in clips]))[0]


def view(kind: str, poses: np.ndarray, rng: np.random.Generator) -> tuple[Any, Any]:
    """Return a simulated frame of a room and its simulation; `kind` is "standing", "seated" or "empty"."""
    height = float(rng.uniform(0.5, 2.5))
    distance = float(rng.uniform(1.6, 4.0))
    tilt = float(np.degrees(np.arctan2(height - 0.9, distance)) + rng.normal(0.0, 5.0))
    room = f"{rng.choice(list(ROOM_KINDS))}:{rng.integers(10_000, 1 << 30)}"
    sensor, seed = ("kinect", "tof")[int(rng.random() < 0.3)], int(rng.integers(1 << 30))
    shot = CaptureSettings(
        sensor=sensor, distance=distance, height=height, tilt=tilt, room=around_people(room), seconds=1 / 30, seed=seed
    )  # fmt: skip
    people = []
    if kind != "empty":
        body = subject_body(BODIES[rng.integers(len(BODIES))], seed=int(rng.integers(1 << 30)))
        clip = PoseClip("still", poses[rng.integers(len(poses))][None], 30.0, "")
        at = (float(rng.uniform(-0.3, 0.3) * distance), float(rng.uniform(-0.6, 0.2)))
        people.append(SimulatedPerson(clip, body, at, float(rng.uniform(-180.0, 180.0)), seated=kind == "seated"))
    simulation = prepare(people, shot)
    return next(iter(simulation.frames())), simulation


def scored(kind: str, poses: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return probabilities and truth of the pixels and surfaces of one view."""
    frame, simulation = view(kind, poses, rng)
    coarse = CoarseCamera(simulation.sensor.camera, np.array(DEFAULT_UP), SensingSettings())
    depth = coarse.downsampled(frame.depth)
    odds = coarse.person_odds(depth)
    pixels = np.flatnonzero(depth > 0)
    found = 1.0 / (1.0 + np.exp(-odds.ravel()[pixels].astype(np.float64)))
    truth = frame.person[:: coarse.step, :: coarse.step].ravel()[pixels] >= 0
    rows, columns = np.divmod(pixels, depth.shape[1])
    patch = np.where(truth, 0, 1 + rows // PATCH * depth.shape[1] + columns // PATCH)
    _, number = np.unique(patch, return_inverse=True)
    count = np.bincount(number)
    means = np.bincount(number, weights=found) / count
    enough = count >= MIN_PIXELS
    return {
        "pixel": found, "pixel_truth": truth, "surface": means[enough],
        "surface_truth": np.bincount(number, weights=truth)[enough] > 0,
    }  # fmt: skip


def figures_of(columns: dict[str, np.ndarray], name: str) -> dict[str, float]:
    """Return the figures of pixels or surfaces."""
    found, truth = columns[name], columns[f"{name}_truth"]
    weight = np.where(truth, 0.5 / max(truth.sum(), 1), 0.5 / max((~truth).sum(), 1))
    return {
        "auc": float(roc_auc_score(truth, found)), "ece": calibration_error(found, truth, weight),
        "people_over_half": float((found[truth] > 0.5).mean()), "rest_over_half": float((found[~truth] > 0.5).mean()),
    }  # fmt: skip


@benchmark(SPLIT, views=25)
def classifier(options: argparse.Namespace) -> tuple[str, Any]:
    """Draw views of all kinds and score them."""
    poses = {"standing": standing_poses(options.split), "seated": seated_poses(options.split), "empty": np.empty(0)}
    rng = np.random.default_rng([17, options.split == "report"])
    views = [scored(kind, own, rng) for kind, own in poses.items() for _ in range(options.views)]
    columns = {name: np.concatenate([one[name] for one in views]) for name in views[0]}
    return f"classifier_{options.split}", {name: figures_of(columns, name) for name in ("pixel", "surface")}


main = script(__name__, __doc__, classifier)
