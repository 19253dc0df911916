"""The hybrid tracker on short simulated recordings (Baak 2013, 5.4)."""

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.poses import entry
from tests.support.misled import misled
from tests.support.solo import Solo
from toolkit.body import skeleton
from toolkit.body.shape import load_body, subject_body
from toolkit.database import canonical
from toolkit.database.database import PoseDatabase, PoseOrigins
from toolkit.fitting.shape import ShapeSettings
from toolkit.io.checkpoint import load_checkpoint, restore, save_checkpoint
from toolkit.io.errors import SettingsError
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import perform, procedural_clips
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.recording import Recording
from toolkit.simulation.simulate import simulate_recording
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracking.live_people import LivePeople
from toolkit.tracking.multi_person import MultiPersonTracker
from toolkit.tracks import EMPTY, LOST, TRACKED, FrameResult

MOTIONS = ("idle", "raise_sideways", "raise_forward", "arm_circles", "march", "wave", "twist")
SETTINGS = HybridSettings(hypotheses=("local", "extrema", "arms"))
SOURCES = ("local", "extrema", "joints", "arms", "predicted")
STAGES = ("prepare", "landmarks", "local", "arms", "lookup", "select")
FRAMES = 20

Record = Callable[..., Recording]


def run(tracker: HybridTracker, recording: Recording, stop: int | None = None) -> list[FrameResult]:
    return steps(Solo(tracker, recording), recording, range(stop or len(recording)))


def steps(solo: Solo, recording: Recording, frames: Iterable[int]) -> list[FrameResult]:
    return [solo.step(recording.depth(i), float(recording.timestamps[i])) for i in frames]


def joints_of(results: list[FrameResult]) -> np.ndarray:
    return np.stack([result.joints for result in results])


def errors(results: list[FrameResult], recording: Recording) -> np.ndarray:
    """Return distances (T, 20) of the joints to the true ones, metres."""
    return np.linalg.norm(joints_of(results) - recording.joints[: len(results)], axis=2)


def digest(results: list[FrameResult]) -> str:
    """Return a digest of a track without its times."""
    found = hashlib.sha256()
    for r in results:
        for array in (r.pose, r.joints, r.confidence, np.array([r.state, r.source])):
            found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def check_sound(results: list[FrameResult]) -> None:
    """Check that a result is finite, in its range and within the joint limits."""
    low, high = skeleton.POSE_LIMITS.T
    for r in results:
        assert r.pose.shape == (skeleton.POSE_SIZE,) and r.joints.shape == (20, 3) and r.confidence.shape == (20,)
        assert np.isfinite(r.pose).all() and np.isfinite(r.joints).all()
        assert (r.pose >= low - 1e-9).all() and (r.pose <= high + 1e-9).all()
        assert ((r.confidence >= 0) & (r.confidence <= 1)).all()
        assert r.state in (TRACKED, LOST, EMPTY) and 0 <= r.source < len(SOURCES)
        assert r.stage_ms.shape == (len(STAGES),) and (r.stage_ms >= 0).all()


@pytest.fixture(scope="module")
def database() -> PoseDatabase:
    """Return a few hundred poses of seven motions and their mirror images."""
    poses = np.concatenate([clip.poses for clip in procedural_clips(MOTIONS, 4.0, variations=1, seed=5)])
    poses = canonical.canonicalise(poses)[0]
    poses = np.concatenate([poses, canonical.mirrored(poses)])
    count = len(poses)
    mirrored = np.arange(count) >= count // 2
    origins = PoseOrigins(["procedural"], ["0"], np.zeros(count), np.arange(count), mirrored)
    return PoseDatabase.of_poses(poses, load_body("neutral"), origins)


@pytest.fixture(scope="module")
def clip() -> PoseClip:
    """Return a motion outside the database, facing the camera."""
    whole = perform("semaphore", load_body("neutral"), 30.0)
    return PoseClip("semaphore", whole.poses[30 : 30 + FRAMES], 30.0, "procedural")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory, clip: PoseClip) -> Record:
    folder = tmp_path_factory.mktemp("recordings")

    def make(name: str, motion: PoseClip = clip, **options: object) -> Recording:
        given = {"body": "neutral", "sensor": "tof", "furnished": False, "distance": 2.9} | options
        return simulate_recording(motion, folder / f"{name}.npz", **given)

    return make


@pytest.fixture(scope="module")
def recording(record: Record) -> Recording:
    return record("plain")


@pytest.fixture(scope="module")
def results(database: PoseDatabase, recording: Recording) -> list[FrameResult]:
    return run(known(database), recording)


def known(database: PoseDatabase, settings: HybridSettings = SETTINGS) -> HybridTracker:
    """Return a tracker with the person's body."""
    return HybridTracker(database, settings, body=load_body("neutral"))


def saved(path: Path, like: Recording, frames: list[np.ndarray], **changes: object) -> Recording:
    """Return other frames of the same camera."""
    given = {
        "depth": iter(frames), "camera": like.camera, "timestamps": np.arange(len(frames)) / 30.0,
        "up_camera": like.up_camera,
    } | changes  # fmt: skip
    save_recording(path, **given)
    return open_recording(path)


