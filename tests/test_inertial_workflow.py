"""Inertial workflow at the command line: simulate with sensors, track, calibrate, check, and track with the sensors as
guide.
"""

from pathlib import Path

import numpy as np
import pytest

from tests.inertial_scenes import RATE, poses_of
from tests.run_helpers import KNOWN_SIZE
from tests.support.worn_sensors import simulate_sensors
from tests.test_inertial_clock import typed
from toolkit.body import skeleton
from toolkit.evaluation.joint_errors import joint_errors
from toolkit.evaluation.orientations import check_runs
from toolkit.inertial.calibration import Calibration
from toolkit.inertial.workflow import take_of
from toolkit.io.errors import InertialError
from toolkit.mocap.clip import PoseClip
from toolkit.recordings.opening import open_recording
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, prepare, simulate_scene
from toolkit.tracks import RunInfo, Track

LIMBS = ("left_forearm", "right_forearm", "pelvis")


@pytest.fixture(scope="module")
def workdir(bundled_database: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording, its sensors and the run."""
    folder = tmp_path_factory.mktemp("inertial")
    clip = PoseClip("semaphore", poses_of("semaphore")[:110], RATE, "bundled")
    person, shot = SimulatedPerson(clip), CaptureSettings(furnished=False, distance=2.6)
    simulate_scene([person], folder / "take.npz", shot)
    (wearer,) = prepare([person], shot).performers
    simulate_sensors(wearer.body, wearer.poses, RATE, LIMBS).sensors.save(folder / "take_sensors.npz")
    words = ("--database", bundled_database, *KNOWN_SIZE)
    typed("track", folder / "take.npz", *words, "--online", "--output", folder / "run")
    return folder


def test_an_injected_error_is_found_in_a_real_track(workdir: Path) -> None:
    sensors, calibration = workdir / "take_sensors.npz", workdir / "calibration.json"
    typed("inertial", "calibrate", workdir / "run", "--sensors", sensors, "--output", calibration)
    assert {s.status for s in Calibration.load(calibration).sensors.values()} == {"good"}
    track = Track.load(workdir / "run")
    poses = track.pose.copy()
    poses[50:80, skeleton.POSE_NAMES.index("right_shoulder_rz")] += 1.3
    wrong = workdir / "wrong"
    wrong.mkdir()
    RunInfo.load(workdir / "run").save(wrong)
    Track(**{**vars(track), "pose": poses}).save(wrong)
    (before,), (after,) = (check_runs([run], [sensors], calibration=calibration) for run in (workdir / "run", wrong))
    found = [e for e in after.errors if e not in before.errors and e.limb == "right_forearm"]
    assert any(e.start < 60 / RATE < e.end for e in found)


def test_the_sensors_guide_the_tracker_and_do_not_check_it_then(workdir: Path, bundled_database: Path) -> None:
    sensors, calibration, guided = workdir / "take_sensors.npz", workdir / "calibration.json", workdir / "guided"
    typed("inertial", "calibrate", workdir / "run", "--sensors", sensors, "--output", calibration)
    words = ("--database", bundled_database, *KNOWN_SIZE)
    guide = ("--inertial", sensors, "--calibration", calibration)
    typed("track", workdir / "take.npz", *words, *guide, "--online", "--output", guided)
    truth = open_recording(workdir / "take.npz").joints
    plain, better = (np.nanmean(joint_errors(Track.load(run).joints, truth)) for run in (workdir / "run", guided))
    assert better < plain + 0.005
    with pytest.raises(InertialError, match="with these sensors"):
        take_of(guided, sensors)
