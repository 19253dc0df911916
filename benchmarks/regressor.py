"""How good is the joint regressor by itself? `depthmocap bench regressor PART`, which is one of

- `joints [--split report]`: people whose motions and bodies the regressor was not trained on stand before ordinary
  cameras of six kinds: in full view, cut off by the lower border of the image, seated, behind a board, before a camera
  that is raised and tilted, and children of 0.8 to 1.25 m. Standing motions are those of the suite's split, seated ones
  the bundled `SEATED_SUBJECT_MOTIONS`; bodies are full-resolution subjects with local deformations outside the shape
  space. A joint is in view if it is inside the image with nothing foreign before it. Of these: the share within 10 and
  15 cm, their mean error, and whether reliability means what it says (expected calibration error, ten bins). Of all
  joints: the share whose `in_view` is on the right side of a half, and the area under its ROC curve.
- `people [--split report]`: does it tell people from rooms? Rooms that it was not trained on, furnished at random, seen
  by the two sensors of the simulator from 0.5 to 2.5 m above the floor, with people in them: standing, seated, and
  no person. For pixels, and for surfaces (all people, and every patch of 64 pixels without one): the area under the
  ROC curve, the expected calibration error at even odds (people and the rest weigh alike), and the shares that are
  over one half. Times are per thousand pixels.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks._record import run_part, save_figures
from benchmarks._rows import add_database_options, poses_of
from tests.support.calibration import calibration_error
from tests.support.scenes import people_of
from tests.support.suite import BODIES, RATE, takes
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import GROWTH, ShapeSpace, subject_body
from toolkit.database.canonical import canonicalise, place
from toolkit.database.database import PoseDatabase
from toolkit.kernels.image import raster
from toolkit.landmarks.regressor import JointEstimate, JointRegressor
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SEATED_SUBJECT_MOTIONS, procedural_clips
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.cloud import Cloud
from toolkit.simulation.interiors.room import KINDS as ROOM_KINDS
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, prepare

KINDS = ("full", "waist_up", "seated", "hidden", "tilted", "child")
CAMERA = Camera(285.6, 285.6, 159.5, 119.5, 320, 240)
SAMPLES = 500
"""Points that vote, as in the tracker."""
NOISE = 0.004
"""Metres."""
CLOSE = (0.1, 0.15)
"""Metres."""


@dataclass(frozen=True, eq=False)
class Scene:
    """One depth image of one person: its cloud, what hides, the true joints (20, 3) and which of them are in view."""

    cloud: Cloud
    unobserved: np.ndarray
    joints: np.ndarray
    in_view: np.ndarray


def joints(parser: argparse.ArgumentParser) -> None:
    """Measure all kinds of views and print a table."""
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--views", type=int, default=150, help="of each kind")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--masked", action="store_true", help="tell the regressor what is hidden by something nearer")
    add_database_options(parser)
    options = parser.parse_args()
    forest = PoseDatabase.load(poses_of(options)).regressor
    if forest is None:
        parser.error("the database holds no joint regressor; build it with --parts")
    standing, seated = standing_poses(options.split), seated_poses(options.split)
    rows = []
    print(f"{'view':9} {'in view':>8} {'10 cm':>6} {'15 cm':>6} {'mean':>7} {'ECE':>6} {'known':>6} {'AUC':>6}")
    for kind in options.kinds:
        rng = np.random.default_rng([KINDS.index(kind), options.split == "report"])
        scenes = [scene(kind, seated if kind == "seated" else standing, rng) for _ in range(options.views)]
        row = {"view": kind} | measured(forest, scenes, options.masked)
        rows.append(row)
        print(
            f"{kind:9} {100 * row['in_view']:6.1f} % {100 * row['within_100']:5.1f}% {100 * row['within_150']:5.1f}% "
            f"{row['mean_mm']:4.0f} mm {row['ece']:6.3f} {100 * row['known']:5.1f}% {row['auc']:6.3f}"
        )
    save_figures(f"regressor_{options.split}", rows, vars(options))


def standing_poses(split: str) -> np.ndarray:
    """Canonical poses (N, P) of the suite's motions, ten a second."""
    body = subject_body("neutral")
    clips = [people_of(take, take.frames, body)[0].clip for take in takes(split)]
    poses = [clip.poses[:: round(RATE / 10)] for clip in clips if isinstance(clip, PoseClip)]
    return canonicalise(np.concatenate(poses))[0]


