"""Pose prior conditioned on the situation: conditional Gaussians, situations, file, learning."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from database_builder.prior import learn_prior
from tests.database_helpers import known_without, neutral, random_poses, small_database
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.database.canonical import canonicalise
from toolkit.database.database import PoseDatabase
from toolkit.database.prior import HEIGHT, SITUATIONS, SIZE, UP, PosePrior, situations, variables
from toolkit.io.errors import DatabaseError
from toolkit.mocap.procedural import SEATED_MOTIONS, SEATED_SUBJECT_MOTIONS, procedural_clips

LEGS = tuple(f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "ankle"))


def random_prior(rng: np.random.Generator, count: int = 3) -> PosePrior:
    roots = rng.normal(0.0, 0.3, (count, SIZE, SIZE))
    covariances = np.einsum("kab,kcb->kac", roots, roots) + 0.2 * np.eye(SIZE)
    weights = rng.uniform(0.2, 1.0, count)
    situation = np.arange(count) % len(SITUATIONS)
    return PosePrior(weights / weights.sum(), rng.normal(0.0, 1.0, (count, SIZE)), covariances, situation)


def poses_of(names: tuple[str, ...], body: Body, seed: int = 0) -> np.ndarray:
    clips = procedural_clips(names, 6.0, body=body, variations=1, seed=seed)
    return canonicalise(np.concatenate([clip.poses for clip in clips]))[0]


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), share=st.floats(0.05, 0.95))
def test_the_expectation_is_that_of_the_textbook(seed: int, share: float) -> None:
    from scipy.stats import multivariate_normal

    rng = np.random.default_rng(seed)
    prior, values, known = random_prior(rng), rng.normal(0.0, 1.0, SIZE), rng.random(SIZE) < share
    known[:2] = True, False
    found = prior.expected(values, known, noise=0.3)
    densities, means, covariances = [], [], []
    for weight, mean, covariance in zip(prior.weights, prior.means, prior.covariances, strict=True):
        inner = covariance[np.ix_(known, known)] + 0.09 * np.eye(known.sum())
        densities.append(np.log(weight) + multivariate_normal(mean[known], inner).logpdf(values[known]))
        gain = covariance[np.ix_(~known, known)] @ np.linalg.inv(inner)
        means.append(mean[~known] + gain @ (values[known] - mean[known]))
        covariances.append(covariance[np.ix_(~known, ~known)] - gain @ covariance[np.ix_(known, ~known)])
    total = np.logaddexp.reduce(densities)
    shares = np.exp(densities - total)
    mean = shares @ np.array(means)
    spread = sum(s * (c + np.outer(m - mean, m - mean)) for s, c, m in zip(shares, covariances, means, strict=True))
    assert found.responsibilities == pytest.approx(shares, abs=1e-8)
    assert found.mean == pytest.approx(mean, abs=1e-7)
    assert found.covariance == pytest.approx(spread, abs=1e-7)
    assert np.array_equal(found.unknown, np.flatnonzero(~known))


def test_the_expectation_of_one_gaussian_is_the_mean_of_its_samples_near_the_known_values() -> None:
    rng = np.random.default_rng(0)
    prior = random_prior(rng, 1)
    known = np.zeros(SIZE, dtype=bool)
    known[[3, 7]] = True
    values = prior.means[0] + 0.5 * np.sqrt(np.diag(prior.covariances[0]))
    samples = rng.multivariate_normal(prior.means[0], prior.covariances[0], 400_000)
    near = samples[(np.abs(samples[:, known] - values[known]) < 0.05).all(axis=1)]
    found = prior.expected(values, known, noise=0.0)
    assert len(near) > 100
    error = np.abs(near[:, ~known].mean(axis=0) - found.mean) / np.sqrt(np.diag(found.covariance) / len(near))
    assert error.max() < 5.0


def test_everything_or_nothing_may_be_known() -> None:
    prior, values = random_prior(np.random.default_rng(1)), np.zeros(SIZE)
    nothing = prior.expected(values, np.zeros(SIZE, dtype=bool))
    assert nothing.mean == pytest.approx(prior.weights @ prior.means)
    assert nothing.responsibilities == pytest.approx(prior.weights)
    everything = prior.expected(values, np.ones(SIZE, dtype=bool))
    assert everything.mean.shape == (0,) and everything.covariance.shape == (0, 0)


def test_variables_are_the_joint_angles_the_vertical_and_the_height_of_the_pelvis() -> None:
    body = neutral()
    poses = random_poses(np.random.default_rng(4), 30)
    values = variables(poses, body)
    assert np.array_equal(values[:, : skeleton.POSE_SIZE - 6], poses[:, 6:])
    assert np.linalg.norm(values[:, UP], axis=1) == pytest.approx(np.ones(30))
    assert variables(canonicalise(poses)[0], body) == pytest.approx(values, abs=1e-9)  # independent of the place
    rest = variables(np.zeros(skeleton.POSE_SIZE), body)
    assert rest[UP] == pytest.approx([0.0, 1.0, 0.0]) and rest[HEIGHT] == pytest.approx(1.0)
    small = variables(poses, body.scaled(0.6))
    assert small == pytest.approx(values)


def test_standing_sitting_crouching_and_lying_are_separate_situations() -> None:
    body = neutral()

    def share(situation: str, poses: np.ndarray) -> float:
        return float((situations(variables(poses, body)) == SITUATIONS.index(situation)).mean())

    assert share("standing", poses_of(("walk", "wave", "arms_crossed", "clap_overhead"), body)) == 1.0
    assert share("seated", poses_of(SEATED_MOTIONS, body)) > 0.9
    kneeling = poses_of(("idle",), body)
    for side in ("left", "right"):
        kneeling[:, skeleton.POSE_NAMES.index(f"{side}_knee_rx")] = 1.6
    assert share("crouching", kneeling) == 1.0
    lying = poses_of(("idle",), body)
    lying[:, skeleton.ROOT_ROTATION] = [-1.5, 0.0, 0.0]
    assert share("lying", lying) == 1.0


def test_a_learnt_prior_recognises_sitting_by_thighs_and_floor() -> None:
    body = neutral()
    learnt = np.concatenate([poses_of(("walk", "wave", "boxing", "idle"), body), poses_of(SEATED_MOTIONS, body)])
    prior = learn_prior(learnt, body)
    assert prior is not None
    assert {SITUATIONS[s] for s in prior.situation} >= {"standing", "seated"}
    seated, standing = poses_of(SEATED_SUBJECT_MOTIONS, body), poses_of(("clap", "reach_up"), body)
    shins = tuple(name for name in LEGS if not name.endswith("hip"))
    for hidden, floor in ((shins, False), (LEGS, True)):
        known = known_without(hidden, floor=floor)
        for poses, name in ((seated, "seated"), (standing, "standing")):
            likely = np.array([prior.expected(v, known).responsibilities for v in variables(poses, body)])
            sure = likely[:, prior.situation == SITUATIONS.index(name)].sum(axis=1)
            assert sure.mean() > 0.8, (hidden, name)
    # bent knees for seated people, straight ones for standing people
    knee = skeleton.POSE_NAMES.index("left_knee_rx") - 6
    for poses, low, high in ((seated, 0.9, 2.0), (standing, -0.1, 0.5)):
        found = [prior.expected(v, known_without(shins)) for v in variables(poses, body)]
        bends = [one.mean[list(one.unknown).index(knee)] for one in found]
        assert low < np.median(bends) < high


def test_a_prior_is_the_same_to_the_bit_for_any_number_of_threads() -> None:
    from threadpoolctl import threadpool_limits

    body = neutral()
    rng = np.random.default_rng(0)
    poses = np.tile(poses_of(("walk", "wave", "boxing", "idle"), body), (8, 1))
    poses[:, 6:] += rng.normal(0.0, 0.15, poses[:, 6:].shape)
    learnt = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            learnt.append(learn_prior(poses, body))
    one, two = learnt
    assert one is not None and two is not None
    for name in ("weights", "means", "covariances"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes(), name


def test_a_database_file_keeps_its_prior_and_one_without_opens(tmp_path: Path) -> None:
    from dataclasses import replace

    database, prior = small_database(60), random_prior(np.random.default_rng(5))
    database.save(tmp_path / "old.npz")
    assert PoseDatabase.load(tmp_path / "old.npz").prior is None
    replace(database, prior=prior).save(tmp_path / "new.npz")
    read = PoseDatabase.load(tmp_path / "new.npz").prior
    assert read is not None
    assert read.means == pytest.approx(prior.means, abs=1e-6)
    assert np.array_equal(read.situation, prior.situation)
    values, known = np.zeros(SIZE), known_without(LEGS)
    assert read.expected(values, known).mean == pytest.approx(prior.expected(values, known).mean, abs=1e-4)


def test_a_prior_that_does_not_fit_is_refused() -> None:
    arrays = random_prior(np.random.default_rng(6)).arrays()
    with pytest.raises(DatabaseError, match="lacks 'means'"):
        PosePrior.of_arrays({name: array for name, array in arrays.items() if name != "means"})
    with pytest.raises(DatabaseError, match="means of the pose prior has shape"):
        PosePrior.of_arrays(arrays | {"means": arrays["means"][:, :-1]})
    with pytest.raises(DatabaseError, match="not finite"):
        PosePrior.of_arrays(arrays | {"covariances": np.full_like(arrays["covariances"], np.nan)})
    with pytest.raises(DatabaseError, match="situation of the pose prior is <U4"):
        PosePrior.of_arrays(arrays | {"situation": arrays["situation"].astype("U4")})