# Following


def test_a_motion_that_is_not_in_the_database_is_followed(results: list[FrameResult], recording: Recording) -> None:
    check_sound(results)
    assert all(result.state == TRACKED for result in results)
    assert errors(results, recording).mean() < 0.02
    assert "local" in {SOURCES[result.source] for result in results}


def test_a_mirrored_recording_gives_mirrored_joints(
    database: PoseDatabase, results: list[FrameResult], recording: Recording, tmp_path: Path
) -> None:
    frames = [np.ascontiguousarray(recording.depth(i)[:, ::-1]) for i in range(len(recording))]
    mirrored = saved(
        tmp_path / "mirrored.npz", recording, frames, camera=recording.camera.mirrored(),
        up_camera=recording.up_camera * [-1, 1, 1],
    )  # fmt: skip
    found = joints_of(run(known(database), mirrored))
    swap = {"left": "right", "right": "left"}
    other = []
    for name in skeleton.REPORTED:
        side, _, rest = name.partition("_")
        other.append(skeleton.REPORTED.index(f"{swap[side]}_{rest}" if side in swap else name))
    expected = joints_of(results)[:, other] * [-1, 1, 1]
    apart = np.linalg.norm(found - expected, axis=2)
    assert apart.mean() < 0.02
    assert np.linalg.norm(found - joints_of(results) * [-1, 1, 1], axis=2).mean() > 0.2  # sides without exchange


@pytest.mark.parametrize("hypotheses", [(), ("arms",), ("local",), ("local", "arms")])
def test_hypotheses_that_find_no_first_pose_are_refused(hypotheses: tuple[str, ...]) -> None:
    with pytest.raises(SettingsError, match="no first pose; add one of extrema, joints, swarm"):
        HybridSettings(hypotheses=hypotheses)


def test_the_joint_network_alone_finds_and_follows_the_person(database: PoseDatabase, recording: Recording) -> None:
    found = run(known(database, replace(SETTINGS, hypotheses=("joints",))), recording, 8)
    check_sound(found)
    assert {SOURCES[result.source] for result in found} == {"joints"}
    assert np.median(errors(found, recording)) < 0.03
    with_all = run(known(database, replace(SETTINGS, hypotheses=("local", "extrema", "joints"))), recording, 8)
    assert errors(with_all, recording).mean() < 0.02


# Arms


def test_an_arm_that_went_wrong_comes_back(database: PoseDatabase, recording: Recording) -> None:
    elbow = skeleton.REPORTED.index("left_elbow")
    kept, arms = 6, {}
    for hypotheses in (("local", "extrema"), SETTINGS.hypotheses):
        solo = Solo(known(database, replace(SETTINGS, hypotheses=hypotheses)), recording)
        wrong = steps(solo, recording, range(kept))[-1].pose.copy()
        wrong[[entry("left_shoulder_rx"), entry("left_shoulder_ry"), entry("left_shoulder_rz")]] = 0.5, -1.6, -1.5
        solo.follower.state = misled(solo.follower.state, wrong)
        results = steps(solo, recording, range(kept, kept + 4))
        gaps = np.linalg.norm(joints_of(results) - recording.joints[kept : kept + 4], axis=2)
        arms[hypotheses] = gaps[-1, elbow : elbow + 3]
        sources = {SOURCES[result.source] for result in results}
    assert "arms" in sources
    assert arms[SETTINGS.hypotheses].max() < 0.1
    assert arms[SETTINGS.hypotheses].mean() < 0.5 * arms["local", "extrema"].mean()


# Momentum


# Interruptions


def test_an_empty_frame_is_called_empty_and_keeps_the_last_pose(
    database: PoseDatabase, recording: Recording, tmp_path: Path
) -> None:
    nothing = np.zeros(recording.camera.shape, dtype=np.uint16)
    speck = nothing.copy()
    speck[70:75, 80:85] = 2500
    frames = [nothing, recording.depth(0), nothing, speck, recording.depth(3)]
    found = run(known(database), saved(tmp_path / "gaps.npz", recording, frames))
    check_sound(found)
    assert [result.state for result in found] == [EMPTY, TRACKED, EMPTY, EMPTY, TRACKED]
    assert [SOURCES[found[i].source] for i in (0, 2, 3)] == ["predicted"] * 3
    assert np.array_equal(found[2].pose, found[1].pose) and np.array_equal(found[3].joints, found[1].joints)
    assert not found[2].confidence.any()
    assert found[0].joints[:, 2].min() > 0.5