def seated_poses(split: str) -> np.ndarray:
    """Canonical poses (N, P) of seated subjects, ten a second."""
    clips = procedural_clips(SEATED_SUBJECT_MOTIONS, 10.0, body=subject_body("neutral"), seed=int(split == "report"))
    return canonicalise(np.concatenate([clip.poses for clip in clips]))[0]


def scene(kind: str, poses: np.ndarray, rng: np.random.Generator) -> Scene:
    """One view of `kind` of one of the canonical `poses`; drawn again where hardly anything of it is left."""
    while True:
        found = _scene(kind, poses[rng.integers(len(poses))], rng)
        if len(found.cloud) >= 300 and found.in_view.sum() >= 4:
            return found


def _scene(kind: str, pose: np.ndarray, rng: np.random.Generator) -> Scene:
    body = _subject(kind, rng)
    yaw = rng.uniform(-1.0, 1.0) * np.pi * (1.0 if rng.random() < 0.3 else 1.0 / 3.0)
    posed = place(pose, np.zeros(4), np.zeros(3), yaw)
    vertices, joints = body.vertex_positions(posed), body.joint_positions(posed)
    floor, top = vertices[:, 1].min(), vertices[:, 1].max()
    distance = rng.uniform(2.2, 3.8) * (0.5 + 0.5 * min(body.height / 1.7, 1.0))
    height, pitch = 0.5 * (floor + top) + rng.uniform(-0.3, 0.3), 0.0
    if kind == "tilted" or (kind in ("seated", "child") and rng.random() < 0.5):
        height = floor + (rng.uniform(1.7, 2.5) if rng.random() < 0.7 else rng.uniform(0.5, 0.8))
        down = height - 0.5 * (floor + top)
        distance = max(distance, down / np.tan(np.radians(40.0)), 1.3)
        pitch = np.arctan2(down, distance) + rng.normal(0.0, 0.04)
    camera_at = np.array([rng.uniform(-0.2, 0.2) * distance, height, distance])
    rotation = level_rotation(np.array([0.0, -np.cos(pitch), -np.sin(pitch)]))
    if kind == "waist_up":  # a level camera so near and so high that the image ends between knees and waist
        camera_at[2] = rng.uniform(1.1, 1.9)
        low, high = np.sort(joints[[skeleton.REPORTED.index(name) for name in ("spine", "left_knee")], 1])
        camera_at[1] = rng.uniform(low, high) + camera_at[2] * CAMERA.cy / CAMERA.fy
    return _measured(body, vertices - camera_at, joints - camera_at, rotation, kind == "hidden", rng)


def _subject(kind: str, rng: np.random.Generator) -> Body:
    """A subject with deformations that no coefficient makes; for `child` one of the age that the kind means."""
    seed = int(rng.integers(1 << 30))
    if kind != "child":
        return subject_body(BODIES[rng.integers(len(BODIES))], seed=seed)
    space = ShapeSpace.load()
    shape = space.typical(rng.uniform(0.8, 1.25))[: len(GROWTH)] + 0.5 * rng.standard_normal(len(GROWTH))
    return subject_body(shape, seed=seed)


def _measured(
    body: Body, vertices: np.ndarray, joints: np.ndarray, rotation: np.ndarray, hidden: bool, rng: np.random.Generator
) -> Scene:
    """The person (level frame) as the camera measures it, `hidden` by a board or not."""
    camera = CAMERA
    projected = np.empty_like(vertices)
    raster.project(vertices @ rotation, camera.intrinsics, projected)
    inverse = np.empty((camera.height, camera.width))
    raster.rasterise(projected, body.faces, inverse, np.empty(inverse.shape, dtype=np.int32))
    board = _board(joints, rotation, camera, rng) if hidden else np.zeros(inverse.shape)
    depth = np.zeros(inverse.shape, dtype=np.float32)
    seen = (inverse > 0) & (board <= inverse)
    depth[seen] = 1.0 / inverse[seen] + rng.normal(0.0, NOISE, int(seen.sum()))
    points = joints @ rotation
    pixels = np.rint(np.nan_to_num(camera.project(points), nan=-1.0)).astype(int)
    inside = ((pixels >= 0) & (pixels < [camera.width, camera.height])).all(axis=1)
    u, v = np.clip(pixels, 0, [camera.width - 1, camera.height - 1]).T
    in_view = inside & (board[v, u] * points[:, 2] <= 1.0)
    return Scene(Cloud.from_depth(depth, camera, rotation), board > 0, joints, in_view)


