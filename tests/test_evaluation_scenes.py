"""Scores of scenes: visible joints, identities, calibration of confidences."""

from itertools import permutations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.run_helpers import track_of
from tests.support.calibration import calibration_error
from tests.support.identities import identities_of
from tests.support.scene_scores import scene_figures, score_scene
from toolkit.people.known_people import assigned
from toolkit.sensing.camera import Camera
from toolkit.tracks import EMPTY, TRACKED

CAMERA = Camera(100.0, 100.0, 40.0, 30.0, 81, 61)
PERSON = np.stack([np.linspace(-0.2, 0.2, 20), np.linspace(-0.4, 0.4, 20), np.full(20, 2.1)], axis=1)
"""Twenty joints 10 cm behind a wall at 2 m, 40 cm wide and 80 cm high."""


def recording_of(truth: np.ndarray, wall: float = 2.0) -> Any:
    """Return a wall before the people of `truth` (N, T, 20, 3), at 10 frames a second."""
    frames = truth.shape[1]
    return SimpleNamespace(
        name="scene",
        path="scene.npz",
        camera=CAMERA,
        joints=truth.astype(np.float32),
        timestamps=np.arange(frames) / 10.0,
        frames=lambda: iter(np.full((frames, *CAMERA.shape), round(1000 * wall), dtype=np.uint16)),
    )


def moved(x: float, frames: int = 4) -> np.ndarray:
    """Return the person standing `x` metres to the right for some frames: (T, 20, 3)."""
    return np.tile(PERSON + [x, 0.0, 0.0], (frames, 1, 1))


