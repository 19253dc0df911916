"""What each part of the particle filter is worth: `depthmocap bench upper_parts [--split report] [--seeds 2]`.

The takes of `toolkit/testing/upper.py`. First with body and first pose given (those of the shape space that are nearest
to the true joints), so that the filter alone decides: without proposals, with them, candidates from the component tree,
other shares of diffusion, without each term of the likelihood, more particles, all joints in one layer instead of
three, and local optimisation in competition. Then told nothing: without the fork, with nothing but the fork, with the
body measured as in the paper, with an average one, and with the body given. Errors are those of `bench upper`; each
row is compared with the one named beside it, by a paired bootstrap over takes; seeds are averaged.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._record import save_figures
from benchmarks.upper import score_take
from toolkit.body.body import Body
from toolkit.evaluation import upper
from toolkit.evaluation.bootstrap import paired_bootstrap
from toolkit.lopez2011.costs import ParticleFrame
from toolkit.lopez2011.filter import Filtered, UpperFilter, resampled
from toolkit.lopez2011.tracker import PARTICLES, ParticleFollower, ParticleTracker
from toolkit.lopez2011.upper import UpperBody
from toolkit.pipeline.trackers import load_tracker
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.recording import Recording
from toolkit.testing.given import fitted_to_joints
from toolkit.testing.scenes import record_scene
from toolkit.testing.suite import WORK
from toolkit.testing.upper import GROUPS, upper_scenes
from toolkit.tracking.solo import Solo
from toolkit.tracking.state import FIRST_STEP, Previous


class Part(NamedTuple):
    """One row: what it starts from, what it changes, and what it is compared with.

    Attributes
    ----------
    told : "all" (body and first pose), "body", or "nothing"
    against : name of the row that it is compared with; empty for none
    changes : settings, on top of `configs/lopez2011.yaml`
    flat : whether all joints are moved and weighed in one layer
    """

    told: str
    against: str
    changes: dict[str, Any]
    flat: bool = False


PARTS: dict[str, Part] = {
    "plain": Part("all", "", {"particles.alpha": 1.0}),
    "geodesic": Part("all", "plain", {}),
    "blind swivels": Part("all", "geodesic", {"particles.looks": 0}),
    "tree": Part("all", "geodesic", {"effectors.tree": True}),
    "refined": Part("all", "geodesic", {"refined": True}),
    "no cuts": Part("all", "geodesic", {"effectors.cuts": 0}),
    "3 candidates": Part("all", "geodesic", {"effectors.count": 3}),
    "8 candidates": Part("all", "geodesic", {"effectors.count": 8}),
    "alpha 0.25": Part("all", "geodesic", {"particles.alpha": 0.25}),
    "alpha 0.75": Part("all", "geodesic", {"particles.alpha": 0.75}),
    "no depth term": Part("all", "geodesic", {"particles.depth": 0.0}),
    "no silhouettes": Part("all", "geodesic", {"particles.silhouette": 0.0}),
    "no overlap term": Part("all", "geodesic", {"particles.overlap": 0.0}),
    "one layer of 192": Part("all", "geodesic", {"particles.count": 192}, flat=True),
    "192 a layer": Part("all", "geodesic", {"particles.count": 192}),
    "256 a layer": Part("all", "geodesic", {"particles.count": 256}),
    "nothing told": Part("nothing", "", {}),
    "fork only": Part("nothing", "nothing told", {"initial.unlabelled": False}),
    "no fork": Part("nothing", "nothing told", {"initial.fork": False}),
    "body measured": Part("nothing", "nothing told", {"initial.sizes": []}),
    "average body": Part("nothing", "nothing told", {"measured_seconds": 0.0}),
    "body told": Part("body", "nothing told", {}),
    "nothing told at 256 a layer": Part("nothing", "nothing told", {"particles.count": 256}),
}


class FlatFilter(UpperFilter):
    """A filter without layers: trunk and both arms are moved at once, and weighed by the whole picture."""

    def trunk(
        self, upper: UpperBody, particles: np.ndarray, before: np.ndarray, frame: ParticleFrame, dt: float,
        rng: np.random.Generator,
    ) -> np.ndarray:  # fmt: skip
        """Nothing: see `arms`."""
        return particles

    def arms(
        self, upper: UpperBody, particles: np.ndarray, before: np.ndarray, frame: ParticleFrame, dt: float,
        first: int, rng: np.random.Generator,
    ) -> Filtered:  # fmt: skip
        """Everything, in one layer."""
        poses = particles.copy()
        self.proposals.move_trunk(poses, dt, rng)
        aimed = [self.proposals.move_arm(upper, poses, side, frame, dt, rng) for side in (first, 1 - first)]
        costs = self.costs.whole(upper, poses, frame)
        chosen = resampled(self.settings.sharpness * costs, rng)
        estimate = poses[int(costs.argmin())]
        return Filtered(poses[chosen], estimate, self.costs.mean(upper, estimate, frame), float(np.mean(aimed)))


def beginning(recording: Recording) -> tuple[Body, np.ndarray]:
    """Body and pose (P,), level frame, of the first frame, by the true joints."""
    rotation = level_rotation(recording.up_camera)
    return fitted_to_joints(recording.joints[0].astype(np.float64) @ rotation.T)


def started(part: Part, recording: Recording, seed: int) -> Solo:
    """The part's tracker before a recording, told what it is to be told."""
    tracker = load_tracker("lopez2011", part.changes | {"seed": seed})
    assert isinstance(tracker, ParticleTracker)
    if part.told == "nothing":
        return Solo(tracker, recording)
    body, pose = beginning(recording)
    solo = Solo(ParticleTracker(tracker.settings, body=body), recording)
    follower = solo.follower
    assert isinstance(follower, ParticleFollower)
    if part.flat:
        follower.filtering = FlatFilter(tracker.settings.particles)
    if part.told == "all":
        poses = np.repeat(pose[None], tracker.settings.particles.count, axis=0)
        follower.state = replace(
            follower.state,
            previous=Previous.of_pose(body, pose),
            pose=pose,
            timestamp=float(recording.timestamps[0]) - FIRST_STEP,
            memory={PARTICLES: {"poses": poses}},
        )
    return solo


