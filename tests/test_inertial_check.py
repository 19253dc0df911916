"""Checking a track: distances, errors, known errors, the report, and the verbs as typed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.inertial import signals_of
from tests.inertial_scenes import FIVE, RATE, motion_of, poses_of, sensors_of, write_run
from tests.run_helpers import run as run_command
from tests.test_inertial_clock import typed
from toolkit.body import skeleton
from toolkit.evaluation.orientations import TWIST, Distances, check_runs, distances, errors_of, read_truth, runs_above
from toolkit.inertial.calibrate import CalibrationSequence, calibrate
from toolkit.inertial.synchronise import Clock
from toolkit.inertial.workflow import calibrate_runs
from toolkit.io.errors import InertialError

ELBOW = skeleton.POSE_NAMES.index("left_shoulder_rz")


def wrong_poses(start: float = 2.0, end: float = 3.2, by: float = 1.4, entry: int = ELBOW) -> np.ndarray:
    """Return the motion with one entry wrong for a while."""
    poses = poses_of().copy()
    poses[round(start * RATE) : round(end * RATE), entry] += by
    return poses


def curve(values) -> Distances:
    times = np.arange(len(values)) / RATE
    return Distances("left_shin", times, np.array(values, float), np.zeros(len(values)))


def test_the_signals_of_a_sensor_on_a_right_track_are_those_of_the_track():
    simulated = sensors_of()
    take = CalibrationSequence(motion_of(), simulated.sensors, Clock(simulated.offset))
    found = calibrate([take])
    for limb in ("left_shin", "right_forearm"):
        for name, (sensor, track) in signals_of(take, found, limb).items():
            assert np.nanmedian(np.abs(sensor - track)) < 0.3 * max(1.0, np.median(np.abs(track))), name
    late = replace(take, clock=Clock(simulated.offset + 2.0))
    sensor, _ = signals_of(late, found, "left_shin")["rate of turn"]
    assert np.isnan(sensor[-1]).all() and not np.isnan(sensor[0]).any(), "what was not measured is not known"


def test_errors_have_hysteresis_and_short_ones_do_not_count():
    values = [0, 40, 50, 40, 40, 50, 37, 30, 0, 90, 0, 0, 0, 0, 0, 60, 60, np.nan, 60, 60, 0]
    runs = runs_above(np.array(values, float), np.arange(len(values)) / RATE, 45.0)
    assert runs == [(1, 9), (15, 19)], "gaps below a tenth of a second are closed, unknown frames among them"
    assert runs_above(np.array([0, 90, 90, 0.0]), np.arange(4) / RATE, 45.0) == []
    assert runs_above(np.array([38.0] * 30), np.arange(30) / RATE, 45.0) == []
    assert runs_above(np.array([90.0] * 30), np.arange(30) / RATE, 45.0) == [(0, 29)]


def test_a_stretch_whose_bone_points_right_is_a_twist():
    found = curve([0] * 5 + [80] * 10 + [0] * 5)
    assert [error.kind for error in errors_of(found)] == [TWIST]
    apart = replace(found, axis=np.where(found.full > 0, 60.0, 0.0))
    (error,) = errors_of(apart)
    assert (error.kind, error.peak, error.mean) == ("error", 80.0, 80.0)
    assert (error.start, error.end) == pytest.approx((5 / RATE, 14 / RATE))


def test_a_twist_of_the_forearm_is_none_of_its_axis():
    simulated = sensors_of(limbs=("left_forearm", "right_forearm"))
    motion = motion_of()
    rotations = motion.rotations.copy()
    elbow = skeleton.JOINT_NAMES.index("left_elbow")
    rotations[60:100, elbow] = rotations[60:100, elbow] @ Rotation.from_rotvec([1.2, 0, 0]).as_matrix()
    take = CalibrationSequence(replace(motion, rotations=rotations), simulated.sensors, Clock(simulated.offset))
    found = distances(calibrate([take]), take)[0]
    assert np.nanmedian(found.full[60:100]) > 55
    assert np.nanmedian(found.axis[60:100]) < 8
    assert {error.kind for error in errors_of(found)} == {TWIST}


def test_an_injected_error_is_found_at_the_right_limb_and_time(tmp_path):
    simulated = sensors_of(noise="mtx", seed=3)
    run = write_run(tmp_path / "run", wrong_poses())
    simulated.sensors.save(tmp_path / "sensors.npz")
    (tmp_path / "truth.csv").write_text("limb,start,end\nleft_forearm,2.0,3.2\n")
    (check,) = check_runs([run], [tmp_path / "sensors.npz"], truth=tmp_path / "truth.csv")
    assert {error.limb for error in check.errors} == {"left_forearm"}
    scores = check.scores()
    assert scores["segments"].f == 1.0
    assert scores["frames"].precision > 0.9
    assert scores["frames"].recall > 0.9
    assert len(check.over_thresholds()) == 17


def test_a_run_is_checked_with_the_calibration_of_another(tmp_path):
    simulated = sensors_of(noise="mtx", seed=3)
    good = write_run(tmp_path / "good", poses_of())
    bad = write_run(tmp_path / "bad", wrong_poses())
    calibration = calibrate_runs([good], [simulated.sensors])
    (check,) = check_runs([bad], [simulated.sensors], calibration=calibration)
    assert [error.limb for error in check.errors] == ["left_forearm"]


@pytest.mark.parametrize("heading", ("own", "shared"))
def test_sensors_without_north_find_their_heading_in_every_run(tmp_path, heading):
    from toolkit.inertial.calibrate import CalibrationSettings

    simulated = sensors_of(noise="mtx", seed=3, limbs=("left_forearm", "right_forearm"))
    calibration = calibrate_runs(
        [write_run(tmp_path / "good", poses_of())], [simulated.sensors], settings=CalibrationSettings(heading=heading)
    )
    turn = Rotation.from_rotvec([0, 0, 1.0])
    streams = [replace(s, rotations=turn * s.rotations) for s in simulated.sensors]
    turned = replace(simulated.sensors, streams=tuple(streams))
    (check,) = check_runs([write_run(tmp_path / "bad", wrong_poses())], [turned], calibration=calibration)
    assert (max(np.nanmedian(d.full) for d in check.distances) < 8.0) == (heading == "own")


@pytest.mark.parametrize(
    ("text", "message"),
    (
        ("limb,start,end\nleft_tail,0,1\n", "'left_tail' from 0 to 1 s is no error"),
        ("limb,start,end\nleft_shin,2,1\n", "from 2 to 1 s is no error"),
        ("limb,from,to\nleft_shin,0,1\n", "expected limb, start and end"),
    ),
)
def test_known_errors_that_cannot_be_are_refused(tmp_path, text, message):
    (tmp_path / "truth.csv").write_text(text)
    with pytest.raises(InertialError, match=message):
        read_truth(tmp_path / "truth.csv")


def test_the_verbs_calibrate_and_check_as_typed(tmp_path, capsys):
    simulated = sensors_of(noise="mtx", seed=3, limbs=FIVE[2:4])
    sensors = tmp_path / "sensors.npz"
    simulated.sensors.save(sensors)
    good, bad = write_run(tmp_path / "good", poses_of()), write_run(tmp_path / "bad", wrong_poses())
    (tmp_path / "truth.csv").write_text("limb,start,end\nleft_forearm,2.0,3.2\n")
    calibration = tmp_path / "calibration.json"
    typed("inertial", "calibrate", good, "--sensors", sensors, "-o", calibration)
    assert "good" in capsys.readouterr().out
    report = tmp_path / "report"
    words = ("--sensors", sensors, "--calibration", calibration, "-o", report, "--truth", tmp_path / "truth.csv")
    typed("inertial", "check", bad, *words)
    assert "left_forearm" in capsys.readouterr().out
    assert sorted(path.name for path in report.iterdir()) == [
        "distances.csv", "distances.png", "errors.csv", "report.html",
    ]  # fmt: skip
    assert [line.split(",")[0] for line in (report / "errors.csv").read_text().splitlines()] == ["limb", "left_forearm"]


def test_wrong_use_of_the_verbs_ends_with_code_two(tmp_path, capsys):
    run = write_run(tmp_path / "run", poses_of())
    sensors_of().sensors.save(tmp_path / "sensors.npz")
    assert (
        run_command("inertial", "check", run, "--sensors", tmp_path / "sensors.npz", "--threshold", "0", "-o", "x") == 2
    )
    assert "detects nothing" in capsys.readouterr().err
    assert run_command("inertial", "check", tmp_path / "no", "--sensors", tmp_path / "sensors.npz", "-o", "x") == 1
