"""Orientations as evidence: the term against finite differences, the guide, and an unseen limb."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.inertial_scenes import FIVE, motion_of, poses_of, sensors_of, write_run
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.fitting.orientation import OrientationTerm
from toolkit.fitting.placed import NormalSystem, Placer
from toolkit.inertial.calibrate import CalibrationSequence, calibrate
from toolkit.inertial.guide import InertialGuide
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.synchronise import Clock
from toolkit.io.errors import InertialError
from toolkit.kernels.fit import twists
from toolkit.sensing.camera import Camera

LEVEL = np.diag([1.0, -1.0, -1.0])
CAMERA = Camera(100.0, 100.0, 40.0, 30.0, 80, 60)
ELBOW = skeleton.JOINT_NAMES.index("left_elbow")


@pytest.fixture(scope="module")
def placer() -> Placer:
    return Placer(load_body("neutral"), CAMERA, LEVEL)


def pose_of(seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    pose = np.clip(0.4 * rng.normal(size=skeleton.POSE_SIZE), *skeleton.POSE_LIMITS.T)
    pose[:3] = (0.0, 0.0, -3.0)
    return pose


def term_of(placer: Placer, seed: int, axis: int, turn: float = 0.02) -> OrientationTerm:
    """Return the term of the joint's orientation, rotated slightly."""
    body = load_body("neutral")
    rotation = placer.place(body, pose_of()).rotations[ELBOW]
    vector = np.random.default_rng(seed).normal(size=3)
    rotation = Rotation.from_rotvec(turn * vector / np.linalg.norm(vector)).as_matrix() @ rotation
    return OrientationTerm(ELBOW, rotation, axis, 0.1, 0.7, 1e6)


@pytest.mark.parametrize("axis", (-1, 0, 1, 2))
def test_the_gradient_is_that_of_finite_differences(placer, axis):
    body, term = load_body("neutral"), term_of(placer, 1, axis, 0.3)
    placed, system = placer.place(body, pose_of()), NormalSystem()
    system.reset(placed.origins[0])
    term.attract(system, placed)
    system.assemble(placed)

    def energy(pose):
        turn = term.turn(placer.place(body, pose))
        return 0.5 * term.weight * float((turn**2).sum())

    numeric = np.empty(skeleton.POSE_SIZE)
    for k in range(skeleton.POSE_SIZE):
        step = np.zeros(skeleton.POSE_SIZE)
        step[k] = 1e-5
        numeric[k] = (energy(pose_of() + step) - energy(pose_of() - step)) / 2e-5
    np.testing.assert_allclose(system.vector, numeric, atol=2e-5)


def test_steps_bring_the_joint_to_its_orientation(placer):
    body, term, system = load_body("neutral"), term_of(placer, 2, -1, 0.4), NormalSystem()
    pose, step = pose_of(), np.empty(skeleton.POSE_SIZE)
    for _ in range(30):
        placed = placer.place(body, pose)
        system.reset(placed.origins[0])
        term.attract(system, placed)
        system.assemble(placed)
        twists.bounded_step(
            system.matrix, system.vector, pose, skeleton.POSE_LIMITS, np.full(skeleton.POSE_SIZE, 1e-3), step
        )
        pose = pose + step
    assert term.cost(placer.place(body, pose)) < 1e-3 * term.cost(placer.place(body, pose_of()))


def test_a_twist_of_the_bone_costs_nothing_where_only_its_direction_counts(placer):
    body = load_body("neutral")
    placed = placer.place(body, pose_of())
    rotation = placed.rotations[ELBOW] @ Rotation.from_rotvec([0.9, 0.0, 0.0]).as_matrix()
    whole = OrientationTerm(ELBOW, rotation, -1, 0.1, 1.0, 0.5)
    assert whole.cost(placed) > 0.05
    assert replace(whole, axis=0).cost(placed) < 1e-12


def test_an_opposite_orientation_costs_most_and_hardly_pulls(placer):
    body = load_body("neutral")
    placed, system = placer.place(body, pose_of()), NormalSystem()
    rotation = placed.rotations[ELBOW] @ Rotation.from_rotvec([0.0, 3.1, 0.0]).as_matrix()
    term = OrientationTerm(ELBOW, rotation, -1, 0.1, 0.3, np.radians(30))
    assert term.cost(placed) > 0.09
    system.reset(placed.origins[0])
    term.attract(system, placed)
    assert np.abs(system.gradient).max() < 0.001


def guide_of(noise: str = "none") -> tuple[InertialGuide, TrackedMotion]:
    simulated, motion = sensors_of(noise=noise), motion_of()
    calibration = calibrate([CalibrationSequence(motion, simulated.sensors, Clock(simulated.offset, simulated.rate))])
    return InertialGuide(simulated.sensors, calibration, "anything"), motion


def test_a_calibrated_guide_gives_limb_directions(placer):
    guide, motion = guide_of()
    terms = guide.evidence(float(motion.times[50]), LEVEL)
    assert len(terms) == len(FIVE)
    for term in terms:
        expected = LEVEL.T @ motion.rotations[50, term.joint]
        axes = [term.axis] if term.axis >= 0 else [0, 1, 2]
        np.testing.assert_allclose(term.rotation[:, axes], expected[:, axes], atol=0.02)
    assert sum(term.axis >= 0 for term in terms) == 2, "of forearms the direction alone counts"


def test_a_run_is_not_checked_by_the_sensors_that_made_it(tmp_path):
    from toolkit.inertial.workflow import take_of
    from toolkit.io.files import sha256_of
    from toolkit.tracks import RunInfo

    sensors = tmp_path / "sensors.npz"
    sensors_of().sensors.save(sensors)
    run = write_run(tmp_path / "run", poses_of())
    replace(RunInfo.load(run), sensors_sha256=sha256_of(sensors)).save(run)
    with pytest.raises(InertialError, match="was tracked with these sensors"):
        take_of(run, sensors)


def test_a_disagreement_costs_what_geman_and_mcclure_say(placer):
    placed = placer.place(load_body("neutral"), pose_of())
    for turn in (0.1, 0.5, 2.5):
        term = replace(term_of(placer, 4, -1, turn), sigma=0.5)
        square = (turn / 0.5) ** 2
        assert term.cost(placed) == pytest.approx(0.1 * square / (1.0 + square))
