"""Arms of other poses for a tracked one: the balls of a body, their cost and fit, and the search at joints."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.fitting_helpers import Fit
from tests.test_fitting import CAMERA, HORIZONTAL, SETTINGS, joint_error, scene_of, standing
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.fitting.arms import Arm, ArmSettings, entries_of
from toolkit.fitting.balls import Balls
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.placed import balls_of
from toolkit.fitting.refiner import Refiner
from toolkit.kernels.fit import limbs
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.tracking.search.arm_search import ArmSearch
from toolkit.tracking.search.search_protocol import Hypothesis, ScoredHypothesis
from toolkit.tracking.state import PersonState, Previous

ARM = [
    i for i, name in enumerate(skeleton.POSE_NAMES) if name.startswith(("left_clav", "left_sh", "left_el", "left_wr"))
]


@pytest.fixture(scope="module")
def body() -> Body:
    return load_body("neutral")


@pytest.fixture(scope="module")
def fit(body: Body) -> Fit:
    return Fit(body, CAMERA, HORIZONTAL, SETTINGS)


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    """Return poses with arms anywhere; their legs do not matter."""
    rng = np.random.default_rng(0)
    poses = np.zeros((400, skeleton.POSE_SIZE))
    poses[:, 6:] = 0.6 * rng.uniform(*skeleton.POSE_LIMITS[6:].T, (400, skeleton.POSE_SIZE - 6))
    return poses


# Balls


def test_balls_lie_within_the_body(body: Body) -> None:
    balls = Balls.of_body(body)
    centres = body.joints[balls.joint] + balls.offset
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    assert ((centres > low - 0.02) & (centres < high + 0.02)).all()
    assert ((balls.radius > 0.02) & (balls.radius < 0.2)).all()
    radius = {skeleton.JOINT_NAMES[j]: r for j, r in zip(balls.joint, balls.radius, strict=True)}
    assert radius["left_elbow"] < radius["left_hip"] < radius["lumbar"]
    assert radius["left_elbow"] == pytest.approx(radius["right_elbow"], rel=0.1)


def test_an_arm_in_the_trunk_is_pushed_out(body: Body) -> None:
    def overlap(pose: np.ndarray) -> float:
        placed, balls = soft.placer.place(body, pose), balls_of(body)
        centres = placed.origins[balls.joint] + np.einsum("bij,bj->bi", placed.rotations[balls.joint], balls.offset)
        first, second = balls.apart.T
        gap = np.linalg.norm(centres[first] - centres[second], axis=1) - 0.8 * (
            balls.radius[first] + balls.radius[second]
        )
        return float(-np.minimum(gap, 0.0).sum())

    soft, hard = (Fit(body, CAMERA, HORIZONTAL, FittingSettings(contact_weight=w)) for w in (0.0, 50.0))
    candidates = np.repeat(standing()[None], 200, axis=0)
    candidates[:, ARM] = np.random.default_rng(0).uniform(*skeleton.POSE_LIMITS[ARM].T, (200, len(ARM)))
    inside = max(candidates, key=overlap)
    scene = scene_of(body, inside)
    assert overlap(inside) > 0.05
    assert overlap(hard.refine(inside, scene)) < 0.5 * overlap(soft.refine(inside, scene))


# Costs and fit of chains of balls


def chain_and_measured(seed: int, body: Body, poses: np.ndarray) -> tuple[limbs.Chain, limbs.Measured, np.ndarray]:
    """Return the left arm, an image with a square of depth and a hole, and samples around places of an arm."""
    rng = np.random.default_rng(seed)
    arm = Arm("left", body, np.ascontiguousarray(poses[:20, entries_of("left")]))
    depth = np.zeros(CAMERA.shape, dtype=np.float32)
    depth[30:110, 60:140] = rng.uniform(2.3, 3.2, (80, 80))
    rotation, origin = HORIZONTAL.astype(float), np.array([0.1, -0.2, 2.7])
    samples = rng.uniform(-0.3, 0.8, (30, 3))
    measured = limbs.Measured(rotation, origin, depth, np.array(CAMERA.intrinsics), samples, 1 / 400, 0.05, 0.03, 0.15)
    return arm.chain, measured, arm.angles


def plain_cost(balls: np.ndarray, chain: limbs.Chain, measured: limbs.Measured) -> float:
    gaps = np.linalg.norm(measured.samples[:, None] - balls[None], axis=2) - chain.radii
    unexplained = np.clip(np.minimum(gaps.min(axis=1), measured.cap) - measured.tolerance, 0.0, None)
    intrusions = []
    for ball, radius in zip(balls @ measured.rotation.T + measured.origin, chain.radii, strict=True):
        fx, fy, cx, cy = measured.intrinsics
        u, v = round(fx * ball[0] / ball[2] + cx), round(fy * ball[1] / ball[2] + cy)
        if not (0 <= u < measured.evidence.shape[1] and 0 <= v < measured.evidence.shape[0]):
            intrusions.append(0.0)
        elif measured.evidence[v, u] == 0.0:
            intrusions.append(measured.cap)
        else:
            intrusions.append(np.clip(measured.evidence[v, u] - ball[2] - radius, 0.0, measured.cap))
    return measured.share * unexplained.sum() + measured.free_space * np.mean(intrusions)


@pytest.mark.parametrize("seed", range(4))
def test_costs_are_those_of_the_plain_twin(seed: int, body: Body, poses: np.ndarray) -> None:
    chain, measured, angles = chain_and_measured(seed, body, poses)
    balls = np.empty((len(angles), len(chain.radii), 3))
    limbs.place_balls(angles, chain, balls)
    costs, fitted = np.empty(len(angles)), np.empty(len(angles))
    limbs.limb_costs(balls, chain.radii, measured, costs)
    assert costs == pytest.approx([plain_cost(b, chain, measured) for b in balls], abs=1e-9)
    unmoved = angles.copy()
    limbs.fit_limbs(unmoved, chain, measured, 0.12, 5e-4, 0, fitted)
    assert (fitted == costs).all() and (unmoved == angles).all()


def test_balls_follow_the_chain(body: Body, poses: np.ndarray) -> None:
    arm = Arm("left", body, np.ascontiguousarray(poses[:20, entries_of("left")]))
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[arm.entries] = arm.angles[3]
    joints = body.joint_positions(pose)
    thorax = body.joints[skeleton.JOINT_NAMES.index("thorax")]
    balls = np.empty((1, len(arm.chain.radii), 3))
    limbs.place_balls(arm.angles[3:4], arm.chain, balls)
    for name, ball in (("shoulder", 0), ("elbow", 3), ("wrist", 6)):
        assert balls[0, ball] + thorax == pytest.approx(joints[skeleton.REPORTED.index(f"left_{name}")], abs=1e-9)


def test_the_fit_finds_an_arm_again_and_keeps_its_limits(body: Body, poses: np.ndarray) -> None:
    chain, measured, angles = chain_and_measured(0, body, poses)
    rng = np.random.default_rng(1)
    nothing = np.full(CAMERA.shape, 9.0, dtype=np.float32)  # a wall behind the arm: the balls may not be in front of it
    before, after = [], []
    for true in angles[:10]:
        balls = np.empty((1, len(chain.radii), 3))
        limbs.place_balls(true[None], chain, balls)
        directions = rng.normal(size=(12, len(chain.radii), 3))
        directions /= np.linalg.norm(directions, axis=2, keepdims=True)
        samples = (balls + chain.radii[:, None] * directions).reshape(-1, 3)
        seen = measured._replace(samples=samples, evidence=nothing, free_space=0.0)
        start = np.clip(true + rng.normal(0.0, 0.15, len(true)), *chain.limits.T)[None]
        costs = np.empty(1)
        limbs.fit_limbs(start.copy(), chain, seen, 0.12, 5e-4, 0, costs)
        before.append(costs[0])
        limbs.fit_limbs(start, chain, seen, 0.12, 5e-4, 8, costs)
        after.append(costs[0])
        assert (start >= chain.limits[:, 0]).all() and (start <= chain.limits[:, 1]).all()
    assert np.mean(after) < 0.3 * np.mean(before)


# The search


def test_an_arm_in_the_wrong_place_is_moved_to_its_estimated_joints(body: Body, fit: Fit) -> None:
    truth = standing(left_shoulder_rz=0.9, left_elbow_ry=-1.2)
    scene = scene_of(body, truth)
    wrong = fit.refine(standing(left_shoulder_rz=-1.4, left_shoulder_ry=0.6, left_elbow_ry=-0.2), scene)
    assert joint_error(body, wrong, truth) > 0.06
    first, given = fit.compare(wrong, scene), wrong.copy()
    off = np.random.default_rng(0).normal(0.0, 0.03, (20, 3))  # metres: error of the network
    seen = JointEstimate(body.joint_positions(truth) + off, np.full(20, 0.5))
    kinematics = Refiner(fit.placer, SETTINGS, fit.refiner.pose_terms, terms=())
    search = ArmSearch(fit.objective, fit.refiner, kinematics, ArmSettings())
    state = replace(PersonState.begin(body, sized=True, seed=0), previous=Previous.of_pose(body, wrong))
    best = ScoredHypothesis.of(Hypothesis("local", wrong), body, first, redetected=False)
    observation = SimpleNamespace(scene=scene, estimate=seen, cloud=SimpleNamespace(rotation=HORIZONTAL))
    (found,) = search.propose(observation, state, np.random.default_rng(0), best).hypotheses
    assert found.improves is best and found.comparison is not None
    assert joint_error(body, found.pose, truth) < 0.5 * joint_error(body, wrong, truth)
    assert found.comparison.sample_gaps.mean() < first.sample_gaps.mean()
    assert (wrong == given).all() and (wrong[ARM] != found.pose[ARM]).any()
