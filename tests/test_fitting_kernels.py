"""Compiled loops of the local optimisation: z-buffer, pixel search, correspondences, normal equations, bounded step."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.optimize import lsq_linear
from scipy.spatial import cKDTree

from tests.fitting_helpers import back_projected, vertex_jacobian, whole_image
from toolkit.body import skeleton
from toolkit.body.body import BELOW, Body
from toolkit.body.shape import load_body
from toolkit.fitting.placed import NormalSystem, PlacedBody, Placer
from toolkit.kernels.fit import pairs, twists
from toolkit.kernels.image import raster
from toolkit.kernels.image.pixel_search import longest_ray, nearest_pixels
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.simulation.raycast import cast

CAMERA = Camera(150.0, 170.0, 83.0, 60.0, 176, 144)
TILTED = level_rotation(np.array([0.1, -1.0, -0.2]))


def some_pose(seed: int, place: tuple[float, float, float] = (0.1, 0.1, 2.4), spread: float = 0.5) -> np.ndarray:
    """Return a pose within `spread` of the limits, rotated slightly, with its root at `place` in the camera frame."""
    rng = np.random.default_rng(seed)
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[skeleton.ROOT_POSITION] = TILTED @ np.array(place)
    pose[skeleton.ROOT_ROTATION] = rng.normal(0.0, 0.4, 3)
    pose[6:] = spread * rng.uniform(*skeleton.POSE_LIMITS[6:].T)
    return pose


def placed(body: Body, pose: np.ndarray, camera: Camera = CAMERA) -> PlacedBody:
    return Placer(body, camera, TILTED).place(body, pose)


@pytest.fixture(scope="module")
def body() -> Body:
    return load_body("slim_male")


# The z-buffer


@pytest.mark.parametrize("place", [(0.1, 0.1, 2.4), (-0.9, 0.6, 1.9), (0.3, -0.2, 5.0)])
@pytest.mark.parametrize("seed", range(3))
def test_the_z_buffer_shows_what_open3d_hits(body: Body, seed: int, place: tuple[float, float, float]) -> None:
    pose = some_pose(seed, place)
    posed, hits = placed(body, pose), cast(body.vertex_positions(pose) @ TILTED, body.faces, CAMERA)
    assert (hits.depth > 0).sum() > 300
    # a ray that meets an edge of the mesh may hit either face
    depth, triangle = whole_image(posed)
    assert (np.abs(depth - hits.depth) > 1e-3).sum() <= 2
    assert (triangle != hits.triangles).sum() <= 2
    assert np.array_equal(triangle >= 0, depth > 0)


def test_triangles_that_face_away_or_reach_behind_the_camera_are_not_drawn() -> None:
    corners = np.array([[-1.0, -1, 2], [1, -1, 2], [0, 1, 2]])
    intrinsics = np.array([20.0, 20.0, 15.0, 15.0])
    inverse, triangle = np.empty((31, 31)), np.empty((31, 31), dtype=np.int32)

    def drawn(points: np.ndarray, face: list[int]) -> int:
        projected = np.empty_like(points)
        raster.project(points, intrinsics, projected)
        raster.rasterise(projected, np.array([face]), inverse, triangle)
        return int((triangle == 0).sum())

    towards, away = [0, 2, 1], [0, 1, 2]
    assert drawn(corners, towards) > 100
    assert inverse[triangle == 0] == pytest.approx(0.5)
    assert drawn(corners, away) == 0
    corners[2, 2] = -0.5
    assert drawn(corners, towards) == 0


# Pixel search


@st.composite
def searches(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, int]:
    """Draw depth image, intrinsics, query, radius and count; also wide angles and queries outside the image."""
    height, width = draw(st.integers(1, 24)), draw(st.integers(1, 30))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    fx, fy = (size * np.exp(rng.uniform(np.log(0.1), np.log(20.0))) for size in (width, height))
    cx, cy = rng.uniform(-0.5, 1.5) * width, rng.uniform(-0.5, 1.5) * height
    intrinsics = np.array([fx, fy, cx, cy])
    depth = rng.uniform(0.3, 4.0, (height, width))
    if draw(st.booleans()):
        depth = 2.0 + draw(st.sampled_from([0.0, 0.001, 0.05])) * rng.standard_normal((height, width))
    depth[rng.random(depth.shape) < draw(st.sampled_from([0.0, 0.5, 0.95]))] = 0.0
    depth = depth.astype(np.float32)
    spread = draw(st.sampled_from([0.0, 0.005, 0.5, 2.0]))
    u, v, z = rng.uniform(-0.3, 1.3) * width, rng.uniform(-0.3, 1.3) * height, rng.uniform(0.2, 4.0)
    z = draw(st.sampled_from([2.0, z]))
    query = np.array([(u - cx) / fx * z, (v - cy) / fy * z, z]) + spread * rng.standard_normal(3)
    query[2] = max(query[2], 0.06)
    return depth, intrinsics, query, draw(st.sampled_from([0.02, 0.5, 3.0, 50.0])), draw(st.integers(1, 9))


@settings(max_examples=400, deadline=None)
@given(searches())
def test_the_pixel_search_finds_the_points_that_a_scan_of_all_finds(search) -> None:
    depth, intrinsics, query, reach, wanted = search
    points, flat = back_projected(depth, intrinsics)
    distances = np.linalg.norm(points - query, axis=1)
    expected = np.sort(distances[distances < reach])[:wanted]
    squared, pixels = np.full(wanted, np.nan), np.full(wanted, -1)
    ray = longest_ray(*depth.shape, intrinsics)
    found = nearest_pixels(*query, depth, intrinsics, ray, reach, squared, pixels)
    assert found == len(expected)
    assert np.sqrt(squared[:found]) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    of_pixel = dict(zip(flat.tolist(), distances.tolist(), strict=True))
    assert len(set(pixels[:found].tolist())) == found
    assert [of_pixel[p] for p in pixels[:found].tolist()] == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_the_bound_of_the_search_holds_for_the_longest_ray_of_an_image_beside_the_axis() -> None:
    for intrinsics in ([30.0, 60.0, -10.0, 70.0], [12.0, 80.0, 20.0, 9.0]):
        u, v = np.meshgrid(np.arange(40), np.arange(30))
        fx, fy, cx, cy = intrinsics
        lengths = np.sqrt(1 + ((u - cx) / fx) ** 2 + ((v - cy) / fy) ** 2)
        assert longest_ray(30, 40, np.array(intrinsics)) == pytest.approx(lengths.max())


# Correspondences


@pytest.mark.parametrize("count", [1, 2, 3, 6, 9])
def test_medians_of_the_nearest_points_are_those_of_brute_force(body: Body, count: int) -> None:
    seen = placed(body, some_pose(1))
    rng = np.random.default_rng(count)
    clean = seen.drawn.depth
    depth = np.where(clean > 0, clean + rng.normal(0, 0.01, clean.shape), 0).astype(np.float32)
    points, _ = back_projected(depth, seen.drawn.intrinsics)
    queries = seen.chosen_points + rng.normal(0.0, 0.1, (len(seen.placer.chosen), 3))
    wanted = rng.random(len(queries)) < 0.8
    ours, expected = np.full_like(queries, 7.0), np.full_like(queries, 7.0)
    pairs.nearest_medians(queries, wanted, depth, seen.drawn.intrinsics, 0.08, count, ours)
    expected[:, 0] = np.nan
    for row in np.flatnonzero(wanted):
        distances = np.linalg.norm(points - queries[row], axis=1)
        nearest = np.argsort(distances)[:count]
        nearest = nearest[distances[nearest] < 0.08]
        if len(nearest):
            expected[row] = np.median(points[nearest], axis=0)
    assert 50 < np.isnan(expected[:, 0]).sum() < len(queries) - 50
    assert ours == pytest.approx(expected, abs=1e-9, nan_ok=True)


@pytest.mark.parametrize(
    ("vertex", "normal", "front", "seen"),
    [
        ((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), 2.0, True),
        ((0.0, 0.0, 2.0), (0.0, 0.0, 1.0), 2.0, False),  # faces away
        ((0.0, 0.0, 2.0), (1.0, 0.0, -0.05), 2.0, False),  # seen at too flat an angle
        ((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), 1.9, False),  # occluded
        ((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), 1.98, True),  # within the tolerance
        ((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), 0.0, True),  # nothing drawn there
        ((3.0, 0.0, 2.0), (0.0, 0.0, -1.0), 1.0, False),  # beyond the border of the image, where nothing is observed
        ((0.2, 0.0, 2.0), (0.0, 0.0, -1.0), 0.0, False),  # on an unobserved pixel
        ((0.0, 0.0, -2.0), (0.0, 0.0, 1.0), 0.0, False),  # behind the camera
        ((0.5, 0.0, 1.0), (-1.0, 0.0, 0.0), 0.0, True),  # faces the camera, not the image plane
    ],
)
def test_a_vertex_is_seen_where_it_faces_the_camera_and_nothing_is_before_it(vertex, normal, front, seen) -> None:
    depth, out = np.full((11, 11), front), np.empty(1, dtype=np.bool_)
    unit = np.array([normal]) / np.linalg.norm(normal)
    intrinsics, evidence = np.array([10.0, 10.0, 5.0, 5.0]), np.zeros((11, 11), dtype=np.float32)
    evidence[5, 6] = np.nan
    pairs.visible_vertices(
        np.array([0]), np.array([vertex]), unit, depth, intrinsics, evidence, intrinsics, 0.1, 0.03, out
    )
    assert out[0] == seen


def test_samples_meet_the_nearest_drawn_point_and_its_nearest_corner(body: Body) -> None:
    posed = placed(body, some_pose(2))
    rng = np.random.default_rng(2)
    surface, flat = back_projected(posed.drawn.depth, posed.drawn.intrinsics)
    samples = surface[rng.integers(len(surface), size=150)] + rng.normal(0.0, 0.06, (150, 3))
    reach = 0.1
    points, vertex_of = np.full_like(samples, np.nan), np.empty(150, dtype=np.int64)
    pairs.nearest_model_points(
        samples,
        posed.drawn.depth,
        posed.drawn.triangle,
        posed.drawn.intrinsics,
        posed.placer.faces,
        posed.vertices,
        reach,
        points,
        vertex_of,
    )
    distances, nearest = cKDTree(surface).query(samples)
    found = distances < reach
    assert 20 < found.sum() < 150
    assert np.array_equal(vertex_of >= 0, found)
    assert points[found] == pytest.approx(surface[nearest[found]], abs=1e-9)
    corners = posed.placer.faces[posed.drawn.triangle.ravel()[flat[nearest[found]]]]
    gaps = np.linalg.norm(posed.vertices[corners] - points[found][:, None], axis=2)
    assert np.array_equal(vertex_of[found], corners[np.arange(len(corners)), gaps.argmin(axis=1)])


def test_the_mean_distance_to_the_nearest_vertex_is_capped() -> None:
    rng = np.random.default_rng(3)
    points, vertices = rng.normal(size=(40, 3)), rng.normal(size=(60, 3))
    distances = cKDTree(vertices).query(points)[0]
    assert pairs.mean_nearest(points, vertices, 10.0) == pytest.approx(distances.mean())
    assert pairs.mean_nearest(points, vertices, 0.3) == pytest.approx(np.minimum(distances, 0.3).mean())
    assert pairs.mean_nearest(points[:0], vertices, 0.3) == 0.0


# Normal equations


def rigid_jacobians(posed: PlacedBody, points: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Return the derivative (N, 3, P) of points (N, 3) rigidly attached to joints (N,), camera frame."""
    out = np.zeros((len(points), 3, skeleton.POSE_SIZE))
    out[:, :, :3] = posed.placer.from_level
    for k, i in enumerate(skeleton.DOF_JOINT):
        moved = BELOW[i, joints]
        out[moved, :, 3 + k] = np.cross(posed.axes[k], points[moved] - posed.origins[i])
    return out


