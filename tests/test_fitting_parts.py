"""The loop of a fit, the comparison and the shape estimate with fake parts: inputs and results of each."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pytest

from tests.fitting_helpers import back_projected, whole_image
from tests.poses import pose_at
from toolkit.body.shape import ShapeSpace, load_body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.placed import Placer
from toolkit.fitting.scene import Scene
from toolkit.fitting.shape import MESH_NOISE, ShapeEstimator, ShapeSettings
from toolkit.fitting.terms import Pairs
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud, cropped

CAMERA = Camera(60.0, 60.0, 39.5, 29.5, 80, 60)
LEVEL = np.diag([1.0, -1.0, -1.0])
SETTINGS = FittingSettings()
BODY = load_body("neutral")


standing = partial(pose_at, (0.0, 0.0, -3.0))


@pytest.fixture(scope="module")
def placer() -> Placer:
    return Placer(BODY, CAMERA, LEVEL)


@pytest.fixture(scope="module")
def scene(placer: Placer) -> Scene:
    """Return the standing body as seen by the camera."""
    return scene_of(placer, None)


def scene_of(placer: Placer, unobserved: np.ndarray | None) -> Scene:
    """Return the standing body, measured only where not `unobserved`."""
    depth = whole_image(placer.place(BODY, standing()))[0].astype(np.float32)
    if unobserved is not None:
        depth[unobserved] = 0.0
    cloud = Cloud.from_depth(depth, CAMERA, LEVEL)
    return Scene(cloud, cloud.points[[0, -1]].astype(np.float64), 50, unobserved=unobserved)


def test_the_part_of_an_image_that_holds_a_person_has_their_points_to_the_bit() -> None:
    depth = np.zeros((30, 40), dtype=np.float32)
    depth[4:11, 20:33] = np.random.default_rng(0).uniform(0.0, 3.0, (7, 13)) * (np.arange(13) % 3 > 0)
    intrinsics = np.array([41.0, 43.0, 19.37, 14.81])
    part, own = cropped(depth, intrinsics)
    assert part.shape == (7, 11) and part.flags.c_contiguous
    assert np.array_equal(back_projected(part, own)[0], back_projected(depth, intrinsics)[0])
    nothing, same = cropped(np.zeros_like(depth), intrinsics)
    assert nothing.size == 0 and np.array_equal(same, intrinsics)


# The loop


# The shape


@dataclass
class FakeMesh:
    """Pairs of a body with other coefficients, at chosen vertices."""

    wanted: np.ndarray
    pose: np.ndarray
    placer: Placer
    weight: float = 1.0

    def pairs(self, placed: Any, scene: Any) -> Pairs:
        vertex = self.placer.chosen
        target = self.placer.place(ShapeSpace.load().body(self.wanted), self.pose).vertices
        return Pairs(vertex, (placed.vertices - target)[vertex], np.full(len(vertex), self.weight))


def estimates(placer: Placer, settings: ShapeSettings, shapes: list[np.ndarray], weight: float) -> list[np.ndarray]:
    """Return coefficients after each frame, in which the person looks like one of `shapes`."""
    pose = standing()
    mesh = FakeMesh(shapes[0], pose, placer, weight)
    estimator = ShapeEstimator(ShapeSpace.load().body(), settings, placer, [mesh])
    found = []
    for shape in shapes:
        mesh.wanted = shape
        estimator.observe(pose, None)  # type: ignore[arg-type]
        found.append(estimator.coefficients.copy())
    return found


def test_a_frame_that_shows_nothing_of_the_body_leaves_the_likeliest_of_its_size(placer: Placer) -> None:
    class Hidden:
        def pairs(self, placed: Any, scene: Any) -> Pairs:
            return Pairs(np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty(0))

    estimator = ShapeEstimator(BODY, ShapeSettings(), placer, [Hidden()])
    estimator.observe(standing(), None)  # type: ignore[arg-type]
    likeliest = ShapeSpace.load().childhood(float(BODY.shape[0]))
    np.testing.assert_allclose(estimator.coefficients, likeliest, atol=1e-9)


def expected(placer: Placer, settings: ShapeSettings, shapes: list[np.ndarray], weight: float) -> list[np.ndarray]:
    """Return the same by dense least squares: along normals of the old body, with forgetting, the mean as prior."""
    space, pose, vertex = ShapeSpace.load(), standing(), placer.chosen
    size = space.size
    matrix, vector, coefficients = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    found = []
    for shape in shapes:
        now = placer.place(space.body(coefficients), pose)
        unit = [placer.place(space.body(coefficients + row), pose).vertices for row in np.eye(size)]
        columns = np.stack([((moved - now.vertices) * now.normals).sum(axis=1)[vertex] for moved in unit], axis=1)
        target = placer.place(space.body(shape), pose).vertices
        residual = ((target - now.vertices) * now.normals).sum(axis=1)[vertex]
        scale = weight / MESH_NOISE**2
        matrix = settings.forgetting * matrix + scale * columns.T @ columns
        vector = settings.forgetting * vector + scale * columns.T @ (residual + columns @ coefficients)
        coefficients = np.linalg.solve(matrix + settings.prior * np.eye(size), vector)
        coefficients = np.clip(coefficients, -settings.limit, settings.limit)
        found.append(coefficients)
    return found


@pytest.mark.parametrize("prior", [0.5, 40.0])
@pytest.mark.parametrize("forgetting", [1.0, 0.5])
def test_shapes_are_those_of_dense_least_squares_with_forgetting_and_prior(
    placer: Placer, prior: float, forgetting: float
) -> None:
    tall, wide = np.zeros(16), np.zeros(16)
    tall[0], wide[1] = 1.2, -0.8
    settings = ShapeSettings(prior=prior, forgetting=forgetting)
    found, dense = (f(placer, settings, [tall, wide, wide], 0.02) for f in (estimates, expected))
    np.testing.assert_allclose(found, dense, atol=1e-6)
    assert np.abs(found[0]).max() > 0.1


@pytest.mark.parametrize("stature", [1.6, 1.85])
def test_of_the_bodies_of_a_known_stature_the_likeliest_is_solved_for(placer: Placer, stature: float) -> None:
    space, pose, settings = ShapeSpace.load(), standing(), ShapeSettings(prior=0.5, limit=9.0)
    wide = np.zeros(16)
    wide[1] = -0.8
    free, held = (
        ShapeEstimator(space.body(), settings, placer, [FakeMesh(wide, pose, placer, 0.02)], known)
        for known in ((0.0, 9.0), (stature, stature))
    )
    free.observe(pose, None)  # type: ignore[arg-type]
    assert held.observe(pose, None).height == pytest.approx(stature, abs=1e-3)  # type: ignore[arg-type]
    matrix = held._matrix + settings.prior * np.eye(16)
    rest = space.body().vertices[:, 1]
    taller = space.basis[:, rest.argmax(), 1] - space.basis[:, rest.argmin(), 1]
    away = matrix @ (held.coefficients - free.coefficients)
    along = taller * np.linalg.norm(away) / np.linalg.norm(taller)
    np.testing.assert_allclose(away * np.sign(away @ taller), along, atol=1e-6 * np.linalg.norm(away))


def test_a_toddler_is_measured_beyond_the_limit_of_the_population(placer: Placer) -> None:
    space, pose, settings = ShapeSpace.load(), standing(), ShapeSettings()
    toddler, start = space.typical(0.95), space.body(space.typical(1.05))
    estimator = ShapeEstimator(start, settings, placer, [FakeMesh(toddler, pose, placer)])
    for _ in range(4):
        found = estimator.observe(pose, None)  # type: ignore[arg-type]
    assert estimator.coefficients[0] > settings.limit
    assert found.height == pytest.approx(0.95, abs=0.02)


def test_coefficients_keep_within_their_limit(placer: Placer) -> None:
    giant = np.zeros(16)
    giant[0] = 4.0
    (found,) = estimates(placer, ShapeSettings(prior=0.01, limit=1.5), [giant], 1.0)
    assert found.max() == 1.5
