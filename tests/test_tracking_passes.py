"""Second pass: choice between trajectories, stature, heading, keyframes, jumps, continued runs."""

from collections.abc import Iterable
from copy import copy
from dataclasses import replace
from itertools import count, product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.sensing_scenes import TOF
from tests.support.misled import wrong_pose
from tests.support.solo import Solo
from toolkit.app.pipeline import TrackerRecipe, second, track_recording
from toolkit.body import skeleton
from toolkit.body.shape import ShapeSpace, load_body
from toolkit.database import canonical
from toolkit.database.database import PoseDatabase
from toolkit.io import parts
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.mocap.procedural import procedural_clips
from toolkit.people.evidence import Evidence
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.people.survey import find_person
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.joints2d import Joints2D, LiftedJoints
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, simulate_recording, simulate_scene
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import STILL_RESTARTS, HybridTracker
from toolkit.tracking import clock
from toolkit.tracking.frame_detection import Detection, FrameDetector
from toolkit.tracking.heading import (  # fmt: skip
    AROUND,
    HEADING_UNCERTAINTY,
    MAX_HEADING_PENALTY,
    directions_faced,
    directions_walked,
    estimated_facing,
    heading,
    heading_disagreement,
    sighted_facing,
    weighed,
)
from toolkit.tracking.passes import JUMP, REPAIRED_SHARE, BidirectionalTracker, Jump
from toolkit.tracking.planning import Plan, Stretch
from toolkit.tracking.search.extrema_query import ExtremaQuery
from toolkit.tracking.sightings import SightingFile
from toolkit.tracking.state import PersonState
from toolkit.tracking.stature import (  # fmt: skip
    StatureBelief,
    head_top,
    height_stood,
    off_floor,
    stature_prior_cost,
    statures_of,
    too_small,
)
from toolkit.tracking.trajectory_choice import SWITCH_COST, Direction, Step, better_parts
from toolkit.tracks import EMPTY, TRACKED, FrameResult, RunInfo, Track
from toolkit.tracks.runs import load_people
from toolkit.tracks.track import result_of, row_type

RATE = 30.0

COSTS = st.lists(st.floats(0.0, 0.5), min_size=1, max_size=6)


@given(COSTS, COSTS, COSTS, st.booleans(), st.booleans())
def test_of_two_trajectories_the_cheapest_path_is_taken(
    first: list[float], second: list[float], gaps: list[float], begins: bool, ends: bool
) -> None:
    count = min(len(first), len(second), len(gaps))
    costs, apart = np.array([first[:count], second[:count]]), np.array(gaps[:count])

    def total(path: tuple[int, ...]) -> float:
        padded = [path[0] if begins else 0, *path]
        spent = sum(costs[way, t] for t, way in enumerate(path))
        spent += SWITCH_COST * sum(apart[t] for t in range(count) if padded[t] != padded[t + 1])
        return float(spent) + (0.0 if ends or path[-1] == 0 else SWITCH_COST * apart[-1])

    found = better_parts(costs[0], costs[1], apart, (begins, ends))
    assert total(tuple(found.astype(int).tolist())) == pytest.approx(min(map(total, product((0, 1), repeat=count))))


def test_a_stretch_of_the_second_trajectory_is_taken_but_no_single_frame() -> None:
    first, second, gaps = np.full(60, 0.03), np.full(60, 0.04), np.full(60, 0.3)
    first[20:50], gaps[[20, 50]] = 0.08, 0.02
    assert np.flatnonzero(better_parts(first, second, gaps)).tolist() == list(range(20, 50))
    first[20:50], first[30] = 0.03, 0.08
    assert not better_parts(first, second, gaps).any()


def test_adults_are_likely_and_children_need_evidence() -> None:
    assert (
        stature_prior_cost(1.70)
        == 0.0
        < stature_prior_cost(1.84)
        < stature_prior_cost(1.44)
        < stature_prior_cost(1.07)
        < 0.03
    )
    assert off_floor(-1.4, None) == 0.0 == off_floor(-1.4, -1.4) < off_floor(-1.38, -1.4) < off_floor(-1.2, -1.4)
    assert off_floor(-1.2, -1.4) == off_floor(0.0, -1.4)