def _board(joints: np.ndarray, rotation: np.ndarray, camera: Camera, rng: np.random.Generator) -> np.ndarray:
    """Inverse depth (H, W) of an upright board 0.3 to 0.6 m before the person, which hides a part of it from below."""
    points = joints @ rotation
    z = points[:, 2].min() - rng.uniform(0.05, 0.3)
    low, high = np.sort(camera.project(joints[[3, 15, 19]] @ rotation)[:, 1])[[0, -1]]
    top = high - rng.uniform(0.25, 0.65) * (high - low)
    left, right = np.sort(camera.project(points)[:, 0])[[0, -1]]
    board = np.zeros(camera.shape)
    wide = rng.random() < 0.5
    first = 0 if wide else int(max(left + rng.uniform(-0.2, 0.5) * (right - left), 0))
    last = camera.width if wide else int(max(first + rng.uniform(0.5, 1.0) * (right - left), first + 1))
    board[int(np.clip(top, 0, camera.height)) :, first:last] = 1.0 / z
    return board


def measured(forest: JointRegressor, scenes: list[Scene], masked: bool) -> dict[str, Any]:
    """Figures of one kind of views: shares in [0, 1], errors in millimetres."""
    estimates: list[JointEstimate] = [
        forest.estimate(one.cloud, SAMPLES, one.unobserved if masked else None) for one in scenes
    ]
    truth = np.concatenate([one.in_view for one in scenes])
    believed = np.concatenate([one.in_view for one in estimates])
    errors = np.concatenate(
        [np.linalg.norm(a.points - b.joints, axis=1) for a, b in zip(estimates, scenes, strict=True)]
    )
    reliability = np.concatenate([one.reliability for one in estimates])
    within = [float((errors[truth] < close).mean()) for close in CLOSE]
    return {
        "in_view": float(truth.mean()), "within_100": within[0], "within_150": within[1],
        "mean_mm": float(1000 * errors[truth].mean()),
        "ece": calibration_error(reliability, errors < CLOSE[0]),
        "known": float(((believed >= 0.5) == truth).mean()), "auc": area_under_roc(believed, truth),
    }  # fmt: skip


def area_under_roc(score: np.ndarray, positive: np.ndarray) -> float:
    """Probability that a positive has a higher score than a negative, ties counted half; NaN without both."""
    from scipy.stats import rankdata

    count = int(positive.sum())
    if count in (0, len(positive)):
        return float("nan")
    ranks = rankdata(score)[positive].sum()
    return float((ranks - count * (count + 1) / 2) / (count * (len(positive) - count)))


PIXELS = 2000
"""Of each image that are asked."""
PATCH = 8
"""Pixels along the side of a patch of no person."""
BINS = 10


def view(kind: str, poses: np.ndarray, rng: np.random.Generator) -> tuple[Any, Any]:
    """A simulated frame of a room and its simulation; `kind` is "standing", "seated" or "empty"."""
    height = float(rng.uniform(0.5, 2.5))
    distance = float(rng.uniform(1.6, 4.0))
    tilt = float(np.degrees(np.arctan2(height - 0.9, distance)) + rng.normal(0.0, 5.0))
    room = f"{rng.choice(list(ROOM_KINDS))}:{rng.integers(10_000, 1 << 30)}"
    sensor, seed = ("kinect", "tof")[int(rng.random() < 0.3)], int(rng.integers(1 << 30))
    shot = CaptureSettings(
        sensor=sensor, distance=distance, height=height, tilt=tilt, room=room, seconds=1 / 30, seed=seed
    )  # fmt: skip
    people = []
    if kind != "empty":
        body = subject_body(BODIES[rng.integers(len(BODIES))], seed=int(rng.integers(1 << 30)))
        clip = PoseClip("still", poses[rng.integers(len(poses))][None], 30.0, "")
        at = (float(rng.uniform(-0.3, 0.3) * distance), float(rng.uniform(-0.6, 0.2)))
        people.append(SimulatedPerson(clip, body, at, float(rng.uniform(-180.0, 180.0)), seated=kind == "seated"))
    simulation = prepare(people, shot)
    return next(iter(simulation.frames())), simulation


