"""From bundled motions to the table of real recordings, at the command line."""

from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import run as run_command
from toolkit.body.skeleton import REPORTED
from toolkit.evaluation.evaluate import evaluate_runs
from toolkit.tracks import TRACKED, RunInfo, Track

pytestmark = pytest.mark.data("utd-mhad")

NAMES = ("a1_s1_t1_depth", "a3_s3_t1_depth")


@pytest.fixture(scope="module")
def runs(cut_recordings: Path, bundled_database: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return run folders of two real recordings, tracked with a database of neither their mocap nor depth."""
    folder = tmp_path_factory.mktemp("workflow")
    recordings = [str(cut_recordings / f"{name}.mat") for name in NAMES]
    assert run_command("track", *recordings, "--database", bundled_database, "--output", folder / "runs") == 0
    return folder / "runs"


def test_every_frame_of_a_real_recording_has_a_row(runs: Path) -> None:
    for name in NAMES:
        track = Track.load(runs / name)
        assert len(track) == len(RunInfo.load(runs / name).open_recording())
        assert (track.state == TRACKED).mean() > 0.9


def test_the_subject_faces_the_camera_with_the_left_hand_at_positive_x(runs: Path) -> None:
    for name in NAMES:
        joints = Track.load(runs / name).joints
        for part in ("shoulder", "hip", "foot"):
            left, right = (joints[:, REPORTED.index(f"{side}_{part}"), 0] for side in ("left", "right"))
            assert np.median(left - right) > 0.1
        ankle, foot = (joints[:, REPORTED.index(f"left_{part}"), 2] for part in ("ankle", "foot"))
        assert np.median(ankle - foot) > 0.03  # toes towards the camera


def test_one_table_compares_real_recordings_with_the_sdk_of_their_folder(runs: Path, cut_recordings: Path) -> None:
    table = evaluate_runs([runs], [cut_recordings])
    assert [row.recording for row in table] == list(NAMES)
    mean = table.mean()
    assert mean.error_mm is None  # another system's estimate is not truth
    assert mean.agreement is not None and mean.agreement > 0.6
    assert mean.agreement_offsets is not None and mean.agreement_offsets > 0.6
    assert mean.overlap is not None and mean.overlap > 0.7
    assert mean.residual_mm is not None and mean.residual_mm < 30
