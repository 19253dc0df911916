"""Does the regressor tell people from rooms? `depthmocap bench person [--split report] [--database POSES]`.

Rooms that it was not trained on, furnished at random, seen by the two sensors of the simulator from 0.5 to 2.5 m above
the floor, with people in them whose motions and bodies it was not trained on, as in `bench regressor`: standing,
seated, and nobody. Told for pixels, and for surfaces (everybody, and every patch of 64 pixels that shows nobody): the
area under the ROC curve, the expected calibration error at even odds (people and the rest weigh alike), and the shares
that are over one half. Times are per thousand pixels.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

from benchmarks._options import add_database_options, poses_of
from benchmarks._record import save_figures
from benchmarks.regressor import area_under_roc, seated_poses, standing_poses
from toolkit.body.shape import subject_body
from toolkit.database.database import PoseDatabase
from toolkit.interiors.room import KINDS
from toolkit.landmarks.regressor import JointRegressor
from toolkit.mocap.clip import PoseClip
from toolkit.simulation.person import Person
from toolkit.simulation.simulate import Shot, prepare
from toolkit.testing.suite import BODIES

PIXELS = 2000
"""Of each image that are asked."""
PATCH = 8
"""Pixels along the side of a patch of nobody's."""
BINS = 10


def view(kind: str, poses: np.ndarray, rng: np.random.Generator) -> tuple[Any, Any]:
    """A simulated frame of a room and its simulation; `kind` is "standing", "seated" or "nobody"."""
    height = float(rng.uniform(0.5, 2.5))
    distance = float(rng.uniform(1.6, 4.0))
    tilt = float(np.degrees(np.arctan2(height - 0.9, distance)) + rng.normal(0.0, 5.0))
    room = f"{rng.choice(list(KINDS))}:{rng.integers(10_000, 1 << 30)}"
    sensor, seed = ("kinect", "tof")[int(rng.random() < 0.3)], int(rng.integers(1 << 30))
    shot = Shot(
        sensor=sensor, distance=distance, height=height, tilt=tilt, room=room, seconds=1 / 30, seed=seed
    )  # fmt: skip
    people = []
    if kind != "nobody":
        body = subject_body(BODIES[rng.integers(len(BODIES))], seed=int(rng.integers(1 << 30)))
        clip = PoseClip("still", poses[rng.integers(len(poses))][None], 30.0, "")
        at = (float(rng.uniform(-0.3, 0.3) * distance), float(rng.uniform(-0.6, 0.2)))
        people.append(Person(clip, body, at, float(rng.uniform(-180.0, 180.0)), seated=kind == "seated"))
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


def calibration_error(probability: np.ndarray, truth: np.ndarray) -> float:
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
        "ece": calibration_error(found, truth), "people_over_half": float((found[truth] > 0.5).mean()),
        "rest_over_half": float((found[~truth] > 0.5).mean()),
    }  # fmt: skip


def main() -> None:
    """Draw views of all kinds, ask, print and write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--views", type=int, default=60, help="of each kind")
    add_database_options(parser)
    options = parser.parse_args()
    regressor = PoseDatabase.load(poses_of(options)).regressor
    if regressor is None or not regressor.knows_rooms:
        parser.error("the database's regressor knows no rooms; build it again with `depthmocap database build`")
    poses = {"standing": standing_poses(options.split), "seated": seated_poses(options.split), "nobody": np.empty(0)}
    rng = np.random.default_rng([17, options.split == "report"])
    asked(regressor, "nobody", poses["nobody"], np.random.default_rng(0))  # compiled before times are taken
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


if __name__ == "__main__":
    main()