def asked(regressor: JointRegressor, kind: str, poses: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Probabilities and truth of pixels and surfaces of one view, and the seconds that it took."""
    frame, simulation = view(kind, poses, rng)
    depth = (frame.depth * 0.001).astype(np.float32)
    pixels = np.flatnonzero(depth > 0)
    pixels = rng.choice(pixels, min(PIXELS, len(pixels)), replace=False)
    started = time.perf_counter()
    found = regressor.person_probability(
        depth, simulation.sensor.camera.intrinsics, simulation.view.R_level_camera, pixels
    )
    seconds = time.perf_counter() - started
    truth = frame.person.ravel()[pixels] >= 0
    rows, columns = np.divmod(pixels, depth.shape[1])
    patch = np.where(truth, 0, 1 + rows // PATCH * depth.shape[1] + columns // PATCH)
    _, number = np.unique(patch, return_inverse=True)
    count = np.bincount(number)
    means = np.bincount(number, weights=found) / count
    enough = count >= 3
    return {
        "pixel": found, "pixel_truth": truth, "surface": means[enough],
        "surface_truth": np.bincount(number, weights=truth)[enough] > 0, "seconds": np.array([seconds]),
    }  # fmt: skip


def error_at_even_odds(probability: np.ndarray, truth: np.ndarray) -> float:
    """Expected calibration error where people and the rest weigh alike."""
    weight = np.where(truth, 0.5 / max(truth.sum(), 1), 0.5 / max((~truth).sum(), 1))
    number = np.minimum((BINS * probability).astype(int), BINS - 1)
    gaps = np.bincount(number, weights=weight * (truth - probability), minlength=BINS)
    return float(np.abs(gaps).sum())


def figures_of(columns: dict[str, np.ndarray], name: str) -> dict[str, float]:
    """Figures of pixels or surfaces."""
    found, truth = columns[name], columns[f"{name}_truth"]
    return {
        "count": len(found), "people": float(truth.mean()), "auc": area_under_roc(found, truth),
        "ece": error_at_even_odds(found, truth), "people_over_half": float((found[truth] > 0.5).mean()),
        "rest_over_half": float((found[~truth] > 0.5).mean()),
    }  # fmt: skip


def people(parser: argparse.ArgumentParser) -> None:
    """Draw views of all kinds, ask, print and write JSON."""
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--views", type=int, default=60, help="of each kind")
    add_database_options(parser)
    options = parser.parse_args()
    regressor = PoseDatabase.load(poses_of(options)).regressor
    if regressor is None:
        parser.error("the database has no regressor; build it again with `depthmocap database build`")
    poses = {"standing": standing_poses(options.split), "seated": seated_poses(options.split), "empty": np.empty(0)}
    rng = np.random.default_rng([17, options.split == "report"])
    asked(regressor, "empty", poses["empty"], np.random.default_rng(0))  # compiled before times are taken
    views = [asked(regressor, kind, own, rng) for kind, own in poses.items() for _ in range(options.views)]
    columns = {name: np.concatenate([one[name] for one in views]) for name in views[0]}
    figures: dict[str, Any] = {name: figures_of(columns, name) for name in ("pixel", "surface")}
    for name, row in figures.items():
        print(
            f"{name}s: {row['count']}, {100 * row['people']:.1f} % of people; AUC {row['auc']:.4f}, "
            f"ECE {row['ece']:.3f}; over one half: people {100 * row['people_over_half']:.1f} %, "
            f"rest {100 * row['rest_over_half']:.1f} %"
        )
    figures["ms_per_thousand"] = float(1e6 * columns["seconds"].sum() / len(columns["pixel"]))
    print(f"{figures['ms_per_thousand']:.2f} ms for a thousand pixels")
    print("written:", save_figures(f"person_{options.split}", figures, vars(options)))


def main() -> None:
    """Run the part that is asked for."""
    run_part(__doc__, {"joints": joints, "people": people})


if __name__ == "__main__":
    main()
