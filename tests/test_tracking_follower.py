"""The follower's step with fake parts: selection, queries, state, and reported values."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.fake_tracker_parts import IN_VIEW, FakeObjective, FakeObserver, FakeSearch, compared, pose_at, says
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.io.checkpoint import plain, restore
from toolkit.io.parts import Parts
from toolkit.people.connection import HELD
from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower
from toolkit.tracking.occluded_limbs import Guess
from toolkit.tracking.search.search_protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState, Previous
from toolkit.tracks import LOST, TRACKED, FrameResult

CAMERA = Camera(100.0, 100.0, 19.5, 14.5, 40, 30)
ROTATION = level_rotation(np.array([0.0, -0.9, -0.3]))
SOURCES = ("local", "extrema", "joints", "arms", "predicted")
STAGES = ("prepare", "landmarks", "first", "second", "select")
SETTINGS = SimpleNamespace(smallest_person=300, lost_distance=0.25, patience=3, smoothing=0.0)
NEAR, FAR, HOPELESS = 0.05, 0.2, 0.6


def sighting(pixels: int = 600) -> Sighting:
    """Return a person of that many pixels."""
    depth = np.zeros(CAMERA.shape, dtype=np.float32)
    depth.ravel()[:pixels] = 3.0
    return Sighting(1, depth, None, CAMERA)


def follower(
    searches: Sequence[FakeSearch],
    *,
    distances: dict[float, float] | None = None,
    observer: FakeObserver | None = None,
    settings: SimpleNamespace = SETTINGS,
    sizes: Sequence[Body] = (),
    occluded_limbs: Any = None,
    verifier: Any = None,
    **state: object,
) -> Follower:
    """Return a follower of a person with a known body, unless `state` is given."""
    begun = PersonState.begin(load_body("neutral"), sized=True, seed=3)
    return Follower(
        observer or FakeObserver(), searches, FakeObjective(distances or {}), ROTATION, settings, sizes, SOURCES,
        replace(begun, **state), occluded_limbs, verifier,
    )  # fmt: skip


def followed(**changes: object) -> dict[str, object]:
    """Return the state of a person found in the previous frame."""
    pose = pose_at()
    return {"previous": Previous.of_pose(load_body("neutral"), pose), "pose": pose, "timestamp": 0.0} | changes


def step(person: Follower, seen: Sighting | None = None, timestamp: float = 1.0) -> FrameResult:
    return person.step(seen or sighting(), timestamp, StageClock(STAGES))


# Selection


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_hypothesis_with_the_lowest_cost_is_selected_in_any_order(order: tuple[int, int]) -> None:
    near, far = says("extrema", pose_at(1.0)), says("local", pose_at(2.0))
    searches = [FakeSearch("first", Proposal((near,))), FakeSearch("second", Proposal((far,)))]
    person = follower([searches[k] for k in order], distances={1.0: NEAR, 2.0: FAR})
    result = step(person)
    assert SOURCES[result.source] == "extrema"
    assert result.pose[0] == 1.0


def test_on_a_first_frame_a_likely_pose_wins_over_one_that_is_hardly_nearer() -> None:
    near, likely = (
        Hypothesis(source, pose_at(k), compared(NEAR + 0.01 * k, energy=energy))
        for k, (source, energy) in enumerate((("extrema", 0.3), ("joints", 0.0)))
    )
    search = FakeSearch("first", lambda state, best: Proposal((near, likely)))
    person = follower([search])
    won = [SOURCES[step(person, timestamp=float(t)).source] for t in range(2)]
    assert won == ["joints", "extrema"]


def improving(source: str, pose: np.ndarray) -> Callable[[PersonState, ScoredHypothesis | None], Proposal]:
    """Return an answer that replaces the best hypothesis."""
    return lambda state, best: Proposal((Hypothesis(source, pose, improves=best),))


def test_what_improves_a_hypothesis_takes_its_place_even_from_farther_away() -> None:
    said = FakeSearch("first", Proposal((says("local", pose_at(1.0)),)))
    better = FakeSearch("second", improving("arms", pose_at(2.0)))
    assert SOURCES[step(follower([said, better], distances={1.0: NEAR, 2.0: FAR})).source] == "arms"
    plain = FakeSearch("second", Proposal((says("arms", pose_at(2.0)),)))
    assert SOURCES[step(follower([said, plain], distances={1.0: NEAR, 2.0: FAR})).source] == "local"


def test_a_person_of_unknown_size_gets_the_body_that_the_winner_was_found_with() -> None:
    bodies = [load_body("child"), load_body("neutral"), load_body("slim_male")]

    def answer(state: PersonState, best: object) -> Proposal:
        index = [body.name for body in bodies].index(state.body.name)
        return Proposal((says("extrema", pose_at(float(index)), (FAR, NEAR, HOPELESS)[index]),))

    search = FakeSearch("first", answer)
    person = follower([search], sizes=bodies, body=load_body("child"), sized=False)
    result = step(person)
    assert [state.body.name for _, state, _ in search.asked] == ["child", "neutral", "slim_male"]
    assert person.body is bodies[1]
    assert person.state.sized
    assert person.state.previous is not None
    expected = bodies[1].joint_positions(result.pose)
    assert person.state.previous.joints == pytest.approx(expected)
    step(person)
    assert len(search.asked) == 4


class FakeVerifier:
    """Verifier that returns one more hypothesis."""

    name = "second"

    def __init__(self, place: float) -> None:
        self.place, self.told = place, 0

    def verified(self, observation: object, scored: Sequence[ScoredHypothesis]) -> Parts[list[ScoredHypothesis]]:
        self.told = len(scored)
        yield
        return [
            replace(scored[0], hypothesis=says("joints", pose_at(self.place)), comparison=compared(NEAR), cost=NEAR)
        ]


def test_in_a_first_frame_the_verifier_gets_the_hypotheses_of_all_bodies_and_competes() -> None:
    bodies, verifier = [load_body("child"), load_body("neutral")], FakeVerifier(5.0)
    search = FakeSearch("first", Proposal((says("extrema", pose_at(1.0), FAR),)))
    person = follower([search], sizes=bodies, sized=False, verifier=verifier)
    result = step(person)
    assert verifier.told == 2
    assert result.pose[0] == 5.0 and SOURCES[result.source] == "joints"


def test_a_detection_stops_after_each_search_of_each_body_and_changes_nothing_before_its_end() -> None:
    bodies, verifier = [load_body("child"), load_body("neutral")], FakeVerifier(5.0)
    search = FakeSearch("first", Proposal((says("extrema", pose_at(1.0), FAR),)))
    person = follower([search], sizes=bodies, sized=False, verifier=verifier)
    before = person.state
    parts, stops = person.step_parts(sighting(), 0.0, StageClock(STAGES)), 0
    with pytest.raises(StopIteration) as ended:
        while True:
            next(parts)
            stops += 1
            assert person.state is before
    assert stops == 3 and ended.value.value.pose[0] == 5.0 and person.state is not before
    again = [1 for _ in person.step_parts(sighting(), 0.1, StageClock(STAGES))]
    assert not again, "a tracked person is followed in one part"


def test_no_verification_for_a_tracked_person_or_without_hypotheses() -> None:
    verifier = FakeVerifier(5.0)
    said = Proposal((says("local", pose_at(1.0), FAR),))
    assert step(follower([FakeSearch("first", said)], verifier=verifier, **followed())).pose[0] == 1.0
    step(follower([FakeSearch("first", NOTHING)], verifier=verifier))
    assert verifier.told == 0


@pytest.mark.parametrize(("away", "asked"), [(HELD, False), (HELD + 0.1, True)])
def test_the_heading_persists_through_a_short_absence(away: float, asked: bool) -> None:
    verifier = FakeVerifier(5.0)
    person = follower([FakeSearch("first", Proposal((says("local", pose_at(1.0), FAR),)))], verifier=verifier)
    step(person, timestamp=0.0)
    verifier.told = 0
    person.step(None, 0.0, StageClock(STAGES))
    step(person, timestamp=away)
    assert bool(verifier.told) == asked


# Queries and their inputs


def test_the_random_numbers_go_on_from_frame_to_frame_and_are_those_of_the_seed() -> None:
    search = FakeSearch("first", Proposal((says("local", pose_at(1.0), NEAR),)))
    person = follower([search])
    for timestamp in (0.0, 1.0, 2.0):
        step(person, timestamp=timestamp)
    expected = np.random.Generator(np.random.PCG64(3)).random(3)
    assert search.draws == expected.tolist()


def test_what_a_search_carries_comes_back_to_it_in_the_next_frame() -> None:
    kept = {"swarm": np.ones(3)}
    first = FakeSearch("first", Proposal((says("local", pose_at(1.0), NEAR),), memory=kept))
    second = FakeSearch("second", NOTHING)
    person = follower([first, second])
    step(person)
    step(person)
    assert dict(first.asked[1][1].memory) == {"first": kept}


# State


def test_the_person_is_detected_again_after_the_waiting_time() -> None:
    person = follower([FakeSearch("first", Proposal((says("local", pose_at(1.0), HOPELESS),)))], **followed())
    states = []
    for frame in range(4):
        assert step(person, timestamp=frame + 1.0).state == LOST
        states.append((person.state.lost, person.state.previous is None))
    assert states == [(1, False), (2, False), (0, True), (1, False)]
    assert person.state.pose is not None


@pytest.mark.parametrize(("away", "asked"), [(0.9, 2), (HELD + 0.1, 1)])
def test_who_was_hidden_for_a_moment_goes_on_as_before_unless_somewhere_else_is_nearer(away: float, asked: int) -> None:
    def answer(state: PersonState, best: object) -> Proposal:
        return Proposal(
            (says("extrema" if state.previous is None else "local", pose_at(1.0 + (state.previous is None))),)
        )

    kept = followed(previous=Previous.of_pose(load_body("neutral"), pose_at(), before=pose_at()))
    for distances, source in (({1.0: NEAR, 2.0: FAR}, "local"), ({1.0: FAR, 2.0: NEAR}, "extrema")):
        search, observer = FakeSearch("first", answer), FakeObserver()
        person = follower([search], distances=distances, observer=observer, **kept)
        person.step(None, 0.1, StageClock(STAGES))
        person.step(None, 0.2, StageClock(STAGES))
        assert person.state.last_seen is not None and person.state.last_seen.before is None
        restore(person, plain(person), "person")
        result = step(person, timestamp=away)
        assert [state.previous is None for _, state, _ in search.asked] == [False, True][2 - asked :]
        assert SOURCES[result.source] == (source if asked == 2 else "extrema")
        # both searches receive the same observation, made without a previous frame
        assert [seen is observer.shown for seen, _, _ in search.asked] == [True] * asked
        assert [before.previous for before in observer.states] == [None]
        assert person.state.last_seen is None


def test_unobserved_limbs_do_not_jump_where_the_winner_does_not_continue() -> None:
    asked: list[object] = []

    def guess(pose: np.ndarray, seen: object, objective: object, before: object) -> Guess:
        asked.append(before)
        spread = np.zeros(20)
        spread[19] = 10.0
        return Guess(pose + 0.25, spread)

    answers = iter(
        [says("extrema", pose_at(1.0)), says("joints", pose_at(1.0)), says("local", pose_at(1.0), continues=True)]
    )
    search = FakeSearch("first", lambda state, best: Proposal((next(answers),)))
    person = follower([search], distances={1.0: NEAR}, occluded_limbs=SimpleNamespace(guess=guess))
    first, second, third = (step(person, timestamp=float(t)) for t in range(3))
    assert first.pose.tolist() == (pose_at(1.0) + 0.25).tolist()
    assert asked[0] is None and asked[2] is None
    assert np.array_equal(asked[1], first.pose)  # type: ignore[arg-type]
    assert second.confidence[:19] == pytest.approx(1.0 - NEAR)
    assert third.confidence[19] < 0.01


# Reported values


def test_joints_are_those_of_the_winner_in_the_camera_frame() -> None:
    result = step(follower([FakeSearch("first", Proposal((says("local", pose_at(1.0), NEAR),)))]))
    expected = load_body("neutral").joint_positions(pose_at(1.0)) @ ROTATION
    assert result.joints == pytest.approx(expected, abs=1e-6)
    assert result.joints.dtype == np.float32
    assert result.pose == pytest.approx(pose_at(1.0))


@pytest.mark.parametrize(("distance", "state", "sure"), [(0.2499, TRACKED, 0.7501), (0.25, LOST, 0.0)])
def test_a_best_hypothesis_over_the_threshold_is_a_loss(distance: float, state: int, sure: float) -> None:
    result = step(follower([FakeSearch("first", Proposal((says("local", pose_at(1.0), distance),)))]))
    assert result.state == state
    assert result.confidence == pytest.approx(np.full(20, sure), abs=1e-6)
    assert result.pose[0] == 1.0


def test_the_smoother_changes_what_is_reported_and_nothing_that_the_next_frame_goes_on_from() -> None:
    settings = SimpleNamespace(**(vars(SETTINGS) | {"smoothing": 1.0}))
    person = follower([FakeSearch("first", lambda state, best: Proposal((says("local", pose_at(float(x)), NEAR),)))],
                      settings=settings)  # fmt: skip
    x = 0.0
    step(person, timestamp=0.0)
    x = 1.0
    result = step(person, timestamp=1.0)
    share = 1.0 - np.exp(-1.0)
    assert result.pose[0] == pytest.approx(share)
    assert result.joints == pytest.approx(load_body("neutral").joint_positions(result.pose) @ ROTATION, abs=1e-6)
    assert person.state.pose is not None and person.state.pose[0] == 1.0
    assert person.state.smoothed is not None and person.state.smoothed[1] == 1.0


def test_a_restored_state_goes_on_as_the_one_that_was_exported() -> None:
    answer = Proposal((says("local", pose_at(1.0, left_elbow_ry=-0.5), NEAR, continues=True),), {"kept": np.arange(3)})
    first, second = FakeSearch("first", answer), FakeSearch("first", answer)
    one, other = follower([first], **followed()), follower([second])
    step(one)
    restore(other, plain(one), "person")
    assert str(plain(other)) == str(plain(one))
    assert other.state.previous is not None and other.state.previous.before is not None
    for person in (one, other):
        step(person, timestamp=2.0)
    assert first.draws[1:] == second.draws
    assert str(plain(one)) == str(plain(other))


@pytest.mark.parametrize("shown", [0, 20])
def test_a_joint_that_the_pose_shows_is_in_view_whatever_the_estimate_says(shown: int) -> None:
    """A hidden joint stays hidden until the estimate shows it; the estimate does not remove a visible one."""
    spread = np.where(np.arange(20) < shown, 0.0, 0.1)
    occluded_limbs = SimpleNamespace(guess=lambda pose, *_: Guess(pose, spread))
    search = FakeSearch("first", Proposal((says("local", pose_at(1.0)),)))
    person = follower([search], distances={1.0: NEAR}, occluded_limbs=occluded_limbs)
    step(person)
    assert person.state.in_view is not None
    assert person.state.in_view.tolist() == (np.ones(20) if shown else IN_VIEW).tolist()
