"""The swarm tracker: depth and image joints, no motion capture."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.database_helpers import small_database
from tests.poses import entry
from tests.support.image_joints import DetectorErrors, detected
from tests.support.solo import Solo
from tests.support.subjects import LEVEL, camera_for, draw, moving_poses
from toolkit.app.config import load_settings
from toolkit.app.pipeline.image_joints import JointChoice, joint_source
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.checkpoint import load_checkpoint, restore, save_checkpoint
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.joints2d import Joints2D
from toolkit.sensing.recording import Recording
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.trackers.qammaz.swarm import SwarmSettings
from toolkit.trackers.qammaz.tracker import SwarmTracker, SwarmTrackerSettings
from toolkit.tracking.clock import StageClock
from toolkit.tracks import EMPTY, TRACKED, FrameResult

BODY = load_body("neutral")
CAMERA = camera_for(3000)
SETTINGS = SwarmTrackerSettings(swarm=SwarmSettings(particles=24, generations=16))
FRAMES = 24
EXACT = DetectorErrors(sigma=0.0, missed=0.0, swapped=0.0)


def true_joints(poses: np.ndarray) -> np.ndarray:
    """Return true joints, camera frame, metres."""
    return BODY.joint_positions(poses) @ LEVEL


def write(path: Path, poses: np.ndarray, rows: np.ndarray | None) -> Recording:
    rng = np.random.default_rng(0)
    frames = (np.rint(1000 * draw(BODY, pose, CAMERA, rng)).astype(np.uint16) for pose in poses)
    save_recording(
        path, depth=frames, camera=CAMERA, timestamps=np.arange(len(poses)) / 30.0,
        joints=true_joints(poses).astype(np.float32), joints_2d=rows,
    )  # fmt: skip
    return open_recording(path)


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    return moving_poses(FRAMES, np.random.default_rng(4))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory, poses: np.ndarray) -> Recording:
    rows = detected(true_joints(poses), CAMERA, np.random.default_rng(1), DetectorErrors(swapped=0.0))
    return write(tmp_path_factory.mktemp("swarm") / "take.npz", poses, rows)


def tracker(settings: SwarmTrackerSettings = SETTINGS) -> SwarmTracker:
    return SwarmTracker(settings, body=BODY)


def run(
    recording: Recording, joints: Sequence[Joints2D | None] | None = None, settings: SwarmTrackerSettings = SETTINGS
) -> list[FrameResult]:
    """Track the whole recording, with given image joints if any."""
    solo = Solo(tracker(settings), recording)
    results = []
    for i in range(len(recording)):
        seen = recording.joints_2d(i) if joints is None else () if joints[i] is None else (joints[i],)
        results.append(solo.step(recording.depth(i), float(recording.timestamps[i]), seen))
    return results


def errors(results: list[FrameResult], recording: Recording) -> np.ndarray:
    """Return the mean error of each frame, metres."""
    return np.linalg.norm(np.array([r.joints for r in results]) - recording.joints[: len(results)], axis=2).mean(axis=1)


def digest(results: list[FrameResult]) -> str:
    parts = [part for r in results for part in (r.pose, r.joints, r.confidence, np.array([r.state, r.source]))]
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()


@pytest.fixture(scope="module")
def results(recording: Recording) -> list[FrameResult]:
    return run(recording)


def test_a_person_is_found_and_followed_without_a_database(results: list[FrameResult], recording: Recording) -> None:
    assert errors(results, recording).mean() < 0.045
    assert all(r.state == TRACKED for r in results)
    assert tracker().database == "" and tracker().joints_wanted == "required"


def test_qammaz_takes_joints_as_they_are_given(recording: Recording, poses: np.ndarray) -> None:
    """Exchanged sides: the default decides by the depth, the paper's tracker follows the joints."""
    rows = detected(true_joints(poses[:1]), CAMERA, np.random.default_rng(1), EXACT)
    swapped = Joints2D.of_rows(rows[0][list(skeleton.OTHER_SIDE)])
    left, right = (skeleton.REPORTED.index(f"{side}_shoulder") for side in ("left", "right"))
    given = replace(SETTINGS.search, sides=None, pulled=0, refined=0, disagreement=0.0)
    for search, expected in ((SETTINGS.search, left), (given, right)):
        solo = Solo(tracker(replace(SETTINGS, search=search)), recording)
        found = solo.step(recording.depth(0), 0.0, (swapped,)).joints[left]
        gaps = np.linalg.norm(true_joints(poses[:1])[0][[left, right]] - found, axis=1)
        assert (left, right)[int(gaps.argmin())] == expected


