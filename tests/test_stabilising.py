"""Stabilised tracks: choice of trajectories, gaps, run folder, rejected inputs."""

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import KNOWN_SIZE, write_people, write_run
from tests.test_inertial_clock import typed
from tests.test_stabilising_priors import BODY, classes_of, example_of
from toolkit.app.stabilise.source_run import open_source
from toolkit.app.stabilise.stabiliser import stabilise
from toolkit.app.stabilise.workflow import output_folders, stabilise_run
from toolkit.body import skeleton
from toolkit.database.canonical import canonicalise
from toolkit.database.database import PoseDatabase, PoseOrigins
from toolkit.evaluation.joint_errors import joint_errors
from toolkit.io.errors import RecordingError, RetrievalError, TrackError, UsageError
from toolkit.mocap.clip import PoseClip
from toolkit.recordings.opening import open_recording
from toolkit.retrieval.annotation.classes import save_classes
from toolkit.retrieval.priors.gap_trajectories import cheapest_path
from toolkit.retrieval.priors.gaps import Gap, widened
from toolkit.retrieval.priors.limb_entries import ENTRIES
from toolkit.simulation.simulate import simulate_recording
from toolkit.tracks import RunInfo, Track

ARM = "right_arm"
FRAMES = 70
WRONG = slice(30, 48)


@pytest.mark.parametrize("seed", range(5))
def test_the_cheapest_path_is_the_best_of_all(seed):
    rng = np.random.default_rng(seed)
    costs, angles = rng.random((3, 6)), rng.normal(size=(3, 6, 2))

    def cost(path: tuple[int, ...]) -> float:
        here = np.arange(6)
        steps = np.diff(angles[list(path), here], axis=0)
        return float(costs[list(path), here].sum() + 0.3 * (steps**2).sum())

    best = min(itertools.product(range(3), repeat=6), key=cost)
    np.testing.assert_array_equal(cheapest_path(costs, angles, 0.3), best)


def test_gaps_grow_and_meet_within_the_track():
    gaps = [Gap("left_arm", 5, 10), Gap("left_arm", 30, 40), Gap("left_leg", 50, 58)]
    assert widened(gaps, 60, 10) == [Gap("left_arm", 0, 50), Gap("left_leg", 40, 60)]
    assert widened(gaps, 60, 0) == gaps


