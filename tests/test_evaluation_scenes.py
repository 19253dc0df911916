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


@pytest.mark.parametrize(
    ("distances", "active", "tracks", "counts"),
    [  # a match lasts while it is within the gate, even if another track is nearer
        ([[[0.1, 0.4]], [[0.4, 0.1]], [[0.6, 0.1]]], np.ones((3, 2)), [[0], [0], [1]], (1, 0, 3)),
        # a person who is lost and found by the same track has not switched, by another track after a gap has
        ([[[0.1]], [[0.9]], [[0.1]]], np.ones((3, 1)), [[0], [-1], [0]], (0, 1, 1)),
        ([[[0.1, np.nan]], [[np.nan] * 2], [[np.nan, 0.1]]], [[1, 0], [0, 0], [0, 1]], [[0], [-1], [1]], (1, 1, 0)),
        # tracks that change places are two switches
        ([[[0.1, 0.9], [0.9, 0.1]], [[0.9, 0.1], [0.1, 0.9]]], np.ones((2, 2)), [[0, 1], [1, 0]], (2, 0, 0)),
    ],
)
def test_identities_switch_only_at_the_end_of_a_match(distances: Any, active: Any, tracks: Any, counts: Any) -> None:
    there = np.ones(np.shape(distances)[:2], bool)
    found = identities_of(np.array(distances), there, np.array(active, bool))
    assert found.track_of.tolist() == tracks
    assert (found.switches, found.misses, found.false) == counts


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


def test_joints_that_are_not_seen_do_not_enter_the_error() -> None:
    truth = moved(0.0)[None].copy()
    truth[0, :, 15:, 2] += 0.5  # behind the wall
    guess = truth[0].copy()
    guess[:, 15:] += [0.0, 0.0, 0.3]
    figures = scene_figures([score_scene(recording_of(truth), [track_of(guess, confidence=0.8)])])
    assert figures["error_mm"] == pytest.approx(0.0, abs=1e-3)
    assert figures["unobserved_sure_a100"] == 0.0


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
    assert (figures["recordings"], figures["false"], figures["numbers_right"]) == (2, 4, 0.5)
    assert figures["error_mm"] is None