def test_a_state_on_disk_continues_exactly(results: list[FrameResult], recording: Recording, tmp_path: Path) -> None:
    solo = Solo(tracker(), recording)
    for i in range(6):
        solo.step(recording.depth(i), float(recording.timestamps[i]), recording.joints_2d(i))
    save_checkpoint(tmp_path / "state.npz", "person", solo.follower)
    other = Solo(tracker(), recording)
    restore(other.follower, load_checkpoint(tmp_path / "state.npz", "person"), "person")
    rest = [
        other.step(recording.depth(i), float(recording.timestamps[i]), recording.joints_2d(i)) for i in range(6, FRAMES)
    ]
    assert digest(rest) == digest(results[6:])


def turned(pose: np.ndarray, degrees: float) -> np.ndarray:
    pose = pose.copy()
    pose[skeleton.ROOT_ROTATION] = [0.0, np.radians(degrees), 0.0]
    return pose


def test_poses_are_found_from_nothing_whichever_way_the_person_faces(tmp_path: Path) -> None:
    """True body, exact joints; backs and sides included, arms and legs bent."""
    rng = np.random.default_rng(0)
    chosen = moving_poses(400, rng)[::40]
    chosen = np.array([turned(pose, degrees) for pose, degrees in zip(chosen, np.arange(0, 360, 36), strict=True)])
    recording = write(tmp_path / "poses.npz", chosen, detected(true_joints(chosen), CAMERA, rng, EXACT))
    found = []
    for i in range(len(chosen)):
        solo = Solo(tracker(SwarmTrackerSettings()), recording)
        found.append(solo.step(recording.depth(i), 0.0, recording.joints_2d(i)))
    assert np.median(errors(found, recording)) < 0.04
    assert (errors(found, recording) < 0.12).sum() >= 9


def other_side(joints: Joints2D) -> Joints2D:
    rows = list(skeleton.OTHER_SIDE)
    return Joints2D(joints.pixels[rows], joints.confidence[rows])


def test_sides_that_are_exchanged_for_some_frames_are_found_out(recording: Recording) -> None:
    joints = [recording.joints_2d(i)[0] for i in range(FRAMES)]
    joints[8:12] = [other_side(j) for j in joints[8:12]]
    assert errors(run(recording, joints), recording).max() < 0.12


def test_sides_that_are_exchanged_in_the_whole_take_are_put_right_by_the_depth(recording: Recording) -> None:
    joints = [other_side(recording.joints_2d(i)[0]) for i in range(FRAMES)]
    found = errors(run(recording, joints, SwarmTrackerSettings()), recording)
    assert found.mean() < 0.06 and found.max() < 0.15


def test_a_person_is_tracked_where_nothing_else_was_observed(recording: Recording) -> None:
    """A person with no measured surroundings is tracked."""
    finder = SinglePersonSegmenter(recording.camera, None, SETTINGS.sensing, recording.up_camera)
    found = []
    for unknown in (False, True):
        solo = Solo(tracker(), recording)
        (seen,) = finder.find(recording.depth(0), 0.0, {})
        unobserved = seen.depth == 0 if unknown else np.zeros(seen.depth.shape, dtype=bool)
        sighting = replace(seen, unobserved=unobserved, joints=recording.joints_2d(0)[0])
        found.append(solo.follower.step(sighting, 0.0, StageClock(tracker().stage_names)))
    assert [f.state for f in found] == [TRACKED, TRACKED]
    assert errors([found[1]], recording)[0] < 0.12


def test_without_any_joints_a_person_is_followed_by_the_depth_alone(recording: Recording) -> None:
    results = run(recording, [recording.joints_2d(0)[0], *[None] * (FRAMES - 1)])
    assert errors(results, recording).mean() < 0.08