def test_the_top_of_a_head_is_the_highest_point_above_its_middle_but_for_noise() -> None:
    column = np.column_stack([np.full(20, 0.1), np.linspace(0.0, 0.19, 20), np.full(20, -2.0)])
    points = np.concatenate([column, [[0.1, 5.0, -2.0]], column + (0.4, 0.6, 0.0)])  # noise, and a hand
    pixels = np.full(len(points), 70 * TOF.width + 80, dtype=np.int32)
    none = np.zeros(0)
    cloud = Cloud(points.astype(np.float32), pixels, none, TOF, np.eye(3), none)
    assert head_top(cloud, np.array([0.0, 0.1, -2.0])) == pytest.approx(0.16)
    assert np.isnan(head_top(cloud, np.array([0.0, 0.1, -2.3]))), "nothing is measured there"


def test_a_head_that_the_image_cuts_off_has_no_top() -> None:
    depth = np.zeros(TOF.shape, np.float32)
    depth[4:60, 80:95] = 2.0
    whole = Cloud.from_depth(depth, TOF, np.diag([1.0, -1.0, -1.0]))
    head = whole.points[whole.index[10, 87]].astype(np.float64)
    assert head_top(whole, head) == pytest.approx((71.5 - 4) / 220 * 2.0, abs=0.02)
    depth[:4, 80:95] = 2.0
    assert np.isnan(head_top(Cloud.from_depth(depth, TOF, whole.rotation), head))


def test_the_standing_height_is_the_head_height_without_bends() -> None:
    tops = np.array([0.4, 0.5, np.nan, 0.31, 0.5, 0.49, 0.5, 0.9, 0.5])
    assert height_stood(tops, -1.3) == pytest.approx(1.8)
    assert height_stood(tops, None) == 0.0 == height_stood(np.full(3, np.nan), -1.3)
    assert statures_of(1.8, 1.71) == pytest.approx((1.8, 1.84)) and statures_of(1.3, 1.71) == (0.0, np.inf)
    assert too_small(1.80, 1.75) == 0.0 < too_small(1.72, 1.75) < too_small(1.6, 1.75) == too_small(1.0, 1.75)


def statures_tried(stood: float = 0.0) -> StatureBelief:
    space = ShapeSpace.load()
    return StatureBelief.of(tuple(space.body(space.typical(stature)) for stature in (1.84, 1.71, 1.58, 1.07)), stood)


def test_a_head_that_was_high_makes_smaller_bodies_unlikely() -> None:
    costs = {0: 0.042, 1: 0.038, 2: 0.036, 3: 0.036}
    assert statures_tried(1.82).narrowed(costs).likely[0] == 0 != statures_tried(1.3).narrowed(costs).likely[0]
    assert statures_tried(1.05).narrowed(costs).shares == pytest.approx(statures_tried().narrowed(costs).shares)


def test_where_sizes_explain_a_frame_alike_the_belief_lies_between_them() -> None:
    belief = statures_tried().narrowed({0: 0.042, 1: 0.038, 2: 0.036, 3: 0.036})
    assert 1.60 < ShapeSpace.load().body(belief.shape).height < 1.75
    assert belief.shares[3] < 0.02


def test_a_clear_child_is_accepted_and_frames_narrow_the_belief() -> None:
    belief = statures_tried()
    for _ in range(3):
        belief = belief.narrowed({0: 0.12, 1: 0.10, 2: 0.08, 3: 0.03})
    assert belief.shares[3] > 0.99 and belief.likely == (3,) and belief.frames == 3


def test_a_body_that_is_no_longer_tried_stays_unlikely() -> None:
    belief = statures_tried().narrowed({0: 0.03, 1: 0.04, 2: 0.05, 3: 0.15})
    assert 3 not in belief.likely
    assert 3 not in belief.narrowed({0: 0.03, 1: 0.035}).likely


