"""Simulated sensors, orientation from raw data, clocks, and the verb `read`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.inertial_scenes import RATE, motion_of, poses_of, sensors_of, write_run
from tests.run_helpers import run as run_command
from tests.sample_files import write_csv
from tests.support.worn_sensors import simulate_sensors
from toolkit.inertial.fusion import fused, integrated
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.stream import FREE, GRAVITY, Sensors
from toolkit.inertial.synchronise import Signal, angular_velocity, correlations, synchronise
from toolkit.inertial.workflow import load_sensors
from toolkit.io.errors import InertialError

UP = np.array([0.0, 0.0, 1.0])


def test_sensors_without_errors_are_exact():
    simulated, motion = sensors_of(), motion_of()
    for stream in simulated.sensors:
        found, known = stream.at(motion.times[:-1])
        true = simulated.world * motion.orientation(stream.name)[:-1] * simulated.mounting[stream.name]
        assert np.degrees((found.inv() * true).magnitude()[known]).max() < 0.05
        rates = angular_velocity(stream.rotations, stream.times)
        between = 0.5 * (stream.gyro[1:] + stream.gyro[:-1])
        assert np.abs(rates - between).max() < 0.03
        lifted = stream.rotations.apply(stream.acceleration).mean(axis=0)
        np.testing.assert_allclose(lifted, [0, 0, GRAVITY], atol=0.5)


def test_a_constant_rate_becomes_a_turn_about_its_axis():
    times, rate = np.arange(200) / 100, np.array([0.3, -0.4, 1.2])
    found = integrated(times, np.tile(rate, (200, 1)))
    assert (found.inv() * Rotation.from_rotvec(times[:, None] * rate)).magnitude().max() < 1e-6


@pytest.mark.parametrize("gaps", [0.0, 0.2])
def test_the_correlation_over_lags_is_that_of_the_common_rows(gaps):
    rng = np.random.default_rng(1)
    first, second = (Signal(rng.normal(size=n) + 3.0, rng.random(n) >= gaps, 0.0) for n in (120, 150))
    lags = np.arange(-130, 160, 7)
    for lag, value in zip(lags, correlations(first, second, lags, 20), strict=True):
        rows = np.arange(max(0, -lag), max(0, -lag, min(120, 150 - lag)))
        rows = rows[first.known[rows] & second.known[rows + lag]]
        if len(rows) < 20:
            assert np.isnan(value)
        else:
            assert value == pytest.approx(np.corrcoef(first.values[rows], second.values[rows + lag])[0, 1], abs=1e-9)


@pytest.mark.parametrize("name", ("semaphore", "side_step", "knee_to_elbow"))
def test_raw_measurements_become_orientations_up_to_the_heading(name):
    stream = sensors_of(name, noise="mtx").sensors.streams[3]
    found = fused(replace(stream, rotations=None))
    assert found.origin == FREE
    rows = np.flatnonzero(stream.valid)
    difference = stream.rotations[rows] * found.rotations[rows].inv()
    tilt = np.degrees(np.arccos(np.clip(difference.apply(UP)[:, 2], -1, 1)))
    assert np.median(tilt) < 5.0
    _, _, z, w = difference.as_quat().T
    heading = np.degrees(np.unwrap(2 * np.arctan2(z, w)))
    assert np.ptp(heading) < 8.0


@pytest.mark.parametrize("name", ("semaphore", "archery", "knee_to_elbow"))
@pytest.mark.parametrize("noise", ("none", "mtx", "phone"))
def test_the_clock_is_found_against_true_poses(name, noise):
    simulated = sensors_of(name, noise=noise, seed=4)
    clock = synchronise(motion_of(name), simulated.sensors)
    middle = 0.5 * motion_of(name).times[-1] * (simulated.rate - 1.0)
    assert abs(clock.offset - simulated.offset - middle) < 0.01


def test_periodic_motion_is_refused_because_it_locks_a_period_off():
    poses = np.tile(poses_of()[:45], (5, 1))
    poses[-1, 6] += 0.01
    from toolkit.body.shape import subject_body

    simulated = simulate_sensors(subject_body("neutral"), poses, RATE, ["left_shin", "right_forearm"], "none")
    with pytest.raises(InertialError, match="agree nearly as well at two offsets"):
        synchronise(motion_of(poses=poses), simulated.sensors)


def test_an_offset_at_the_border_of_the_search_is_refused():
    simulated = sensors_of()
    moved = [replace(stream, times=stream.times + 0.2) for stream in simulated.sensors]
    whole = motion_of()
    late = replace(
        whole, times=whole.times[5:], rotations=whole.rotations[5:], origins=whole.origins[5:], valid=whole.valid[5:]
    )
    with pytest.raises(InertialError, match="border of the search"):
        synchronise(late, Sensors(tuple(moved)), 0.1)


def typed(*words) -> None:
    assert run_command(*words) == 0


def test_sensors_are_read_as_typed_and_their_clock_is_found(tmp_path, capsys):
    simulated = sensors_of(noise="mtx", seed=4)
    devices = [f"00B{i}" for i in range(len(simulated.sensors))]
    streams = zip(simulated.sensors, devices, strict=True)
    renamed = replace(simulated.sensors, streams=tuple(replace(stream, name=name) for stream, name in streams))
    write_csv(tmp_path / "raw.csv", renamed)
    limbs = zip(devices, simulated.sensors.names, strict=True)
    (tmp_path / "placement.yaml").write_text("\n".join(f"{device}: {limb}" for device, limb in limbs))
    run = write_run(tmp_path / "run", poses_of())
    output = str(tmp_path / "sensors.npz")
    typed("inertial", "read", tmp_path / "raw.csv", "-o", output, "--placement", tmp_path / "placement.yaml")
    assert "left_shin" in capsys.readouterr().out
    clock = synchronise(TrackedMotion.load(run), load_sensors(output))
    assert abs(clock.offset - simulated.offset) < 0.01
