"""Particle swarm: results and invariants."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import TypedReader
from toolkit.trackers.qammaz.swarm import SwarmSettings, minimise

SWARM = SwarmSettings()


def box(size, reach=5.0):
    return np.tile([-reach, reach], (size, 1))


def bowl(positions):
    return ((positions - 1.5) ** 2).sum(axis=1)


def rastrigin(positions):
    return 10.0 * positions.shape[1] + (positions**2 - 10.0 * np.cos(2 * np.pi * positions)).sum(axis=1)


class Watched:
    """Cost function that keeps each generation."""

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


def test_the_constriction_is_that_of_the_paper():
    assert SWARM.constriction == pytest.approx(0.7298, abs=5e-5)


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


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"particles": 0}, "give at least 1"),
        ({"generations": 0}, "give at least 1"),
        ({"own": 1.0}, "contracts"),
        ({"shared": -1.0, "own": 6.0}, "shared is -1; give at least 0"),
        ({"perturbed_share": 1.5}, "outside 0 to 1"),
        ({"perturbed_every": -1}, "give at least 0"),
    ],
)
def test_settings_that_make_no_swarm_are_refused(wrong, said):
    with pytest.raises(SettingsError, match=said):
        TypedReader(SettingsError).read(wrong, SwarmSettings, "swarm")