@pytest.fixture(scope="module")
def take(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of a person who waves for a second."""
    whole = procedural_clips(["archery"], rate=RATE, body=load_body("slim_male"))[0]
    clip = replace(whole, poses=whole.poses[20:44])
    path = tmp_path_factory.mktemp("passes") / "take.npz"
    simulate_recording(clip, path, body=load_body("slim_male"), sensor="tof", distance=2.6, seed=3, furnished=False)
    return path


@pytest.fixture(scope="module")
def tracker(bundled_database: Path) -> HybridTracker:
    settings = HybridSettings(hypotheses=("local", "extrema", "arms"), sizes=(-0.6, 0.4))
    return HybridTracker(PoseDatabase.load(bundled_database), settings)


@pytest.fixture(scope="module")
def whole(take: Path, tracker: HybridTracker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the run without interruption."""
    run = tmp_path_factory.mktemp("whole") / "run"
    track_recording(open_recording(take), tracker, run)
    return run


@pytest.fixture(scope="module")
def sightings(take: Path, tracker: HybridTracker, tmp_path_factory: pytest.TempPathFactory) -> SightingFile:
    """Return the person's sightings in all frames."""
    recording = open_recording(take)
    finder = SinglePersonSegmenter(recording.camera, None, tracker.settings.sensing, recording.up_camera)
    kept = SightingFile(tmp_path_factory.mktemp("sightings"), finder.camera)
    for frame in range(len(recording)):
        kept.append(frame, finder.find(recording.depth(frame), float(recording.timestamps[frame]), {}))
    return kept


@pytest.fixture(scope="module")
def right(take: Path, tracker: HybridTracker, whole: Path) -> np.ndarray:
    """Return rows of a first pass that is correct in all frames."""
    track, recording, body = Track.load(whole), open_recording(take), load_body("slim_male")
    rows = np.zeros(len(track.state), dtype=row_type(len(tracker.stage_names)))
    for name in ("pose", "confidence", "state", "source", "stage_ms", "observed"):
        rows[name] = getattr(track, name)
    assert worst(take, track.joints) < 0.12, "also with the body that is learnt"
    for row in rows:
        row["joints"] = body.joint_positions(row["pose"].copy()) @ level_rotation(recording.up_camera)
    return rows


def turned(rows: np.ndarray, frames: slice, recording: Path) -> np.ndarray:
    """Return the rows with the person rotated by 180 degrees in these frames."""
    rows, rng, body = rows.copy(), np.random.default_rng(0), load_body("slim_male")
    for row in rows[frames]:
        row["pose"] = wrong_pose("turned", row["pose"].copy(), np.empty((0, len(row["pose"]))), rng)
        row["joints"] = body.joint_positions(row["pose"].copy()) @ level_rotation(open_recording(recording).up_camera)
    return rows


def second_pass(
    take: Path,
    tracker: HybridTracker,
    sightings: SightingFile,
    first_pass: np.ndarray,
    keyframes: tuple[int, ...] = (12,),
    *,
    relearned: bool = False,
) -> dict[int, Step]:
    """Return the steps of the second pass over the person of a recording."""
    recording, frames = open_recording(take), len(first_pass)
    stretches = (Stretch(0, frames - 1, keyframes),)
    plan = Plan(load_body("slim_male"), stretches, np.zeros((frames, 2)), relearned)
    rotation, seen = level_rotation(recording.up_camera), sightings.of(1)
    follower, times = tracker.follower(recording.camera, rotation, plan.body), recording.timestamps
    return parts.whole(BidirectionalTracker(follower, seen, times, plan, tracker.stage_names, first_pass).run()).steps


def worst(path: Path, joints: Iterable[np.ndarray]) -> float:
    """Return the largest mean joint error of a frame, metres."""
    truth = np.asarray(open_recording(path).joints)
    return float(max(np.linalg.norm(own - true, axis=1).mean() for own, true in zip(joints, truth, strict=True)))


@pytest.mark.parametrize("wrong", [slice(0, 0), slice(0, 9), slice(8, 16)], ids=["right", "at the start", "within"])
def test_what_went_wrong_in_the_first_pass_is_found_backwards(
    wrong: slice, take: Path, tracker: HybridTracker, sightings: SightingFile, right: np.ndarray,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    first, followed, follow = turned(right, wrong, take), list[int](), FrameDetector.follow
    monkeypatch.setattr(
        FrameDetector, "follow", lambda self, frame, *inputs: followed.append(frame) or follow(self, frame, *inputs)
    )
    trajectory = second_pass(take, tracker, sightings, first)
    errors = [worst(take, rows) for rows in (first["joints"], (trajectory[f].result.joints for f in range(len(first))))]
    assert errors[1] < 0.08 and (errors[0] > 0.25) == (wrong.stop > 0)
    frames = len(first)
    assert set(followed) == set(range(frames)) and len(followed) <= frames + 1 + REPAIRED_SHARE * frames


def test_a_keyframe_detection_is_followed_in_both_directions_if_both_trajectories_are_wrong(
    take: Path, bundled_database: Path, sightings: SightingFile, right: np.ndarray,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    without_network = HybridSettings(hypotheses=("local", "extrema"), sizes=(-0.6, 0.4))
    tracker = HybridTracker(PoseDatabase.load(bundled_database), without_network)
    first, redetect = turned(right, slice(0, None), take), FrameDetector.redetect

    def detected(self: FrameDetector, frame: int, direction: Direction) -> Detection:
        """Return the correct pose; a person rotated by 180 degrees explains a frame nearly as well."""
        found, pose = redetect(self, frame, direction), right["pose"][frame].copy()
        step = replace(found.step, result=result_of(right[frame]))
        return Detection(replace(found.followed, state=self.state_at(frame, pose)), step)

    def priced(self: FrameDetector, frame: int, pose: np.ndarray, found: Any, *, prior: bool = False) -> float:
        return (0.0 if (pose == right["pose"][frame]).all() else 1.0) if prior else cost(self, frame, pose, found)

    cost = FrameDetector.cost
    monkeypatch.setattr(FrameDetector, "redetect", detected)
    monkeypatch.setattr(FrameDetector, "cost", priced)
    for keyframes in ((), (16,)):
        trajectory = second_pass(take, tracker, sightings, first, keyframes)
        joints = [trajectory[f].result.joints for f in range(len(first))]
        assert (worst(take, joints) < 0.08) == bool(keyframes)


def test_with_a_body_learnt_again_the_forward_trajectory_begins_in_a_keyframe(
    take: Path, tracker: HybridTracker, sightings: SightingFile, right: np.ndarray
) -> None:
    first = turned(right, slice(0, None), take)
    trajectory = second_pass(take, tracker, sightings, first, (3, 12), relearned=True)
    steps = [trajectory[f] for f in range(len(first))]
    assert np.isinf([step.rival_cost for step in steps[:3]]).all() and np.isfinite(steps[-1].rival_cost)
    assert worst(take, (step.result.joints for step in steps)) < 0.08


@given(
    st.integers(0, 30),
    st.integers(0, int(99 * JUMP)),
    st.lists(st.sampled_from(list(Direction)), min_size=2, max_size=2),
)
def test_a_jump_is_followed_from_the_side_from_which_it_was_not_passed(
    gap: int, moved: int, directions: list[Direction]
) -> None:
    places = (0, moved, moved + gap, 2 * moved + gap)
    joints = [np.full((20, 3), place / 100 / np.sqrt(3), np.float32) for place in places]
    rest = np.zeros(skeleton.POSE_SIZE), np.ones(20, np.float32), TRACKED, 0, np.ones(1, np.float32)
    sides = [directions[0], directions[0], directions[1], directions[1]]
    steps = {
        f: Step(FrameResult(rest[0], own, *rest[1:]), 0.0, side, continues=f not in (1, 2))
        for f, (own, side) in enumerate(zip(joints, sides, strict=True))
    }
    both = BidirectionalTracker.__new__(BidirectionalTracker)
    both._trajectory, both._plan = steps, SimpleNamespace(stretches=(Stretch(0, 3, (0,)),))  # type: ignore[assignment]
    assume(abs(gap - moved - 100 * JUMP) > 0.5)
    expected = set()
    if gap - moved > 100 * JUMP:
        expected |= {Jump(1, Direction.FORWARD)} if directions[0] is Direction.BACKWARD else set()
        expected |= {Jump(2, Direction.BACKWARD)} if directions[1] is Direction.FORWARD else set()
    assert set(both._jumps_left()) == expected


@pytest.mark.parametrize("angle", np.linspace(-np.pi, np.pi, 9))
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_a_pose_that_heads_elsewhere_costs_more_by_as_much_as_it_is_sure(share: float, angle: float) -> None:
    heads = share * np.array([np.sin(angle), np.cos(angle)])
    cost = weighed(0.2, np.zeros(skeleton.POSE_SIZE), heads)
    assert cost == pytest.approx(0.2 - 0.2 * MAX_HEADING_PENALTY * share * np.cos(angle), abs=1e-9)


def test_walking_and_facing_directions_combine_with_bounded_certainty() -> None:
    walked, faced = np.array([[0.0, 0.9], [0.0, 0.3], [0.2, 0.0]]), np.array([[0.0, 0.8], [0.0, -0.3], [0.0, 0.0]])
    np.testing.assert_allclose(heading(walked, faced), [[0.0, 1.0], [0.0, 0.0], [0.2, 0.0]])


@pytest.mark.parametrize("yaw", np.linspace(-3.0, 3.0, 7))
def test_votes_have_a_body_face_where_it_does_as_far_as_they_are_reliable(yaw: float) -> None:
    pose = canonical.place(np.zeros(skeleton.POSE_SIZE), np.zeros(4), np.array([0.2, 0.9, -3.0]), yaw)
    points, sure = load_body("neutral").joint_positions(pose), np.zeros(len(skeleton.REPORTED))
    estimate = JointEstimate(points, sure, reliability=sure)
    assert not estimated_facing(estimate).any() and not estimated_facing(None).any()
    for name, reliability in (("left_shoulder", 0.8), ("right_shoulder", 0.5)):
        sure[skeleton.REPORTED.index(name)] = reliability
    facing = estimated_facing(replace(estimate, reliability=sure))
    np.testing.assert_allclose(facing, 0.9 * np.array([np.sin(yaw), np.cos(yaw)]), atol=1e-6)
    assert heading_disagreement(facing, pose) == pytest.approx(-0.9)
    image = LiftedJoints(np.where(sure[:, None] > 0.0, points, np.nan), sure)
    np.testing.assert_allclose(sighted_facing(image), 0.4 * np.array([np.sin(yaw), np.cos(yaw)]), atol=1e-6)
    assert not sighted_facing(None).any()


def test_image_joints_decide_the_facing_of_a_frame(take: Path, tracker: HybridTracker) -> None:
    recording = open_recording(take)
    turned = np.zeros((len(skeleton.REPORTED), 3), dtype=np.float32)
    solo = Solo(tracker, recording)
    depth = np.asarray(recording.depth(0))
    v, u = (int(np.median(index)) for index in np.nonzero(depth))
    for name, column in (("left_shoulder", u - 3), ("right_shoulder", u + 3)):  # as of a person seen from behind
        turned[skeleton.REPORTED.index(name)] = column, v, 1.0
    sighting = find_person(recording).find(depth, 0.0, {})[0]
    _, facing, _, _ = solo.follower.shown(replace(sighting, joints=Joints2D.of_rows(turned)), 0.0)
    assert facing[1] < -0.5


def test_many_near_votes_outweigh_one_and_far_ones_have_no_weight() -> None:
    times, facings = np.arange(0.0, 60.0, 0.1), np.tile([0.0, 0.4], (40, 1))
    facings[3] = [0.0, -0.9]
    faced = directions_faced(0.25 * np.arange(40), facings, times)
    assert (faced[:100, 1] > 0.4).all() and not faced[140:].any()
    assert (np.linalg.norm(faced, axis=1) < 1.0).all()
    alone = directions_faced(np.array([5.0]), np.array([[HEADING_UNCERTAINTY, 0.0]]), np.array([5.0, 5.0 + AROUND]))
    np.testing.assert_allclose(alone[:, 0], [0.5, 1.0 / (1.0 + np.e)])


def test_more_poses_are_refined_of_a_still_than_of_a_frame_among_others(
    take: Path, tracker: HybridTracker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, wanted, poses = open_recording(take), list[int](), ExtremaQuery.poses

    def asked(self: ExtremaQuery, observation: Any, previous: Any, body: Any, count: int) -> np.ndarray:
        if previous is None:
            wanted.append(count)
        return poses(self, observation, previous, body, count)

    monkeypatch.setattr(ExtremaQuery, "poses", asked)
    for frames in (1, 2):
        wanted.clear()
        path = tmp_path / f"{frames}.npz"
        depth = [whole.depth(frame) for frame in range(frames)]
        save_recording(path, depth=depth, camera=whole.camera, timestamps=np.arange(frames) / RATE)
        track_recording(open_recording(path), tracker, tmp_path / f"run_{frames}")
        assert (STILL_RESTARTS in wanted) == (frames == 1) and tracker.settings.restarts in wanted
    thorough = copy(tracker)
    thorough.settings = replace(tracker.settings, restarts=20)
    assert thorough.of_still().settings.restarts == 20


@pytest.mark.parametrize("killed_after", [3, 20])
def test_a_run_killed_in_its_second_pass_goes_on_to_the_same_track(
    killed_after: int, take: Path, tracker: HybridTracker, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, follow = tmp_path / "run", FrameDetector.follow

    def dies(self: FrameDetector, frame: int, state: PersonState, direction: Direction) -> Detection:
        dies.left -= 1  # type: ignore[attr-defined]
        if dies.left < 0:  # type: ignore[attr-defined]
            raise KeyboardInterrupt
        return follow(self, frame, state, direction)

    dies.left = killed_after  # type: ignore[attr-defined]
    monkeypatch.setattr(FrameDetector, "follow", dies)
    with pytest.raises(KeyboardInterrupt):
        track_recording(open_recording(take), tracker, run)
    (run / ".lock").unlink(missing_ok=True)
    monkeypatch.setattr(FrameDetector, "follow", follow)
    summary = track_recording(open_recording(take), tracker, run, resume=True)
    resumed, expected = Track.load(run), Track.load(whole)
    assert not summary.interrupted and not (run / second.FOLDER).exists()
    for name in ("pose", "joints", "confidence", "state", "source", "observed"):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(expected, name))
    assert RunInfo.load(run).shape == RunInfo.load(whole).shape


def test_two_processes_track_as_one_does(
    bundled_database: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clips = procedural_clips(["archery", "conduct"], rate=RATE, body=load_body("slim_male"), variations=1)
    pair = [
        SimulatedPerson(replace(clip, poses=clip.poses[:16]), body=load_body("slim_male"), at=(x, 0.0))
        for clip, x in zip(clips, (-0.7, 0.7), strict=True)
    ]
    room = simulate_scene(pair, tmp_path / "room.npz", CaptureSettings(sensor="tof", background=False))
    overrides = {"hypotheses": ["local", "extrema", "arms"], "sizes": [-0.6, 0.4]}
    recipe = TrackerRecipe(overrides=overrides, database=bundled_database)
    follow = second.SecondPass._follow_together
    shared = list[int]()

    def together(self: second.SecondPass, tasks: Any, *rest: Any) -> None:
        shared.append(len(tasks))
        follow(self, tasks, *rest)
        assert len(self._finished) == len(tasks)

    monkeypatch.setattr(second, "SHARED_FRAMES", 0)
    monkeypatch.setattr(second.SecondPass, "_follow_together", together)
    for workers in (1, 2):
        track_recording(
            open_recording(room.path), recipe.build(), tmp_path / str(workers), people=None,
            made_of=recipe, workers=workers,
        )  # fmt: skip
    assert shared == [2]
    for person in ("person_01", "person_02"):
        one, two = (Track.load(tmp_path / workers / person) for workers in "12")
        for name in ("pose", "joints", "confidence", "state", "source", "observed"):
            np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    assert load_people(tmp_path / "1").text() == load_people(tmp_path / "2").text()


@pytest.mark.parametrize(("score", "kept"), [(8.0, True), (-8.0, False)])
def test_a_track_that_scores_as_furniture_is_left_out_of_a_run(
    score: float, kept: bool, take: Path, tracker: HybridTracker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = Evidence(4, score)
    monkeypatch.setattr(MultiPersonFinder, "evidence", {1: own})
    summary = track_recording(open_recording(take), tracker, tmp_path / "run", people=None)
    found = load_people(tmp_path / "run")
    assert not summary.interrupted and (len(found.people), len(found.furniture)) == (kept, not kept)
    assert (found.people[0].evidence if kept else found.furniture[0]) == own
    assert (tmp_path / "run" / "person_01").exists() == kept


def test_a_run_killed_after_leaving_a_track_out_resumes_from_the_other_rows(
    take: Path, tracker: HybridTracker, tmp_path: Path
) -> None:
    asked = list[set[int]]()

    def rows(people: Iterable[int]) -> int:
        asked.append(set(people))
        return 20

    sink: Any = SimpleNamespace(rows=rows)
    body = load_body("neutral")
    for frames in (20, 21):
        recording = open_recording(take)
        recording.timestamps = np.arange(frames) / RATE
        killed, again = (second.SecondPass(tmp_path, tracker, recording, None, sink) for _ in range(2))
        thing = Evidence(4, -40.0, 4)
        killed.begin({1: body, 2: body}, {1: Evidence(4, 8.0, 4), 2: thing}, [])
        assert again.restore() == (frames == 20) and set(again.bodies) == {1, 2}
    assert asked == [{1}, {1}]


def test_both_passes_are_in_the_time_of_a_frame_and_one_pass_is_the_stream(
    take: Path, tracker: HybridTracker, bundled_database: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ticks = count()  # a clock that each detection advances by a second: the test is independent of the machine's load
    monkeypatch.setattr(clock, "perf_counter", lambda: float(next(ticks)))
    once = HybridTracker(PoseDatabase.load(bundled_database), replace(tracker.settings, passes=1))
    track_recording(open_recording(take), once, tmp_path / "once")
    track_recording(open_recording(take), tracker, tmp_path / "twice")
    spent = [float(np.median(Track.load(tmp_path / run).stage_ms.sum(axis=1))) for run in ("once", "twice")]
    assert spent[1] >= 1.8 * spent[0] > 0.0
    assert not (tmp_path / "once" / second.FOLDER).exists()


def test_a_person_out_of_view_has_empty_rows(take: Path, tracker: HybridTracker, tmp_path: Path) -> None:
    recording = open_recording(take)
    depth = np.stack([recording.depth(i) for i in range(len(recording))])
    depth = np.concatenate([np.zeros_like(depth[:3]), depth, np.zeros((40, *depth.shape[1:]), np.uint16), depth[:9]])
    path = tmp_path / "gone.npz"
    save_recording(path, depth=depth, camera=recording.camera, timestamps=np.arange(len(depth)) / RATE)
    track_recording(open_recording(path), tracker, tmp_path / "run")
    track = Track.load(tmp_path / "run")
    seen = len(recording) + 3
    gone = np.r_[0:3, seen : seen + 40]
    assert (track.state[gone] == EMPTY).all() and (np.delete(track.state, gone) == TRACKED).all()
    assert not track.confidence[gone].any() and not track.observed[gone].any()
    np.testing.assert_array_equal(track.pose[:3], np.repeat(track.pose[3:4], 3, axis=0))
    np.testing.assert_array_equal(track.pose[gone[3:]], np.repeat(track.pose[seen - 1 : seen], 40, axis=0))


def walk(speed: float, frames: int = 60) -> np.ndarray:
    """Return rows of a person who walks to the right in the image."""
    rows = np.zeros(frames, dtype=[("joints", np.float32, (20, 3)), ("state", np.int64)])
    rows["joints"][:, :, 0] = (speed * np.arange(frames) / RATE)[:, None]
    rows["joints"][:, :, 2] = 3.0
    rows["state"] = TRACKED
    return rows


@pytest.mark.parametrize(("speed", "length"), [(0.0, 0.0), (0.3, 0.0), (0.6, 0.5), (1.4, 1.0)])
def test_a_walking_direction_exists_for_walkers_only(speed: float, length: float) -> None:
    times = np.arange(60) / RATE
    walked = directions_walked(walk(speed), times, np.diag([1.0, -1.0, -1.0]))
    np.testing.assert_allclose(walked, np.tile([length, 0.0], (60, 1)), atol=1e-4)


def test_no_direction_across_a_gap_or_from_a_single_frame() -> None:
    rows, times = walk(1.4), np.arange(60) / RATE
    times[30:] += 2.0
    rows["state"][[10, 59]] = EMPTY
    walked = directions_walked(rows, times, np.diag([1.0, -1.0, -1.0]))
    assert not walked[10].any() and not walked[59].any() and walked[9, 0] > 0.99
    assert not directions_walked(walk(1.4, 1), times[:1], np.eye(3)).any()
    alone = walk(1.4, 3)
    assert not directions_walked(alone, np.array([0.0, 2.0, 4.0]), np.eye(3)).any()
