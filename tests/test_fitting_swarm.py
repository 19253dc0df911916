"""The particle swarm: what it finds, and what it never does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.io.errors import SettingsError
from toolkit.trackers.qammaz.swarm import SwarmSettings, minimise

SWARM = SwarmSettings()


def box(size, reach=5.0):
    return np.tile([-reach, reach], (size, 1))


def bowl(positions):
    return ((positions - 1.5) ** 2).sum(axis=1)


def rastrigin(positions):
    return 10.0 * positions.shape[1] + (positions**2 - 10.0 * np.cos(2 * np.pi * positions)).sum(axis=1)


class Watched:
    """A cost function that keeps every generation it was asked for."""

    def __init__(self, costs):
        self.costs, self.asked = costs, []

    def __call__(self, positions):
        self.asked.append(positions.copy())
        return self.costs(positions)


def test_the_minimum_of_a_bowl_is_found():
    swarm = SwarmSettings(generations=100, perturbed_every=0)
    found = minimise(bowl, np.zeros((1, 4)), box(4), swarm, np.random.default_rng(0))
    assert np.abs(found.position - 1.5).max() < 1e-3
    assert found.cost == bowl(found.position[None])[0]


def test_on_rastrigin_it_beats_as_many_random_tries():
    swarm = SwarmSettings()
    tries = swarm.particles * (swarm.generations + 1)
    won = 0
    for seed in range(20):
        found = minimise(rastrigin, np.empty((0, 10)), box(10), swarm, np.random.default_rng(seed))
        won += found.cost < rastrigin(np.random.default_rng(100 + seed).uniform(-5, 5, (tries, 10))).min()
    assert won == 20


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), every=st.integers(0, 4), particles=st.integers(1, 9))
def test_the_best_never_rises_and_limits_hold_always(seed, every, particles):
    limits = np.array([[-1.0, 2.0], [0.0, 0.0], [-0.1, 0.05]])
    watched = Watched(bowl)
    swarm = SwarmSettings(particles, 8, perturbed_every=every)
    found = minimise(watched, np.full((1, 3), 9.0), limits, swarm, np.random.default_rng(seed))
    assert (np.diff(found.history) <= 0.0).all()
    visited = np.concatenate(watched.asked)
    assert len(visited) == particles * 9
    assert (visited >= limits[:, 0]).all() and (visited <= limits[:, 1]).all()
    assert found.cost == bowl(visited).min()


def test_it_is_never_worse_than_where_the_first_particle_begins():
    start = np.full((1, 10), 1e-3)
    found = minimise(rastrigin, start, box(10), SwarmSettings(8, 3), np.random.default_rng(3))
    assert found.cost <= rastrigin(start)[0]


def test_one_particle_in_one_generation_works():
    found = minimise(bowl, np.zeros((1, 2)), box(2), SwarmSettings(1, 1), np.random.default_rng(0))
    assert found.cost <= bowl(np.zeros((1, 2)))[0]


def test_the_constriction_is_that_of_the_paper():
    assert SWARM.constriction == pytest.approx(0.7298, abs=5e-5)


def test_a_velocity_is_cut_at_the_limits_and_not_reflected():
    """Beyond the right limit everything is better: particles come to rest at it, and leave it no more."""
    watched = Watched(lambda positions: -positions[:, 0])
    swarm = SwarmSettings(6, 30, perturbed_every=0)
    minimise(watched, np.empty((0, 1)), np.array([[0.0, 1.0]]), swarm, np.random.default_rng(0))
    paths = np.stack(watched.asked)[:, :, 0]
    there = np.maximum.accumulate(paths == 1.0, axis=0)
    assert there[-1].sum() >= 5
    assert (paths[there] == 1.0).all()


def test_positions_and_velocities_follow_the_equations():
    """Against Eq. 7 and 8 written out for each particle and entry, w on the whole sum."""
    swarm, limits = SwarmSettings(4, 6, perturbed_every=0), box(3, reach=1.0)
    watched = Watched(rastrigin)
    minimise(watched, np.zeros((1, 3)), limits, swarm, np.random.default_rng(7))
    rng = np.random.default_rng(7)
    p = rng.uniform(-1.0, 1.0, (4, 3))
    p[0] = 0.0
    v, own = np.zeros((4, 3)), p.copy()
    for generation in range(1, 7):
        r = rng.random((2, 4, 3))
        best = own[int(rastrigin(own).argmin())].copy()
        for i in range(4):
            for d in range(3):
                pull = 2.8 * r[0, i, d] * (own[i, d] - p[i, d]) + 1.3 * r[1, i, d] * (best[d] - p[i, d])
                v[i, d] = 0.7298437881 * (v[i, d] + pull)
                v[i, d] = min(max(v[i, d], -1.0 - p[i, d]), 1.0 - p[i, d])
                p[i, d] += v[i, d]
        np.testing.assert_allclose(watched.asked[generation], p, atol=1e-7)
        for i in range(4):
            if rastrigin(p[i : i + 1])[0] < rastrigin(own[i : i + 1])[0]:
                own[i] = p[i]


def test_a_perturbation_moves_the_said_share_by_one_entry_each():
    flat = Watched(lambda positions: np.zeros(len(positions)))
    swarm = SwarmSettings(10, 1, perturbed_every=1, perturbed_share=0.3)
    starts = np.full((10, 5), 0.25)
    minimise(flat, starts, box(5), swarm, np.random.default_rng(0), perturbed=np.array([2, 4]))
    moved = flat.asked[1] != starts
    # All begin at the same place, which is the best for all: nothing else moves them.
    assert moved.sum(axis=1).tolist().count(1) == 3 and moved.sum() == 3
    assert not moved[:, [0, 1, 3]].any()


def test_the_same_generator_finds_the_same():
    first, second = (minimise(rastrigin, np.zeros((1, 6)), box(6), SWARM, np.random.default_rng(5)) for _ in range(2))
    assert np.array_equal(first.position, second.position) and np.array_equal(first.history, second.history)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"particles": 0}, "at least 1"),
        ({"generations": 0}, "at least 1"),
        ({"own": 1.0}, "contracts"),
        ({"shared": -1.0, "own": 6.0}, "at least 0"),
        ({"perturbed_share": 1.5}, "share"),
        ({"perturbed_every": -1}, "at least 0"),
    ],
)
def test_settings_that_make_no_swarm_are_refused(wrong, said):
    with pytest.raises(SettingsError, match=said):
        SwarmSettings(**wrong)