@pytest.fixture(scope="module")
def workdir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording, classes, a database, its run, and a run with a wrong arm for a while."""
    folder = tmp_path_factory.mktemp("stabilising")
    poses = example_of("semaphore", 2, frames=FRAMES).poses
    _save_database(folder / "poses.npz", example_of("knee_to_elbow").poses)
    simulate_recording(
        PoseClip("semaphore", poses, 30.0, "bundled"), folder / "take.npz", furnished=False, distance=2.6
    )
    words = ("--database", folder / "poses.npz", *KNOWN_SIZE, "--online")
    typed("track", folder / "take.npz", *words, "-o", folder / "run")
    save_classes(folder / "classes.npz", classes_of("knee_to_elbow", "semaphore", frames=FRAMES))
    _mislead(folder / "run", folder / "wrong")
    return folder


def _save_database(path: Path, poses: np.ndarray) -> None:
    """Save every third of these poses."""
    canonical = canonicalise(poses[::3])[0]
    count = len(canonical)
    PoseDatabase.of_poses(
        canonical, BODY, PoseOrigins(["bundled"], ["0"], np.zeros(count), np.arange(count), np.zeros(count))
    ).save(path)


def _mislead(run: Path, wrong: Path) -> None:
    """Write the run with its right arm in front of the chest for a while, with low confidence."""
    track, info = Track.load(run), RunInfo.load(run)
    poses, joints, confidence = track.pose.copy(), track.joints.copy(), track.confidence.copy()
    poses[WRONG, ENTRIES[ARM]] = poses[WRONG, ENTRIES[ARM]] + 0.7
    joints[WRONG] = info.body().joint_positions(poses[WRONG]) @ info.R_level_camera
    confidence[WRONG, skeleton.OUTER[ARM]] = 0.3
    wrong.mkdir()
    (wrong / "config.yaml").write_bytes((run / "config.yaml").read_bytes())
    info.save(wrong)
    replace(track, pose=poses, joints=joints, confidence=confidence).save(wrong)


def error_of(run: Path, workdir: Path, joints: np.ndarray | slice = skeleton.OUTER[ARM]) -> float:
    truth = open_recording(workdir / "take.npz").joints
    return float(np.nanmean(joint_errors(Track.load(run).joints, truth)[WRONG][:, joints]))


def test_a_limb_that_was_lost_is_found_again(workdir: Path) -> None:
    output = workdir / "stabilised"
    typed("stabilise", workdir / "wrong", "--classes", workdir / "classes.npz", "--output", output)
    assert error_of(output, workdir) < 0.6 * error_of(workdir / "wrong", workdir)
    before, after = Track.load(workdir / "wrong"), Track.load(output)
    # neck and spine depend on both shoulders: they move with a collar bone
    moving = ("right_shoulder", "neck", "spine")
    others = [j for j, name in enumerate(skeleton.REPORTED) if j not in skeleton.OUTER[ARM] and name not in moving]
    np.testing.assert_allclose(after.joints[:, others], before.joints[:, others], atol=1e-6)
    result = json.loads((output / "stabilise.json").read_text())
    gap = result["gaps"][0]
    assert gap["limb"] == ARM and gap["accepted"] and gap["residual_after"] <= gap["residual_before"]
    assert {"segments.csv", "annotation.png", "report.html"} <= {p.name for p in output.iterdir()}
    typed("evaluate", output)
    again = ("--database", workdir / "poses.npz", *KNOWN_SIZE, "--online", "--resume")
    typed("track", workdir / "take.npz", *again, "-o", output)
    np.testing.assert_array_equal(Track.load(output).joints, after.joints)


def test_without_a_gap_nothing_changes(workdir: Path) -> None:
    source = open_source(workdir / "run")
    sure = replace(source, track=replace(source.track, confidence=np.ones_like(source.track.confidence)))
    only = stabilise(sure, classes_of("semaphore"))
    assert only.track is sure.track and only.gaps == ()


def test_given_segments_take_the_place_of_labels(workdir: Path) -> None:
    (workdir / "segments.csv").write_text("start,end,label\n0.0,2.3,semaphore\n")
    result = stabilise_run(
        workdir / "wrong", workdir / "classes.npz", workdir / "given", segments=workdir / "segments.csv"
    )
    assert result.annotation is None and [s.label for s in result.segments] == ["semaphore"]
    assert error_of(workdir / "given", workdir) < error_of(workdir / "wrong", workdir)


@pytest.mark.parametrize(
    ("lines", "match"),
    [
        ("0.0,2.0,semaphore\n1.5,2.3,semaphore", "overlaps the one that ends at 2 s"),
        ("0.0,9.0,semaphore", "ends after the track, which has 2.30 s"),
        ("2.0,1.0,semaphore", "has no length"),
        ("0.0,1.0,jump", "has an unknown label; the classes are knee_to_elbow, semaphore"),
    ],
)
def test_segments_that_cannot_be_are_refused(workdir: Path, tmp_path: Path, lines: str, match: str) -> None:
    (tmp_path / "segments.csv").write_text(f"start,end,label\n{lines}\n")
    with pytest.raises(RetrievalError, match=match):
        stabilise_run(workdir / "run", workdir / "classes.npz", tmp_path / "out", segments=tmp_path / "segments.csv")


def test_classes_without_motions_serve_repetitions(workdir: Path, tmp_path: Path) -> None:
    save_classes(tmp_path / "plain.npz", [replace(c, motion=None) for c in classes_of("semaphore")])
    typed("stabilise", workdir / "run", "--classes", tmp_path / "plain.npz", "-o", tmp_path / "out")
    assert len(Track.load(tmp_path / "out")) == FRAMES


def test_without_a_hit_the_track_comes_out_as_it_was(workdir: Path, tmp_path: Path) -> None:
    save_classes(tmp_path / "other.npz", classes_of("knee_to_elbow"))
    result = stabilise_run(workdir / "wrong", tmp_path / "other.npz", tmp_path / "out", threshold=1e-6)
    assert result.segments == ()
    before, after = Track.load(workdir / "wrong"), Track.load(tmp_path / "out")
    np.testing.assert_array_equal(after.joints, before.joints)
    np.testing.assert_array_equal(after.pose, before.pose)


def test_what_cannot_be_stabilised_is_refused(workdir: Path, tmp_path: Path) -> None:
    with pytest.raises(TrackError, match=r"holds no track\.npz"):
        stabilise_run(tmp_path, workdir / "classes.npz", tmp_path / "out")
    with pytest.raises(UsageError, match="would be overwritten"):
        stabilise_run(workdir / "run", workdir / "classes.npz", workdir / "run")
    people = write_people(tmp_path / "people", np.zeros((4, skeleton.POSE_SIZE)))
    with pytest.raises(UsageError, match="one of several people's runs"):
        open_source(people / "person_01")
    other = write_run(tmp_path / "other", np.zeros((4, skeleton.POSE_SIZE)))
    with pytest.raises(TrackError, match=r"holds no config\.yaml"):
        open_source(other)
    replace(RunInfo.load(other), tracker="swarm").save(other)
    with pytest.raises(UsageError, match="tracker 'swarm'; stabilise needs the hybrid one"):
        open_source(other)


def test_a_recording_that_was_moved_has_to_be_named(workdir: Path, tmp_path: Path) -> None:
    moved = tmp_path / "run"
    moved.mkdir()
    for name in ("track.npz", "config.yaml"):
        (moved / name).write_bytes((workdir / "run" / name).read_bytes())
    info = RunInfo.load(workdir / "run")
    replace(info, recording=str(tmp_path / "gone.npz"), folder="").save(moved)
    with pytest.raises(RecordingError, match="is gone; put it back there, or name it with --recording"):
        open_source(moved)
    assert len(open_source(moved, recording=workdir / "take.npz").track) == FRAMES


def test_several_runs_go_to_folders_of_their_names(tmp_path: Path) -> None:
    runs = [tmp_path / "a", tmp_path / "b"]
    assert output_folders(runs, tmp_path / "out") == {run: tmp_path / "out" / run.name for run in runs}
    with pytest.raises(UsageError, match="two runs are called 'a'"):
        output_folders([tmp_path / "a", tmp_path / "c" / "a"], tmp_path / "out")


def test_the_result_file_has_the_contacts_and_the_floor(workdir: Path, tmp_path: Path) -> None:
    typed("stabilise", workdir / "wrong", "--classes", workdir / "classes.npz", "--output", tmp_path / "out")
    result = json.loads((tmp_path / "out" / "stabilise.json").read_text())
    assert result["contact_frames"] == 0, "only an arm is occluded"
    assert result["floor"]["source"] == "soles"
    assert len(Track.load(tmp_path / "out")) == len(Track.load(workdir / "wrong"))
