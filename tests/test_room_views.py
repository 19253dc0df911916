"""Training views of rooms, and person pixels of a forest trained on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from database_builder.calibration import room_probability
from database_builder.images import draw_images
from database_builder.regressor import RegressorSettings, leaf_votes, train_regressor
from database_builder.room_views import NO_PERSON, OTHER, SHELL, SUBJECT, RoomPainter, lossy
from database_builder.views import RoomSettings, ViewSettings, is_seated, project_level
from toolkit.body import skeleton
from toolkit.body.shape import ShapeSpace, load_body
from toolkit.database import canonical
from toolkit.io.errors import DatabaseError, SettingsError
from toolkit.kernels.learning import forest
from toolkit.landmarks.regressor import JointRegressor
from toolkit.mocap.procedural import procedural_clips

ROOMS = ViewSettings(rooms=1.0, room=RoomSettings(empty=0.0, cut=0.0))


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    """Return canonical poses (N, P) of people who walk, wave and sit."""
    clips = procedural_clips(["walk", "wave", "seated_talking"], 5.0, body=load_body("neutral"), variations=1)
    return canonical.canonicalise(np.concatenate([clip.poses for clip in clips]))[0]


def painter(poses: np.ndarray, settings: ViewSettings) -> RoomPainter:
    return RoomPainter(poses, is_seated(poses, ShapeSpace.load().body()), settings)


def test_a_view_shows_people_before_furniture_and_walls_where_their_joints_say(poses: np.ndarray) -> None:
    rng, rooms = np.random.default_rng(1), painter(poses, ROOMS)
    owners: set[int] = set()
    near = []
    for _ in range(25):
        view = rooms.draw(rng)
        owners |= set(np.unique(view.owner))
        labels = rooms.label_image(view)
        assert ((labels < NO_PERSON) == (view.owner == SUBJECT)).all()
        assert (view.no_person == (view.owner >= SHELL)).all()
        seen = project_level(view.joints)
        u, v = np.rint(seen[:, :2] - view.corner).astype(int).T
        for joint in np.flatnonzero(view.in_view):
            if view.owner[v[joint], u[joint]] == SUBJECT and 0 < view.depth[v[joint], u[joint]] < forest.UNOBSERVED:
                near.append(abs(view.depth[v[joint], u[joint]] * 0.001 + view.joints[joint, 2]))
    assert {SUBJECT, OTHER, SHELL} < owners and max(owners) > 5
    assert len(near) > 50 and np.median(near) < 0.15


def test_rooms_without_people_hold_none_and_cut_out_views_hold_little(poses: np.ndarray) -> None:
    rng = np.random.default_rng(2)
    empty = painter(poses, replace(ROOMS, room=RoomSettings(empty=1.0, cut=0.0)))
    cut = painter(poses, replace(ROOMS, room=RoomSettings(empty=0.0, cut=1.0)))
    whole, left = [], []
    for _ in range(10):
        view = empty.draw(rng)
        assert not (view.owner < SHELL).any() and not view.in_view.any()
        whole.append((view.depth > 0).mean())
        view = cut.draw(rng)
        left.append(((view.depth > 0) & (view.depth < forest.UNOBSERVED)).mean())
    assert np.mean(left) < 0.5 * np.mean(whole)


def test_a_sensor_loses_glass_black_grazing_and_far_surfaces() -> None:
    flat = np.full((20, 200), 1.0 / 2.5)
    share = {}
    for name, cosine, reflectance, inverse in (
        ("plain", 1.0, 0.6, flat), ("glass", 1.0, 0.0, flat), ("black", 1.0, 0.04, flat), ("grazing", 0.02, 0.6, flat),
        ("far", 1.0, 0.6, flat * 0.2),
    ):  # fmt: skip
        measured = [
            (
                lossy(inverse, np.full(flat.shape, cosine), np.full(flat.shape, reflectance), np.random.default_rng(s))
                > 0
            )
            for s in range(20)
        ]
        share[name] = float(np.mean(measured))
    assert share["plain"] > 0.9 and share["glass"] == share["far"] == 0.0
    assert 0.1 < share["black"] < 0.9 and share["grazing"] < 0.5


def test_half_of_the_samples_of_a_room_with_a_person_are_of_no_person(poses: np.ndarray) -> None:
    silent = lambda done, total: None  # noqa: E731
    data = draw_images(poses, ROOMS, 20, 80, np.random.default_rng(3), silent)
    person = data.labels != NO_PERSON
    assert 0.25 < person.mean() < 0.6
    metres = data.depth[
        data.starts[data.sample_image] + data.sample_v * data.shapes[data.sample_image, 1] + data.sample_u
    ]
    assert (metres > 0).all() and (metres < forest.UNOBSERVED).all()
    rows = np.concatenate([np.flatnonzero(person)[:30], np.flatnonzero(~person)[:40]])
    mean, variance, share, people = leaf_votes(data, rows, [0, 30, 60, 70])
    assert people.tolist() == [1.0, 0.0, 0.0]
    assert np.isfinite(variance[0]).all() and np.isinf(variance[1:]).all() and (share[1:] == 0.5).all()
    mixed = leaf_votes(data, rows, [0, 40, 70])
    assert mixed[3][0] == pytest.approx(0.75) and np.allclose(mixed[0][0], mean[0], atol=1e-4)


@pytest.fixture(scope="module")
def trained(poses: np.ndarray) -> JointRegressor:
    settings = RegressorSettings(
        images=260, pixels=80, trees=2, depth=12, smallest_leaf=15, questions=40, node_samples=600, calibration=30,
        views=ViewSettings(rooms=0.8),
    )  # fmt: skip
    return train_regressor(poses, settings, seed=1)


def test_people_are_separated_from_furniture_and_walls_in_unseen_rooms(
    trained: JointRegressor, poses: np.ndarray
) -> None:
    rng, rooms = np.random.default_rng(99), painter(poses, ROOMS)
    person, rest = [], []
    for _ in range(20):
        view = rooms.draw(rng)
        pixels = rng.choice(np.flatnonzero(view.depth > 0), 300)
        found = room_probability(trained, view, pixels)
        owner = view.owner.ravel()[pixels]
        person.append(found[owner < SHELL])
        rest.append(found[owner >= SHELL])
    yes, no = np.concatenate(person), np.concatenate(rest)
    assert ((yes >= 0) & (yes <= 1)).all()
    assert (yes[:, None] > no[None]).mean() > 0.8
    assert yes.mean() > 0.55 and no.mean() < 0.4


def test_a_forest_whose_shares_of_people_do_not_fit_its_leaves_is_refused(trained: JointRegressor) -> None:
    with pytest.raises(DatabaseError, match="leaf_person"):
        replace(trained, leaf_person=np.zeros(3, dtype=np.uint8))


def test_a_share_of_rooms_outside_its_range_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"empty is -0.1"):
        RoomSettings(empty=-0.1)
    with pytest.raises(SettingsError, match=r"rooms is 1.2"):
        ViewSettings(rooms=1.2)


def test_labels_of_people_lie_below_that_of_no_person() -> None:
    assert NO_PERSON == 2 * len(skeleton.JOINT_NAMES)
