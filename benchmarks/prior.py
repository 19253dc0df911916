"""How well are hidden limbs guessed from the rest? `depthmocap bench prior [--split report]`.

Of people whose motions the database does not hold, some joints' angles are taken away: both legs, both shins, one arm.
What is guessed from the others, the vertical and, in half of the rows, the height of the pelvis above the floor, is
compared with what they do: mean distance of the hidden joints in millimetres, the known joints held fast. Rivals: the
database's mean, one Gaussian, its conditional mean, the mixture's, the most likely component's, and the neighbours in
the database that agree best with what is known. Beside it the share of hidden joint angles within one and two of the
standard deviations that the mixture gives (68 and 95 % if they are right).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks._options import add_database_options, poses_of
from benchmarks._record import save_figures
from benchmarks.regressor import seated_poses, standing_poses
from database_builder.prior import PriorSettings, learn_prior
from toolkit import skeleton
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.database.prior import ANGLES, SIZE, PosePrior, known_without, variables

LEGS = tuple(f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "ankle"))
HIDDEN: dict[str, tuple[str, ...]] = {
    "legs": LEGS,
    "shins": tuple(name for name in LEGS if not name.endswith("hip")),
    "arm": ("left_clavicle", "left_shoulder", "left_elbow", "left_wrist"),
}
"""Joints whose angles are taken away."""
Guess = Callable[[np.ndarray, np.ndarray], np.ndarray]


def main() -> None:
    """Compare the guesses and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--poses", type=int, default=400, help="of each kind")
    parser.add_argument("--components", type=int, default=PriorSettings.components, help="of each situation")
    add_database_options(parser)
    options = parser.parse_args()
    database = PoseDatabase.load(poses_of(options))
    body = load_body("neutral")
    prior = learn_prior(database.poses, body, PriorSettings(components=options.components))
    if prior is None:
        parser.error("the database is too small for a prior")
    guesses = rivals(prior, variables(database.poses, body))
    rows = []
    print(f"{'pose':9}{'hidden':8}{'floor':7}" + "".join(f"{name:>12}" for name in guesses) + f"{'1, 2 sd':>12}")
    for kind, poses in (("standing", standing_poses(options.split)), ("seated", seated_poses(options.split))):
        chosen = poses[np.linspace(0, len(poses) - 1, min(options.poses, len(poses))).astype(int)]
        for hidden, joints in HIDDEN.items():
            for floor in (False, True):
                row = measured(guesses, prior, chosen, joints, floor)
                rows.append({"pose": kind, "hidden": hidden, "floor": floor} | row)
                spread = "{:.0f}, {:.0f} %".format(*(100 * share for share in row["within"]))
                figures = "".join(f"{row[name]:9.0f} mm" for name in guesses)
                print(f"{kind:9}{hidden:8}{'known' if floor else '':7}{figures}{spread:>12}")
    save_figures(f"prior_{options.split}", rows, vars(options))


def rivals(prior: PosePrior, stored: np.ndarray) -> dict[str, Guess]:
    """Ways to guess the unknown of the variables (SIZE,) from those that are known, by name."""
    mean, covariance = stored.mean(axis=0), np.cov(stored.T) + 0.05**2 * np.eye(SIZE)
    single = PosePrior(np.ones(1), mean[None], covariance[None], np.zeros(1, dtype=np.int64))

    def likeliest(values: np.ndarray, known: np.ndarray) -> np.ndarray:
        shares = prior.expected(values, known).responsibilities
        best = int(shares.argmax())
        one = PosePrior(np.ones(1), prior.means[best][None], prior.covariances[best][None], np.zeros(1, dtype=np.int64))
        return one.expected(values, known).mean

    def neighbours(values: np.ndarray, known: np.ndarray, count: int) -> np.ndarray:
        apart = ((stored[:, known] - values[known]) ** 2).sum(axis=1)
        return np.asarray(stored[np.argsort(apart, kind="stable")[:count]][:, ~known].mean(axis=0))

    return {
        "mean": lambda values, known: mean[~known],
        "gaussian": lambda values, known: single.expected(values, known).mean,
        "mixture": lambda values, known: prior.expected(values, known).mean,
        "likeliest": likeliest,
        "neighbour": lambda values, known: neighbours(values, known, 1),
        "8 nearest": lambda values, known: neighbours(values, known, 8),
    }


def measured(
    guesses: dict[str, Guess], prior: PosePrior, poses: np.ndarray, joints: tuple[str, ...], floor: bool
) -> dict[str, Any]:
    """Mean error of the hidden joints (mm) for each guess; share of angles within 1 and 2 standard deviations."""
    body = load_body("neutral")
    known = known_without(joints, floor=floor)
    truth, values = body.joint_positions(poses), variables(poses, body)
    hidden = np.flatnonzero(~known[ANGLES])
    moved = np.zeros(len(skeleton.REPORTED), dtype=bool)
    found: dict[str, Any] = {}
    for name, guess in guesses.items():
        guessed = poses.copy()
        for pose, row in zip(guessed, values, strict=True):
            unknown = guess(row, known)
            pose[6 + hidden] = np.clip(unknown[: len(hidden)], *skeleton.POSE_LIMITS[6 + hidden].T)
        apart = np.linalg.norm(body.joint_positions(guessed) - truth, axis=2)
        moved |= apart.max(axis=0) > 1e-9
        found[name] = apart
    rows = []
    for row in values:
        expected = prior.expected(row, known)
        deviation = np.sqrt(np.diag(expected.covariance)[: len(hidden)])
        rows.append(np.abs(row[hidden] - expected.mean[: len(hidden)]) / deviation)
    figures: dict[str, Any] = {name: float(1000 * apart[:, moved].mean()) for name, apart in found.items()}
    return figures | {"within": [float((np.array(rows) < times).mean()) for times in (1.0, 2.0)]}


if __name__ == "__main__":
    main()
