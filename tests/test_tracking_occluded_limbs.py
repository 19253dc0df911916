"""Unobserved limbs: they stay in place with the uncertainty of the prior."""

import numpy as np
import pytest

from tests.fitting_helpers import whole_image
from tests.poses import pose_at
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.database.prior import ANGLES, SIZE, PosePrior, variables
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.placed import Placer
from toolkit.fitting.scene import Scene
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.cloud import Cloud
from toolkit.tracking.occluded_limbs import OccludedLimbs, spread_of_joints, unobserved_joints

BODY = load_body("neutral")
CAMERA = Camera(100.0, 100.0, 39.5, 49.5, 80, 100)
LEVEL = level_rotation(np.array([0.0, -1.0, 0.0]))
KNEE = skeleton.POSE_NAMES.index("left_knee_rx")
LEG = [i for i, name in enumerate(skeleton.POSE_NAMES) if name.startswith(("left_hip", "left_knee", "left_ankle"))]
LEGS = [i for i, name in enumerate(skeleton.POSE_NAMES) if any(part in name for part in ("hip", "knee", "ankle"))]


def standing(knee: float = 0.0) -> np.ndarray:
    return pose_at((0.0, 0.0, -2.5), **{skeleton.POSE_NAMES[KNEE]: knee})


@pytest.fixture(scope="module")
def objective() -> Objective:
    return Objective(Placer(BODY, CAMERA, LEVEL), FittingSettings())


@pytest.fixture(scope="module")
def prior() -> PosePrior:
    """Return a prior in which the knees are bent by about half a radian."""
    mean = variables(standing(), BODY)
    mean[ANGLES][KNEE - 6] = 0.5
    return PosePrior(np.ones(1), mean[None], 0.01 * np.eye(SIZE)[None], np.zeros(1, dtype=np.int64))


def looked_at(objective: Objective, pose: np.ndarray, last_row: int) -> Comparison:
    """Return the body in a pose, observed down to row `last_row`."""
    depth = whole_image(objective.placer.place(BODY, pose))[0].astype(np.float32)
    unobserved = np.arange(len(depth))[:, None] > np.full(depth.shape[1], last_row)
    depth[unobserved] = 0.0
    cloud = Cloud.from_depth(depth, CAMERA, LEVEL)
    return objective.compare(BODY, pose, Scene(cloud, np.zeros((0, 3)), 100, unobserved=unobserved))


def test_legs_below_the_image_are_unobserved_and_nothing_else_is(objective: Objective) -> None:
    pose = standing()
    waist = int(objective.placer.intrinsics[3] + 100.0 * 0.02 / 2.5)
    seen = looked_at(objective, pose, waist)
    assert seen.placed is not None
    hidden = unobserved_joints(seen.placed, seen.observed)
    legs = {name for name in skeleton.JOINT_NAMES if name.endswith(("hip", "knee", "ankle"))}
    assert {name for name, is_hidden in zip(skeleton.JOINT_NAMES, hidden, strict=True) if is_hidden} == legs


def test_a_limb_that_is_known_to_be_out_of_view_is_guessed_though_it_is_before_what_is_seen(
    objective: Objective, prior: PosePrior
) -> None:
    pose, before = standing(knee=0.3), standing(knee=0.1)
    seen, occluded_limbs = looked_at(objective, pose, 99), OccludedLimbs(prior)
    assert occluded_limbs.guess(pose, seen, objective, before).observed.all()
    assert seen.scene is not None
    seen.scene.withheld = np.array([name.startswith("left_knee") for name in skeleton.JOINT_NAMES])
    guess = occluded_limbs.guess(pose, seen, objective, before)
    assert guess.pose[KNEE] == before[KNEE]
    assert {name for name, seen in zip(skeleton.REPORTED, guess.observed, strict=True) if not seen} == {
        "left_ankle", "left_foot"
    }  # fmt: skip


def test_unobserved_limbs_stay_in_place_and_observed_ones_follow(objective: Objective, prior: PosePrior) -> None:
    before, pose = standing(knee=0.3), standing(knee=2.0)
    seen, occluded_limbs = looked_at(objective, pose, 40), OccludedLimbs(prior)
    guess = occluded_limbs.guess(pose, seen, objective, before)
    assert guess.pose[KNEE] == before[KNEE]
    others = np.delete(np.arange(skeleton.POSE_SIZE), LEGS)
    before_elsewhere = before.copy()
    before_elsewhere[others] += 0.1
    assert occluded_limbs.guess(pose, seen, objective, before_elsewhere).pose.tolist() == guess.pose.tolist()
    assert occluded_limbs.guess(pose, seen, objective, None).pose is pose


def test_a_guess_is_as_uncertain_as_the_prior_given_what_is_seen(objective: Objective) -> None:
    """One knee follows the other with nine tenths of its variance; the arms have no correlation."""
    pose, spreads = standing(), []
    mean = variables(pose, BODY)
    right = skeleton.POSE_NAMES.index("right_knee_rx") - 6
    for scale in (0.01, 0.04):
        covariance = scale * np.eye(SIZE)
        covariance[KNEE - 6, right] = covariance[right, KNEE - 6] = 0.9 * scale
        prior = PosePrior(np.ones(1), mean[None], covariance[None], np.zeros(1, dtype=np.int64))
        guess = OccludedLimbs(prior).guess(pose, looked_at(objective, pose, 40), objective, None)
        moved = {skeleton.REPORTED[i] for i in np.flatnonzero(guess.spread)}
        assert moved == {f"{side}_{part}" for side in ("left", "right") for part in ("knee", "ankle", "foot")}
        spreads.append(guess.spread)
    assert spreads[1] == pytest.approx(2.0 * spreads[0])


def test_the_spread_of_a_joint_is_that_of_poses_with_such_angles(objective: Objective) -> None:
    rng, pose = np.random.default_rng(0), standing(knee=0.7)
    entries = np.array(LEG) - 6
    mix = rng.normal(scale=0.01, size=(len(LEG), len(LEG)))
    poses = np.repeat(pose[None], 4000, axis=0)
    poses[:, LEG] += rng.multivariate_normal(np.zeros(len(LEG)), mix @ mix.T, len(poses))
    apart = BODY.joint_positions(poses) - BODY.joint_positions(pose)
    expected = np.sqrt((apart**2).mean(axis=(0, 2)))
    spread = spread_of_joints(objective.placer.place(BODY, pose), entries, mix @ mix.T)
    moved = expected > 1e-9
    assert {skeleton.REPORTED[i] for i in np.flatnonzero(moved)} == {"left_knee", "left_ankle", "left_foot"}
    assert spread[moved] == pytest.approx(expected[moved], rel=0.05)
    assert not spread[~moved].any()