@settings(deadline=None)
@given(st.integers(0, 4), st.integers(0, 4), st.integers(0, 1000))
def test_the_assignment_is_the_cheapest_of_all_that_use_as_many_allowed_pairs_as_can_be(
    n: int, m: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    costs = np.where(rng.random((n, m)) < 0.3, np.inf, rng.random((n, m)))
    chosen = assigned(costs, np.ones(n))
    best = (0, 0.0)
    for order in permutations([*range(m), *[-1] * n], n):
        pairs = [(i, j) for i, j in enumerate(order) if j >= 0]
        values = [costs[i, j] for i, j in pairs]
        if np.isfinite(values).all():
            best = min(best, (-len(pairs), float(sum(values))))
    assert (-len(chosen), pytest.approx(best[1])) == (best[0], sum(costs[i, j] for i, j in chosen))


def test_a_match_lasts_while_it_is_within_the_gate_even_if_another_track_is_nearer() -> None:
    distances = np.array([[[0.1, 0.4]], [[0.4, 0.1]], [[0.6, 0.1]]])
    found = identities_of(distances, np.ones((3, 1), bool), np.ones((3, 2), bool))
    assert found.track_of[:, 0].tolist() == [0, 0, 1]
    assert (found.switches, found.misses, found.false) == (1, 0, 3)


def test_who_is_lost_and_found_again_by_the_same_track_has_not_switched() -> None:
    distances = np.array([[[0.1]], [[0.9]], [[0.1]]])
    found = identities_of(distances, np.ones((3, 1), bool), np.ones((3, 1), bool))
    assert found.track_of[:, 0].tolist() == [0, -1, 0]
    assert (found.switches, found.misses, found.false) == (0, 1, 1)


def test_who_is_found_again_by_another_track_after_a_gap_has_switched() -> None:
    absent = np.nan
    distances = np.array([[[0.1, absent]], [[absent, absent]], [[absent, 0.1]]])
    found = identities_of(distances, np.ones((3, 1), bool), np.isfinite(distances[:, 0]))
    assert found.track_of[:, 0].tolist() == [0, -1, 1]
    assert (found.switches, found.misses, found.false) == (1, 1, 0)


def test_tracks_that_change_places_are_two_switches() -> None:
    near, far = 0.1, 0.9
    distances = np.array([[[near, far], [far, near]], [[far, near], [near, far]]])
    found = identities_of(distances, np.ones((2, 2), bool), np.ones((2, 2), bool))
    assert (found.switches, found.misses, found.false) == (2, 0, 0)


def test_an_optional_person_is_neither_missed_nor_a_false_track() -> None:
    distances = np.array([[[0.1]], [[np.nan]]])
    found = identities_of(distances, np.zeros((2, 1), bool), np.array([[True], [False]]))
    assert (found.misses, found.false) == (0, 0)


def test_a_calibrated_confidence_has_no_calibration_error_and_boasting_has() -> None:
    confidence = np.repeat([0.25, 0.75], 4)
    assert calibration_error(confidence, np.array([1, 0, 0, 0, 1, 1, 1, 0], bool)) == pytest.approx(0.0)
    assert calibration_error(np.full(10, 0.8), np.zeros(10, bool)) == pytest.approx(0.8)
    assert np.isnan(calibration_error(np.empty(0), np.empty(0, bool)))


def test_people_and_tracks_are_matched_in_any_order_and_who_is_not_found_is_a_metre_off() -> None:
    truth = np.stack([moved(-0.3), moved(0.3)])
    recording = recording_of(truth)
    right = scene_figures([score_scene(recording, [track_of(truth[1]), track_of(truth[0])])])
    assert right["error_mm"] == pytest.approx(0.0, abs=1e-3) and right["a100"] == 1.0
    assert right["found_soon"] == right["numbers_right"] == 1.0
    one = scene_figures([score_scene(recording, [track_of(truth[1])])])
    assert one["error_mm"] == pytest.approx(500.0, abs=1e-3) and one["a100"] == 0.5
    assert (one["misses"], one["false"], one["switches"]) == (4, 0, 0)
    assert one["found_soon"] == 0.5 and one["numbers_right"] == 0.0


def test_joints_that_are_not_seen_do_not_enter_the_error_but_the_calibration() -> None:
    truth = moved(0.0)[None].copy()
    truth[0, :, 15:, 2] += 0.5  # behind the wall
    guess = truth[0].copy()
    guess[:, 15:] += [0.0, 0.0, 0.3]
    figures = scene_figures([score_scene(recording_of(truth), [track_of(guess, confidence=0.8)])])
    assert figures["error_mm"] == pytest.approx(0.0, abs=1e-3)
    assert figures["unobserved"] == figures["unobserved_sure"] == 4 * 5
    assert figures["unobserved_sure_a100"] == 0.0
    assert figures["unobserved_mm"] == pytest.approx(300.0, abs=1e-2)
    assert figures["ece"] == pytest.approx(abs(0.8 - 15 / 20), abs=1e-6)


def test_a_delay_lasts_from_visibility_to_the_first_tracked_frame() -> None:
    truth = moved(0.0, frames=12)[None].copy()
    truth[0, :2] = np.nan
    late = np.where(np.arange(12) < 8, EMPTY, TRACKED)
    score = score_scene(recording_of(truth), [track_of(np.nan_to_num(truth[0]), state=late)])
    assert score.delays[0] == pytest.approx(0.6)
    assert score.numbers_right.tolist() == [True] * 2 + [False] * 6 + [True] * 4
    never = score_scene(recording_of(truth), [])
    assert np.isinf(never.delays[0]) and scene_figures([never])["found_soon"] == 0.0
    assert scene_figures([never])["error_mm"] == pytest.approx(1000.0)


def test_a_false_track_is_counted_in_an_empty_room() -> None:
    empty = recording_of(np.empty((0, 4, 20, 3)))
    figures = scene_figures([score_scene(empty, []), score_scene(empty, [track_of(moved(0.0))])])
    assert (figures["recordings"], figures["recordings_tracked"], figures["false"]) == (2, 1, 4)
    assert figures["tracked"] == figures["numbers_right"] == 0.5
    assert figures["error_mm"] is figures["ece"] is None
