"""Calibration: both solvers against references, properties, rejected inputs, and its file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from tests.inertial_scenes import FIVE, motion_of, sensors_of
from toolkit.inertial import solvers
from toolkit.inertial.calibrate import CalibrationSequence, CalibrationSettings, calibrate
from toolkit.inertial.calibration import GOOD, REFUSED, WEAK
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.solvers import SynchronisedSegment
from toolkit.inertial.stream import Sensors
from toolkit.inertial.synchronise import Clock
from toolkit.io.errors import InertialError

ARMS = ("left_forearm", "right_forearm")


def random_turns(rng: np.random.Generator, count: int, size: float = 1.0) -> Rotation:
    return Rotation.from_rotvec(size * rng.normal(size=(count, 3)))


def degrees_between(first: Rotation, second: Rotation) -> float:
    return float(np.degrees((first.inv() * second).magnitude()))


def strand_of(rng, world, mounting, count=80, noise=0.0, wrong=0.0) -> SynchronisedSegment:
    tracked = random_turns(rng, count, 0.6)
    inertial = world * tracked * mounting * random_turns(rng, count, np.radians(noise))
    bad = rng.random(count) < wrong
    tracked[bad] = tracked[bad] * random_turns(rng, int(bad.sum()), 1.0)
    return SynchronisedSegment(0, 0, inertial, tracked)


def take_of(name="knee_to_elbow", limbs=FIVE, noise="none", seed=0, motion: TrackedMotion | None = None):
    simulated = sensors_of(name, limbs, noise, seed)
    return simulated, CalibrationSequence(motion or motion_of(name), simulated.sensors, Clock(simulated.offset))


def offsets_of(simulated, take, **changes) -> tuple[list[float], list[float]]:
    """Return errors of the worlds and of the mountings, degrees."""
    found = calibrate([take], CalibrationSettings(**changes))
    clock = found.takes[take.motion.name]
    return (
        [degrees_between(clock.world(limb), simulated.world) for limb in take.sensors.names],
        [degrees_between(found.mounting(limb), simulated.mounting[limb]) for limb in take.sensors.names],
    )


def with_wrong_frames(motion: TrackedMotion, seed: int = 0) -> TrackedMotion:
    """Return the motion with a stretch of 30 % of the frames rotated by 40 to 120 degrees."""
    rng = np.random.default_rng(seed)
    count = len(motion.times)
    rows = slice(count // 3, count // 3 + round(0.3 * count))
    axes = rng.normal(size=(18, 3))
    turn = np.radians(rng.uniform(40, 120, (18, 1))) * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    rotations = motion.rotations.copy()
    rotations[rows] = rotations[rows] @ Rotation.from_rotvec(turn).as_matrix()
    return replace(motion, rotations=rotations)


def test_the_thesis_is_exact_without_noise_and_breaks_on_wrong_frames():
    rng = np.random.default_rng(1)
    world, mounting = random_turns(rng, 2)
    clean = strand_of(rng, world, mounting)
    found = solvers.thesis(clean.inertial, clean.tracked, rng)
    assert degrees_between(found[0], world) < 1e-4 and degrees_between(found[1], mounting) < 1e-4
    spoilt = strand_of(rng, world, mounting, wrong=0.3)
    by_thesis = solvers.thesis(spoilt.inertial, spoilt.tracked, rng)
    assert degrees_between(by_thesis[1], mounting) > 2.0


def test_the_solver_with_a_vertical_is_the_least_squares_one():
    rng = np.random.default_rng(3)
    mountings = random_turns(rng, 2)
    segments = [replace(strand_of(rng, solvers.yaw(0.7), mountings[k], 150, noise=3.0), sensor=k) for k in range(2)]
    psis, found = solvers.heading(segments)
    scale = float(solvers.SCALES[-1])

    def left(x):
        parts = []
        for k, segment in enumerate(segments):
            mount = mountings[k] * Rotation.from_rotvec(x[1 + 3 * k : 4 + 3 * k])
            parts.append(solvers.residuals(segment, solvers.yaw(x[0]), mount))
        e = np.concatenate(parts)
        return e / np.sqrt(1.0 + (e / scale) ** 2)

    best = least_squares(left, np.array([0.7, 0, 0, 0, 0, 0, 0]))
    assert abs(np.degrees(psis[0] - best.x[0])) < 0.1
    for k in range(2):
        expected = mountings[k] * Rotation.from_rotvec(best.x[1 + 3 * k : 4 + 3 * k])
        assert degrees_between(found[k], expected) < 0.2


@given(st.integers(0, 10_000))
@settings(max_examples=8, deadline=None)
def test_a_calibration_without_noise_is_exact_for_every_offset(seed):
    rng = np.random.default_rng(seed)
    psi, mounting = rng.uniform(-np.pi, np.pi), random_turns(rng, 1)[0]
    segment = strand_of(rng, solvers.yaw(psi), mounting, count=40)
    psis, found = solvers.heading([segment])
    assert degrees_between(solvers.yaw(psis[0]), solvers.yaw(psi)) < 1e-3
    assert degrees_between(found[0], mounting) < 1e-3
    assert abs(solvers.heading_given([segment], {0: mounting}) - psis[0]) % (2 * np.pi) < 1e-3


def test_turning_the_world_changes_q_g_alone_and_turning_the_sensor_q_l_alone():
    _, take = take_of(limbs=ARMS)
    plain = calibrate([take])
    turn = Rotation.from_rotvec([0.0, 0.0, 0.8])
    streams = [replace(s, rotations=turn * s.rotations) for s in take.sensors]
    world = calibrate([replace(take, sensors=replace(take.sensors, streams=tuple(streams)))])
    grip = Rotation.from_rotvec([0.3, 0.2, -0.5])
    streams = [
        replace(
            s, rotations=s.rotations * grip, gyro=grip.inv().apply(s.gyro),
            acceleration=grip.inv().apply(s.acceleration),
        )
        for s in take.sensors
    ]  # fmt: skip
    sensor = calibrate([replace(take, sensors=replace(take.sensors, streams=tuple(streams)))])
    name = take.motion.name
    for limb in ARMS:
        before, after = (c.takes[name].world(limb) for c in (plain, world))
        assert degrees_between(after, turn * before) < 0.05
        assert degrees_between(world.mounting(limb), plain.mounting(limb)) < 0.05
        assert degrees_between(sensor.takes[name].world(limb), before) < 0.05
        assert degrees_between(sensor.mounting(limb), plain.mounting(limb) * grip) < 0.05


@pytest.mark.parametrize("name", ("semaphore", "knee_to_elbow"))
@pytest.mark.parametrize("wrong", (False, True))
def test_real_flaws_and_wrong_frames_leave_a_few_degrees(name, wrong):
    motion = with_wrong_frames(motion_of(name)) if wrong else None
    simulated, take = take_of(name, noise="mtx", motion=motion)
    worlds, mountings = offsets_of(simulated, take)
    assert max(worlds) < 2.0
    assert np.median(mountings) < 2.5
    assert max(mountings) < 4.0


def test_the_clock_is_improved_by_what_the_calibration_leaves_over():
    simulated, take = take_of(noise="mtx")
    late = replace(take, clock=Clock(simulated.offset + 0.03))
    found = calibrate([late]).takes[take.motion.name]
    assert abs(found.offset - simulated.offset) < 0.006


def upright_motion(tilt: float) -> TrackedMotion:
    """Return a person who turns on the spot and nods by an angle in degrees."""
    motion = motion_of()
    count = len(motion.times)
    times = motion.times[:, None]
    turn = Rotation.from_rotvec(np.sin(2.1 * times) * [0.0, 1.0, 0.0])
    nod = Rotation.from_rotvec(np.radians(tilt) * np.sin(3.7 * times) * [1.0, 0.0, 0.0])
    rotations = np.repeat((turn * nod).as_matrix()[:, None], 18, axis=1)
    return replace(motion, rotations=rotations, origins=np.zeros((count, 18, 3)), name="turning")


def sensors_on(motion: TrackedMotion, limbs=("pelvis", "chest"), noise: float = 3.0, seed: int = 0):
    from toolkit.inertial.stream import checked_stream

    rng = np.random.default_rng(seed)
    world = Rotation.from_rotvec([np.pi / 2, 0, 0]) * solvers.yaw(0.4)
    streams = []
    for limb in limbs:
        q = world * motion.orientation(limb) * random_turns(rng, 1)[0]
        q = q * random_turns(rng, len(q), np.radians(noise / np.sqrt(3)))
        streams.append(checked_stream(limb, motion.times, rotations=q.as_quat(scalar_first=True)))
    return Sensors(tuple(streams))


@pytest.mark.parametrize(("tilt", "status"), ((40.0, GOOD), (14.0, WEAK), (1.0, REFUSED)))
def test_the_status_reports_an_undetermined_heading(tilt, status):
    motion = upright_motion(tilt)
    take = CalibrationSequence(motion, sensors_on(motion), Clock(0.0))
    if status == REFUSED:
        with pytest.raises(InertialError, match="no sensor can be calibrated .*tilted by"):
            calibrate([take])
        return
    assert {sensor.status for sensor in calibrate([take]).sensors.values()} == {status}


@pytest.mark.parametrize(("wrong", "status"), [(0.2, GOOD), (0.66, WEAK)])
def test_a_mounting_is_good_only_if_sensor_and_track_agree_in_half_of_the_frames(wrong, status):
    simulated, take = take_of(limbs=ARMS)
    rng = np.random.default_rng(3)
    rotations = take.motion.rotations.copy()
    for rows in np.array_split(np.arange(len(rotations)), 6):
        turn = Rotation.from_rotvec(np.radians(rng.uniform(40, 120)) * np.eye(3)[rng.integers(3)])
        bad = rows[: round(wrong * len(rows))]
        rotations[bad] = rotations[bad] @ turn.as_matrix()
    found = calibrate(
        [replace(take, motion=replace(take.motion, rotations=rotations))], CalibrationSettings(refine_clock=False)
    )
    for sensor in found.sensors.values():
        assert sensor.status == status, sensor
        assert (sensor.inliers >= 0.5) == (status == GOOD)
        assert "% of the frames" in sensor.reason or status == GOOD


def test_without_a_second_axis_there_is_no_calibration():
    motion = upright_motion(0.5)
    take = CalibrationSequence(motion, sensors_on(motion), Clock(0.0))
    for method in ("robust", "thesis"):
        with pytest.raises(InertialError, match="no sensor can be calibrated"):
            calibrate([take], CalibrationSettings(method=method))


def test_a_sensor_that_does_not_belong_to_the_track_is_refused():
    simulated, take = take_of(limbs=ARMS)
    still = take.sensors.streams[0]
    rng = np.random.default_rng(0)
    foreign = replace(still, rotations=random_turns(rng, len(still), 2.0))
    other = replace(take, sensors=replace(take.sensors, streams=(foreign, take.sensors.streams[1])))
    found = calibrate([other], CalibrationSettings(heading="own"))
    assert found.sensors["left_forearm"].status == REFUSED
    assert "check placement and clock" in found.sensors["left_forearm"].reason
    assert found.usable == ("right_forearm",)


@pytest.mark.parametrize("seed", range(3))
def test_the_vertical_of_all_sequences_starts_a_calibration(seed):
    rng = np.random.default_rng(seed)
    mounting, psis = random_turns(rng, 1)[0], rng.uniform(-3, 3, 4)
    upright_only = Rotation.from_rotvec(np.array([0.0, 1.0, 0.0]) * rng.uniform(-0.05, 0.05, (60, 1)))
    tracked = [upright_only, *(random_turns(rng, 60, 0.5) for _ in range(3))]
    segments = [
        SynchronisedSegment(0, g, solvers.yaw(psi) * own * mounting, own)
        for g, (psi, own) in enumerate(zip(psis, tracked, strict=True))
    ]
    for psi, found in zip(psis, solvers.by_vertical(segments).values(), strict=True):
        assert degrees_between(solvers.yaw(psi), solvers.yaw(found)) < 1e-2