def test_no_or_few_pixels_are_empty_and_a_returning_person_is_found(recording: Recording) -> None:
    solo = Solo(tracker(), recording)
    depths = [recording.depth(i) for i in range(6)]
    few = np.zeros_like(depths[0])
    few[40:45, 50:60] = 2500
    frames = [np.zeros_like(few), depths[0], few, np.zeros_like(few), depths[4], depths[5]]
    found = [solo.step(depth, i / 30.0, recording.joints_2d(i)) for i, depth in enumerate(frames)]
    assert [r.state for r in found] == [EMPTY, TRACKED, EMPTY, EMPTY, TRACKED, TRACKED]
    assert errors(found[4:], recording).shape == (2,) and all(np.isfinite(r.joints).all() for r in found)
    assert np.linalg.norm(found[5].joints - recording.joints[5], axis=1).mean() < 0.08


def test_a_mirrored_person_is_tracked_in_the_mirror(
    results: list[FrameResult], recording: Recording, tmp_path: Path
) -> None:
    rows = np.array([recording.joints_2d(i)[0].rows for i in range(FRAMES)])[:, list(skeleton.OTHER_SIDE)]
    rows[..., 0] = CAMERA.width - 1 - rows[..., 0]
    truth = recording.joints[:, list(skeleton.OTHER_SIDE)] * [-1, 1, 1]
    path = tmp_path / "mirrored.npz"
    save_recording(
        path, depth=(recording.depth(i)[:, ::-1].copy() for i in range(FRAMES)), camera=CAMERA.mirrored(),
        timestamps=recording.timestamps, joints=truth.astype(np.float32), joints_2d=rows,
    )  # fmt: skip
    mirrored = open_recording(path)
    back = np.array([r.joints for r in run(mirrored)])[:, list(skeleton.OTHER_SIDE)] * [-1, 1, 1]
    apart = np.linalg.norm(back - np.array([r.joints for r in results]), axis=2)
    assert np.median(apart) < 0.02


def test_the_body_is_learnt_from_the_recording(recording: Recording) -> None:
    settings = replace(SETTINGS, sizes=(0.4, 1.5), shape=replace(SETTINGS.shape, seconds=0.3))
    solo = Solo(SwarmTracker(settings), recording)
    found = [solo.step(recording.depth(i), i / 30.0, recording.joints_2d(i)) for i in range(8)]
    assert abs(solo.body.height - BODY.height) < 0.1
    assert errors(found, recording).mean() < 0.06


def test_the_papers_variant_has_its_dimensions_and_limits() -> None:
    settings = load_settings(SwarmTrackerSettings, "qammaz")
    assert settings.hypotheses == ("swarm",)
    assert (settings.swarm.particles, settings.swarm.generations) == (64, 64)
    assert settings.search.pulled == settings.search.refined == 0 and settings.search.disagreement == 0.0
    low, high = settings.search.pose_limits().T
    # The paper: position 3, quaternion 4, angles 29. Ours rotates the root by the three numbers of a rotation vector.
    assert np.count_nonzero(high > low) == 35
    joints = [j for j in skeleton.JOINT_NAMES[1:] if j not in settings.search.frozen]
    assert len(joints) == 14
    for (joint, axes), rows in TABLE_1.items():
        for side, row in zip(("left_", "right_") if len(rows) == 2 else ("",), rows, strict=True):
            for axis, (lowest, highest) in zip(axes, row, strict=True):
                k = entry(f"{side}{joint}_{axis}")
                assert (low[k], high[k]) == (lowest, highest), skeleton.POSE_NAMES[k]