def test_who_comes_back_elsewhere_facing_elsewhere_is_tracked_at_once(
    database: PoseDatabase, clip: PoseClip, record: Record, tmp_path: Path
) -> None:
    before, after = (
        record(f"turned by {yaw}", PoseClip("part", clip.poses[:4], 30.0, "procedural"), distance=distance, yaw=yaw)
        for yaw, distance in ((40.0, 2.9), (-40.0, 2.2))
    )
    nothing = np.zeros(before.camera.shape, dtype=np.uint16)
    frames = [*before.frames(), nothing, nothing, *after.frames()]
    found = run(known(database), saved(tmp_path / "return.npz", before, frames))
    check_sound(found)
    assert [result.state for result in found] == [TRACKED] * 4 + [EMPTY] * 2 + [TRACKED] * 4
    assert SOURCES[found[6].source] == "extrema"
    assert errors(found[:4], before).mean() < 0.03
    assert errors(found[6:], after).mean() < 0.03


def test_frames_without_an_explaining_pose_are_lost_and_the_search_restarts(
    database: PoseDatabase, recording: Recording
) -> None:
    settings = replace(SETTINGS, lost_distance=1e-6, patience=1.5 / 30.0)
    found = run(known(database, settings), recording, 6)
    check_sound(found)
    assert {result.state for result in found} == {LOST}
    # after two lost frames there is no previous pose to refine
    assert all(SOURCES[found[i].source] == "extrema" for i in (0, 2, 4))


# Determinism


def test_a_state_on_disk_continues_exactly(database: PoseDatabase, recording: Recording, tmp_path: Path) -> None:
    settings = replace(SETTINGS, shape=ShapeSettings(seconds=0.15), restarts=1, smoothing=0.05)
    tracker = HybridTracker(database, settings)
    expected = run(tracker, recording, 12)
    first = Solo(tracker, recording)
    found = steps(first, recording, range(5))
    before = first.follower.state
    save_checkpoint(tmp_path / "state.npz", "hybrid", first.follower)
    steps(first, recording, [9])
    assert first.follower.state is not before  # a step replaces the state and leaves the old one unchanged
    second = Solo(HybridTracker(database, settings), recording)
    restore(second.follower, load_checkpoint(tmp_path / "state.npz", "hybrid"), "person")
    found += steps(second, recording, range(5, 12))
    assert digest(found) == digest(expected)
    assert np.array_equal(second.body.shape, first.body.shape)


# Bodies


@pytest.mark.parametrize("name", ["child", "slim_male"])
def test_the_body_of_the_person_is_learnt_from_the_recording(
    database: PoseDatabase, clip: PoseClip, record: Record, name: str
) -> None:
    person = subject_body(name)
    motion = PoseClip(name, clip.poses[:8], 30.0, "procedural")
    film = record(name, motion, body=person, distance=3.1)  # the whole person is in the image
    tracker = HybridTracker(database, replace(SETTINGS, shape=ShapeSettings(seconds=1.0, rate=30.0), restarts=1))
    solo = Solo(tracker, film)
    learnt = solo.body
    neutral = load_body("neutral").height
    assert abs(learnt.height - person.height) < 0.6 * abs(neutral - person.height)
    found = steps(solo, film, range(len(film)))
    assert solo.body is learnt
    assert errors(found, film).mean() < 0.03


def test_a_live_person_of_any_size_has_a_pose_in_each_frame_and_the_rows_of_a_recording(
    database: PoseDatabase, clip: PoseClip, record: Record
) -> None:
    person = subject_body("child")
    film = record("live", PoseClip("child", clip.poses[:14], 30.0, "procedural"), body=person, distance=3.1)
    shape = ShapeSettings(seconds=0.2, rate=30.0)
    settings = replace(SETTINGS, hypotheses=("local", "extrema", "joints", "arms"), shape=shape, restarts=1)
    people = [
        kind(
            HybridTracker(database, settings),
            SinglePersonSegmenter(film.camera, up_camera=film.up_camera),
            film.up_camera,
        )
        for kind in (LivePeople, MultiPersonTracker)
    ]
    frames = list(film.stream())
    live = [people[0].advance(frame) for frame in frames]
    rows = [row.result for each in live for row in each.rows] + [row.result for row in people[0].finish()]
    assert digest(rows) == digest([row.result for frame in frames for row in people[1].step(frame)])
    shown = [each.poses[0].row.result for each in live]
    assert all(each.poses[0].provisional for each in live) and len(shown) == len(film)
    assert errors(shown[:1], film).mean() < 0.06, "the first one, of the size that the joint network gives"
    assert errors(shown, film).mean() < 0.05


def test_a_preview_repeats_no_work_of_the_learner(database: PoseDatabase, recording: Recording) -> None:
    tracker = HybridTracker(database, replace(SETTINGS, restarts=1))
    rotation = level_rotation(recording.up_camera)
    learner = tracker.learner(recording.camera, rotation)
    finder = SinglePersonSegmenter(recording.camera, up_camera=recording.up_camera)
    seen = [finder.find(recording.depth(i), i / 30.0, {})[0] for i in range(3)]
    assert not learner.found and learner.preview(None, 0.0) is None
    assert learner.preview(seen[0], 0.01) is not None and learner.found and learner.body is None
    learner.observe(seen[1], 1 / 30.0)
    assert learner.preview(seen[1], 1 / 30.0) is learner.result
    after = learner.preview(seen[2], 2 / 30.0)
    assert after is not None and after is not learner.result