def blended_jacobians(posed: PlacedBody, points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return the derivative (N, 3, P) of points (N, 3) blended from the joints of mesh `vertices` (N,)."""
    weights, joints = posed.body.skin_weights[vertices], posed.body.skin_joints[vertices]
    return sum(weights[:, s, None, None] * rigid_jacobians(posed, points, joints[:, s]) for s in range(joints.shape[1]))


def dense(jacobians: np.ndarray, residuals: np.ndarray, metrics: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return J'MJ and J'Me."""
    return (
        np.einsum("nap,nab,nbq->pq", jacobians, metrics, jacobians),
        np.einsum("nap,nab,nb->p", jacobians, metrics, residuals),
    )


def metrics_of(residuals: np.ndarray, normals: np.ndarray, weights: np.ndarray, sigma: float) -> np.ndarray:
    """Return robust metrics (N, 3, 3) with a plane part of 1 and a point part of 0.3."""
    robust = weights / (1.0 + (residuals**2).sum(axis=1) / sigma**2) ** 2
    return robust[:, None, None] * (np.einsum("na,nb->nab", normals, normals) + 0.3 * np.eye(3))


def surface_system(posed: PlacedBody, chosen: np.ndarray, residuals: np.ndarray, sigma: float) -> NormalSystem:
    system = NormalSystem()
    system.reset(posed.origins[0])
    body = posed.body
    points = posed.vertices[chosen]
    pairs.add_pairs(
        points - residuals, points, chosen, np.ones(len(chosen)), posed.normals,
        body.skin_joints, body.skin_weights, system.reference, sigma, 1.0, 0.3, system.hessian, system.gradient,
    )  # fmt: skip
    system.assemble(posed)
    return system


@pytest.mark.parametrize("seed", range(3))
def test_rigid_vertices_give_the_dense_normal_equations(body: Body, seed: int) -> None:
    pose = some_pose(seed)
    posed = placed(body, pose)
    chosen = np.flatnonzero(body.skin_weights.max(axis=1) == 1.0)
    assert len(np.unique(body.part[chosen])) > 10
    residuals = np.random.default_rng(seed).normal(0.0, 0.03, (len(chosen), 3))
    system = surface_system(posed, chosen, residuals, 0.1)
    jacobians = np.einsum("ab,nbp->nap", posed.placer.from_level, vertex_jacobian(body, pose, chosen))
    metrics = metrics_of(residuals, posed.normals[chosen], np.ones(len(chosen)), 0.1)
    matrix, vector = dense(jacobians, residuals, metrics)
    assert system.matrix == pytest.approx(matrix, abs=1e-9 * np.abs(matrix).max())
    assert system.vector == pytest.approx(vector, abs=1e-9 * np.abs(vector).max())


@pytest.mark.parametrize("seed", range(3))
def test_blended_vertices_give_the_gradient_and_bound_the_curvature_from_above(body: Body, seed: int) -> None:
    pose = some_pose(seed)
    posed = placed(body, pose)
    chosen = posed.placer.chosen
    residuals = np.random.default_rng(seed).normal(0.0, 0.03, (len(chosen), 3))
    system = surface_system(posed, chosen, residuals, 0.1)
    metrics = metrics_of(residuals, posed.normals[chosen], np.ones(len(chosen)), 0.1)
    matrix, vector = dense(blended_jacobians(posed, posed.vertices[chosen], chosen), residuals, metrics)
    scale = np.abs(matrix).max()
    assert system.vector == pytest.approx(vector, abs=1e-9 * np.abs(vector).max())
    excess = np.linalg.eigvalsh(system.matrix - matrix)
    assert excess.min() > -1e-9 * scale and excess.max() > 1e-6 * scale
    # the blended point replaces the points of its joints; true skinning differs slightly
    jacobians = np.einsum("ab,nbp->nap", posed.placer.from_level, vertex_jacobian(body, pose, chosen))
    _, true_vector = dense(jacobians, residuals, metrics)
    assert np.linalg.norm(system.vector - true_vector) < 0.02 * np.linalg.norm(true_vector)


def test_cloud_pairs_pull_surface_points_to_their_samples(body: Body) -> None:
    posed = placed(body, some_pose(1))
    rng = np.random.default_rng(1)
    points, flat = back_projected(posed.drawn.depth, posed.drawn.intrinsics)
    rows = rng.integers(len(points), size=60)
    points, vertex_of = points[rows], posed.placer.faces[posed.drawn.triangle.ravel()[flat[rows]], 0]
    residuals, weights = rng.normal(0.0, 0.03, (60, 3)), rng.uniform(0.5, 3.0, 60)
    system = NormalSystem()
    system.reset(posed.origins[0])
    unmatched = np.where(np.arange(60) < 50, vertex_of, -1)
    pairs.add_pairs(
        points - residuals, points, unmatched, weights, posed.normals, body.skin_joints, body.skin_weights,
        system.reference, 0.1, 1.0, 0.3, system.hessian, system.gradient,
    )  # fmt: skip
    system.assemble(posed)
    some = slice(0, 50)
    metrics = metrics_of(residuals[some], posed.normals[vertex_of[some]], weights[some], 0.1)
    jacobians = blended_jacobians(posed, points[some], vertex_of[some])
    matrix, vector = dense(jacobians, residuals[some], metrics)
    assert system.vector == pytest.approx(vector, abs=1e-9 * np.abs(vector).max())
    assert np.linalg.eigvalsh(system.matrix - matrix).min() > -1e-9 * np.abs(matrix).max()


def test_the_normal_equations_do_not_depend_on_the_reference_point(body: Body) -> None:
    posed = placed(body, some_pose(2))
    residuals = np.random.default_rng(2).normal(0.0, 0.03, (len(posed.placer.chosen), 3))
    systems = []
    for reference in (posed.origins[0], posed.origins[0] + [0.7, -0.3, 1.1]):
        system = NormalSystem()
        system.reset(reference)
        chosen, points = posed.placer.chosen, posed.chosen_points
        pairs.add_pairs(
            points - residuals, points, chosen, np.ones(len(chosen)), posed.normals, body.skin_joints,
            body.skin_weights, system.reference, 0.1, 1.0, 0.3,
            system.hessian, system.gradient,
        )  # fmt: skip
        system.assemble(posed)
        systems.append(system)
    scale = np.abs(systems[0].matrix).max()
    assert systems[0].matrix == pytest.approx(systems[1].matrix, abs=1e-9 * scale)
    assert systems[0].vector == pytest.approx(systems[1].vector, abs=1e-9 * np.abs(systems[0].vector).max())


# The bounded step


@st.composite
def quadratics(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return matrix, vector, pose, limits and damping of a problem with a feasible start."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    size = draw(st.integers(1, 12))
    half = rng.normal(size=(size + 2, size))
    width = draw(st.sampled_from([0.05, 0.5, 5.0]))
    pose = rng.normal(size=size)
    limits = np.stack([pose - width * rng.random(size), pose + width * rng.random(size)], axis=1)
    limits[rng.random(size) < 0.3] = -np.inf, np.inf
    return half.T @ half, 3.0 * rng.normal(size=size), pose, limits, rng.uniform(0.01, 1.0, size)


@settings(max_examples=300, deadline=None)
@given(quadratics())
def test_the_bounded_step_is_feasible_and_optimal_where_it_is_free(problem) -> None:
    matrix, vector, pose, limits, damping = problem
    step = np.empty_like(vector)
    twists.bounded_step(matrix, vector, pose, limits, damping, step)
    low, high = limits[:, 0] - pose, limits[:, 1] - pose
    assert (step >= low).all() and (step <= high).all()
    damped = matrix + np.diag(damping)
    plain = np.linalg.solve(damped, -vector)
    if (plain >= low).all() and (plain <= high).all():
        assert step == pytest.approx(plain, abs=1e-8)
        return
    bound = (step == low) | (step == high)
    assert bound.any()
    slope = damped @ step + vector
    settled = np.abs(slope[~bound]).max(initial=0.0) < 1e-8
    if settled and (slope[step == low] >= 0).all() and (slope[step == high] <= 0).all():
        root = np.linalg.cholesky(damped).T
        target = np.linalg.solve(root.T, -vector)
        assert step == pytest.approx(lsq_linear(root, target, (low - 1e-15, high + 1e-15), tol=1e-13).x, abs=1e-7)


# Support of a joint


@settings(deadline=None)
@given(
    hnp.arrays(np.float64, 12, elements=st.floats(0.0, 0.3) | st.just(np.nan)),
    hnp.arrays(np.float64, 12, elements=st.sampled_from([0.0, 1.0])),
    st.integers(0, 5),
)
def test_the_support_of_joints_is_that_of_the_plain_sums(gaps: np.ndarray, observed: np.ndarray, seed: int) -> None:
    around = np.random.default_rng(seed).dirichlet(np.ones(12), size=4)
    support, share = np.empty((2, 4))
    pairs.support_of_joints(around, gaps, observed, 0.04, support, share)
    near = np.nan_to_num(np.exp(-(gaps**2) / (2 * 0.04**2)), nan=0.0)
    assert support == pytest.approx(np.minimum(2 * around @ near, 1.0))
    assert share == pytest.approx(around @ observed)