def measure(part: Part, recordings: list[Recording], frames: int, seeds: int) -> dict[str, Any]:
    """Figures of one row, and the errors of each take, averaged over seeds."""
    scores = [
        [score_take(started(part, recording, seed), recording, frames)[0] for recording in recordings]
        for seed in range(seeds)
    ]
    each = np.mean([[score.pixels.mean() for score in row] for row in scores], axis=0)
    return upper.upper_figures([score for row in scores for score in row]) | {"takes": each.tolist()}


def compared(figures: dict[str, dict[str, Any]], row: str) -> dict[str, float] | None:
    """By how many pixels a row is worse than the one it is compared with, with the 95 % interval."""
    against = PARTS[row].against
    if against not in figures:
        return None
    rng = np.random.default_rng(0)
    found = paired_bootstrap(np.array(figures[row]["takes"]), np.array(figures[against]["takes"]), rng)
    return {"mean": found.mean, "low": found.low, "high": found.high}


def run(rows: list[str], recordings: list[Recording], frames: int, seeds: int, show: Callable[..., None]) -> Any:
    """Figures of all rows by name; each is shown as it comes."""
    figures: dict[str, dict[str, Any]] = {}
    show(f"{'':<28}{'px':>7}{'hands px':>10}{'mm':>8}{'tracked %':>11}   worse by px [95 %] than")
    for row in rows:
        figures[row] = values = measure(PARTS[row], recordings, frames, seeds)
        values["worse"] = worse = compared(figures, row)
        beside = (
            f"{worse['mean']:+.1f} [{worse['low']:+.1f}, {worse['high']:+.1f}] {PARTS[row].against}" if worse else ""
        )
        numbers = (values["upper_px"], values["hands_px"], values["upper_mm"], 100 * values["tracked"])
        show(f"{row:<28}{numbers[0]:7.1f}{numbers[1]:10.1f}{numbers[2]:8.1f}{numbers[3]:11.1f}   {beside}")
    return figures


def main() -> None:
    """Measure, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--rows", default=",".join(PARTS))
    parser.add_argument("--takes", type=int, help="at most so many of each group")
    parser.add_argument("--groups", default=",".join(GROUPS))
    parser.add_argument("--frames", type=int, default=90, help="length of each take, at most")
    parser.add_argument("--first", type=int, default=60, help="frames of each take that are tracked, at most")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    scenes = upper_scenes(options.split, tuple(options.groups.split(",")), options.takes)
    recordings = [open_recording(record_scene(scene, options.work, options.frames)) for scene in scenes]
    figures = run(options.rows.split(","), recordings, options.first, options.seeds, print)
    whole = len(recordings) == len(upper_scenes(options.split)) and min(options.frames, options.first) >= 60
    settings = {name: getattr(options, name) for name in ("frames", "first", "seeds", "takes", "groups")}
    print("written:", save_figures(f"upper_parts_{options.split}{'' if whole else '_part'}", figures, settings))


if __name__ == "__main__":
    main()