TABLE_1: dict[tuple[str, tuple[str, ...]], tuple[tuple[tuple[float, float], ...], ...]] = {
    ("cervical", ("rz", "rx", "ry")): (((-0.4, 0.4), (-0.3, 0.3), (0, 0)),),
    ("lumbar", ("rz", "rx", "ry")): (((-0.5, 0.5), (-0.2, 0.5), (-1.5, 1.5)),),
    ("clavicle", ("rz", "ry")): (((-0.1, 0.1), (-0.15, 0.1)), ((-0.1, 0.1), (-0.1, 0.15))),
    ("shoulder", ("rx", "rz", "ry")): (
        ((-4, 4), (-1.8, 1.57), (-2, 1.4)),
        ((-4, 4), (-1.57, 1.8), (-1.4, 2)),  # the paper's pitch is of either arm upwards, our rz of the right one down
    ),
    ("elbow", ("ry",)): (((-2.5, 0),), ((0, 2.5),)),
    # Ours flexes legs the other way round: a pitch of -0.78 to 2 is -2 to 0.78, a yaw of -1.2 to 0.5 is -0.5 to 1.2.
    ("hip", ("ry", "rx", "rz")): (
        ((-1.57, 1.57), (-2, 0.78), (-0.5, 1.2)), ((-1.57, 1.57), (-2, 0.78), (-1.2, 0.5)),
    ),
    ("knee", ("rx",)): (((-0.1, 2.8),), ((-0.1, 2.8),)),
    ("ankle", ("rx", "rz")): (((-0.6, 0.6), (-0.7, 0.7)), ((-0.6, 0.6), (-0.7, 0.7))),
}  # fmt: skip
"""Qammaz, Table 1, radians: roll, pitch and yaw of a joint, or those that it has, by the axes of ours they are about;
of the right side the second row. "-0.6 to -0.6" of the ankle is read as -0.6 to 0.6."""


@pytest.mark.parametrize(
    ("moved", "by", "joint", "axis", "sign"),
    [
        ("left_knee_rx", 1.0, "left_ankle", 2, -1),  # a knee bends the shin backwards
        ("right_hip_rx", -1.0, "right_knee", 2, 1),  # a hip bends the thigh forwards
        ("left_hip_rz", 0.8, "left_knee", 0, 1),  # and spreads it to the subject's left
        ("right_hip_rz", -0.8, "right_knee", 0, -1),
        ("left_elbow_ry", -1.0, "left_wrist", 2, 1),  # elbows bend forwards
        ("right_elbow_ry", 1.0, "right_wrist", 2, 1),
        ("lumbar_rx", 0.4, "neck", 2, 1),  # the spine bends forwards
        ("left_shoulder_rz", -1.5, "left_wrist", 1, -1),  # arms hang down
        ("right_shoulder_rz", 1.5, "right_wrist", 1, -1),
    ],
)
def test_the_papers_limits_allow_what_people_do(moved: str, by: float, joint: str, axis: int, sign: int) -> None:
    limits = load_settings(SwarmTrackerSettings, "qammaz").search.pose_limits()
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[entry(moved)] = by
    assert limits[entry(moved), 0] <= by <= limits[entry(moved), 1]
    row = skeleton.REPORTED.index(joint)
    there, rest = (BODY.joint_positions(p)[row, axis] for p in (pose, np.zeros(skeleton.POSE_SIZE)))
    assert sign * (there - rest) > 0.05


def test_the_hybrid_tracker_uses_a_swarm_in_first_frames_with_joints(recording: Recording) -> None:
    database = small_database()

    def first(hypotheses: tuple[str, ...], joints: tuple[Joints2D, ...]) -> list[FrameResult]:
        solo = Solo(HybridTracker(database, HybridSettings(hypotheses=hypotheses), body=BODY), recording)
        return [solo.step(recording.depth(i), i / 30.0, joints) for i in range(2)]

    asked, seen = ("local", "extrema", "swarm"), recording.joints_2d(0)
    with_joints, without = first(asked, seen), first(asked, ())
    assert digest(without) == digest(first(("local", "extrema"), seen))
    assert errors(with_joints, recording).mean() < 0.06
    assert errors(with_joints, recording)[0] <= errors(without, recording)[0] + 0.02


def test_joints_are_offered_to_the_hybrid_tracker_and_not_detected_for_it(recording: Recording) -> None:
    database = small_database()
    assert HybridTracker(database).joints_wanted == "offered"
    assert HybridTracker(database, HybridSettings(hypotheses=("local", "extrema"))).joints_wanted == "none"
    assert joint_source(recording, JointChoice(), "offered").name == "given"
    assert joint_source(recording, JointChoice("none"), "offered").name == "none"
    bare = SimpleNamespace(image_joints=None)
    assert joint_source(bare, JointChoice(), "offered").name == "none"  # type: ignore[arg-type]
