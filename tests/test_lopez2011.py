"""configs/lopez2011.yaml against Lopez-Mendez 2011: each equation against a plain reference.

Eq. 3 and 4 are held against theirs in test_kernels_particles.py, the fork in test_landmarks_effectors.py.
"""

import numpy as np
import pytest

from tests.test_fitting_particles import LEVEL, depth_of, frame_of, pose_of
from toolkit.app.config import load_settings
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.trackers.lopez2011.costs import costs_of_arm, costs_of_trunks
from toolkit.trackers.lopez2011.effectors import Effectors, Fork
from toolkit.trackers.lopez2011.filter import (  # fmt: skip
    NEAR_SCALE,
    ROOT_DIFFUSION,
    SPREAD,
    TRUNK_ENTRIES,
    UpperFilter,
    candidate_weights,
    resampled,
)
from toolkit.trackers.lopez2011.initial import initial_pose, place_hands
from toolkit.trackers.lopez2011.tracker import ParticleTrackerSettings
from toolkit.trackers.lopez2011.upper import UpperBodies, UpperBody

SETTINGS = load_settings(ParticleTrackerSettings, "lopez2011")
PARTICLES = SETTINGS.particles


@pytest.fixture(scope="module")
def upper() -> UpperBody:
    return UpperBodies(LEVEL).of(load_body())


def test_all_particles_but_one_diffuse_by_one_gaussian() -> None:
    poses = np.zeros((4000, skeleton.POSE_SIZE))
    UpperFilter(PARTICLES).diffuse(poses, TRUNK_ENTRIES, 1 / 30, np.random.default_rng(0))
    halves = poses[1:2001, 0].std(), poses[2001:, 0].std()
    assert not poses[0].any() and halves == pytest.approx([ROOT_DIFFUSION[0]] * 2, rel=0.1)


def test_equation_1_particles_go_on_by_the_exponential_of_their_costs() -> None:
    costs = np.array([0.0, 0.2, 0.4, 1.0])
    kept = np.bincount(
        np.concatenate([resampled(costs, np.random.default_rng(seed)) for seed in range(4000)]), minlength=4
    )
    expected = np.exp(-3.0 * costs)  # the paper does not state the factor of a cost
    np.testing.assert_allclose(kept / kept.sum(), expected / expected.sum(), atol=0.01)


def test_equation_5_a_candidate_counts_by_its_distance_alone(upper: UpperBody) -> None:
    poses = np.stack([pose_of(), pose_of(left_elbow_ry=-1.0)])
    candidates = np.concatenate([place_hands(upper, poses[0]), [[0.5, 0.9, -1.2]]])  # the first are fixed by the hands
    found = candidate_weights(upper, poses, 0, candidates)
    for pose, weights in zip(poses, found, strict=True):
        gaps = np.linalg.norm(candidates - place_hands(upper, pose)[0], axis=1)
        expected = 1.0 / np.exp(gaps**2 / NEAR_SCALE**2)  # 1 / f of the squared distance
        np.testing.assert_allclose(weights, expected / expected.sum(), atol=1e-12)


def test_equation_6_half_of_the_arms_reach_for_candidates_and_the_others_diffuse(upper: UpperBody) -> None:
    pose = pose_of(left_elbow_ry=-0.8)
    target = place_hands(upper, pose)[:1] + [0.05, 0.05, 0.0]
    poses = np.repeat(pose[None], PARTICLES.count, axis=0)
    aimed = UpperFilter(PARTICLES).move_arm(upper, poses, 0, target, 1 / 30, np.random.default_rng(0))
    off = np.linalg.norm(np.array([place_hands(upper, one)[0] for one in poses]) - target, axis=1)
    assert 0.4 < aimed.mean() <= 1.0 - PARTICLES.alpha
    assert np.sqrt((off[aimed] ** 2).mean()) == pytest.approx(np.sqrt(3) * SPREAD, rel=0.15)
    assert np.median(off[~aimed]) > 2 * np.median(off[aimed])


def test_equation_7_scores_a_first_pose_of_inverse_kinematics(upper: UpperBody) -> None:
    truth = pose_of(left_shoulder_rz=0.4, right_shoulder_rz=-0.2, left_elbow_ry=-0.9, right_elbow_ry=1.2)
    head = skeleton.END_EFFECTORS.index("head")
    wanted = np.stack([upper.body.end_effector_positions(truth)[head], *place_hands(upper, truth)])
    effectors = Effectors(wanted, wanted.mean(axis=0), tuple(wanted[:, None]))
    frame = frame_of(depth_of(upper, truth), wanted)
    first = initial_pose(upper, effectors, Fork(0, 1, 2), frame)
    reached = np.stack([upper.body.end_effector_positions(first.pose)[head], *place_hands(upper, first.pose)])
    gaps = np.linalg.norm(reached - wanted, axis=1) / SPREAD
    # "We average the costs of all the three partitions", each around its own joints alone.
    around = frame._replace(candidates=np.empty((0, 3)))
    layers = [costs_of_trunks(upper, first.pose[None], first.pose, around)[0]]
    layers += [costs_of_arm(upper, first.pose[None], side, first.pose, around)[0] for side in range(2)]
    assert min(layers) > 0.0
    assert first.score == pytest.approx(-0.5 * (gaps**2).mean() - np.mean(layers), abs=1e-9)
    assert np.linalg.norm(reached - wanted, axis=1).max() < 0.05
