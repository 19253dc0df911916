"""Random rooms, and the ground under people."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.motion.contact import ground_of
from toolkit.simulation.mesh import Mesh, box, joined, moved
from toolkit.tracks import LOST, TRACKED
from training.interiors.pieces import GLASS, PIECES, SEATS
from training.interiors.room import KINDS, furnished
from training.interiors.shapes import cushion, post, slab


def volume(mesh: Mesh) -> float:
    corners = mesh.vertices[mesh.faces]
    return float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0)


def test_surfaces_look_outwards_and_enclose_what_they_should() -> None:
    rng = np.random.default_rng(0)
    assert volume(box((0, 0, 0), (1, 2, 3))) == pytest.approx(6.0)
    assert volume(slab((5, 1, 0), (1, 2, 0.1), 0.3)) == pytest.approx(0.2)
    assert volume(post(0.1, 0.0, 1.0, 60)) == pytest.approx(np.pi * 0.01, rel=0.01)
    soft = cushion((0, 0, 0), (1, 1, 1), rng, 0.0)
    assert 0.6 < volume(soft) < 1.0 and np.abs(soft.vertices).max() < 0.56
    assert volume(joined([moved(soft, 3.0, yaw=1.0), soft])) == pytest.approx(2 * volume(soft))


@pytest.mark.parametrize("kind", PIECES)
def test_every_piece_stands_on_the_floor_and_is_as_large_as_furniture(kind: str) -> None:
    for seed in range(5):
        parts = PIECES[kind](np.random.default_rng(seed))
        points = np.concatenate([part.mesh.vertices for part in parts])
        assert points[:, 1].min() > -0.05 and points[:, 1].max() < 2.8
        assert (np.ptp(points, axis=0) < 3.2).all() and np.isfinite(points).all()
        assert all(0.0 <= part.reflectance <= 1.0 for part in parts)


@pytest.mark.parametrize("kind", SEATS)
def test_a_seat_has_the_given_height(kind: str) -> None:
    for seat in (0.3, 0.5):
        parts = PIECES[kind](np.random.default_rng(3), seat)  # type: ignore[call-arg]
        points = parts[0].mesh.vertices
        assert np.abs(points[:, 1] - seat).min() < 0.03


@settings(max_examples=12, deadline=None)
@given(st.sampled_from(sorted(KINDS)), st.integers(0, 10_000))
def test_a_room_holds_camera_and_people_and_keeps_their_space_free(kind: str, seed: int) -> None:
    reach, camera = np.array([[-1.0, 0.0, -0.6], [0.8, 1.9, 0.7]]), (0.2, 2.6)
    path = np.stack([np.linspace(-0.9, 0.7, 20), np.linspace(-0.5, 0.6, 20)], axis=1)
    room = furnished(kind, np.random.default_rng(seed), camera=camera, reach=reach, free=path, clearance=0.3)
    assert (room.low <= reach[0]).all() and (room.high >= reach[1]).all()
    assert room.low[0] < camera[0] < room.high[0] and room.high[2] > camera[1]
    for piece in room.standing:
        points = np.concatenate([part.mesh.vertices for part in piece.parts])[:, [0, 2]]
        assert np.linalg.norm(points[:, None] - path[None], axis=-1).min() >= 0.3 - 1e-9
        assert np.linalg.norm(points - camera, axis=1).min() > 0.3
        assert (points > room.low[[0, 2]] - 0.05).all() and (points < room.high[[0, 2]] + 0.05).all()


def test_faces_know_their_material_and_piece_and_pieces_can_be_left_out() -> None:
    room = furnished("living", np.random.default_rng(2))
    whole = room.surfaces()
    assert len(whole.reflectance) == len(whole.piece) == len(whole.mesh.faces)
    assert set(whole.piece) == set(range(-1, len(room.standing)))
    assert any(part.reflectance == GLASS for piece in room.standing for part in piece.parts if piece.kind == "window")
    bare = room.surfaces(np.array([[x, z] for x in range(-5, 6) for z in range(-5, 6)], dtype=float), 2.0)
    assert set(bare.piece) == {-1}


def test_floor_walls_and_ceiling_have_the_finish_of_the_room() -> None:
    room = replace(furnished("office", np.random.default_rng(3)), standing=(), finish=(0.2, 0.5, 0.8))
    found = room.surfaces()
    heights = found.mesh.vertices[found.mesh.faces][..., 1]
    floor, ceiling = (heights == 0.0).all(axis=1), (heights == room.high[1]).all(axis=1)
    assert floor.any() and ceiling.any() and not (floor | ceiling).all()
    expected = np.where(floor, 0.2, np.where(ceiling, 0.8, 0.5)).astype(np.float32)
    assert np.array_equal(found.reflectance, expected)


BODY = load_body("neutral")
STANDING_HIPS = -float(BODY.vertices[:, 1].min())


def somebody(height: float | None, *, feet: bool = True, there: bool = True, state: int = TRACKED) -> Any:
    poses = np.zeros((30, skeleton.POSE_SIZE))
    poses[:, 1] = 0.2
    track = SimpleNamespace(
        pose=poses,
        timestamps=np.arange(30) / 30,
        state=np.full(30, state),
        observed=np.full((30, len(skeleton.REPORTED)), feet),
    )
    return SimpleNamespace(camera_height=height, track=track, body=BODY, there=np.full(30, there))


def test_the_ground_is_where_the_camera_saw_it_else_where_feet_rest_else_guessed() -> None:
    below = 0.2 - STANDING_HIPS
    assert ground_of([somebody(None), somebody(1.3)]) == (-1.3, "seen by the camera")
    height, how = ground_of([somebody(None)])
    assert height == pytest.approx(below, abs=0.02) and how == "where the feet rest"
    for person in (somebody(None, feet=False), somebody(None, state=LOST)):
        height, how = ground_of([person])
        assert height == pytest.approx(below, abs=0.02) and how == "guessed"
    assert ground_of([somebody(None, feet=False, there=False)]) == (0.0, "guessed")
