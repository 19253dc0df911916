"""The kinematic chain, skinning, their Jacobians, the assets and the shape space."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.support.proportions import stretched
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace, load_body, subject_body
from toolkit.io.errors import BodyError

LEFT_RIGHT = [
    skeleton.REPORTED.index(name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right"))
    for name in skeleton.REPORTED
]


def random_pose(rng: np.random.Generator, spread: float = 1.0) -> np.ndarray:
    """Return a pose within the limits at a random place and orientation."""
    low, high = skeleton.POSE_LIMITS.T
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[6:] = rng.uniform(spread * low[6:], spread * high[6:])
    pose[:3] = rng.normal(size=3)
    pose[3:6] = rng.normal(size=3)
    return pose


def chain_by_matrices(body: Body, pose: np.ndarray) -> np.ndarray:
    """Return homogeneous transforms (18, 4, 4) of the joints, multiplied from SciPy rotations."""
    vectors = np.zeros((len(skeleton.JOINTS), 3))
    for name, value in zip(skeleton.POSE_NAMES[3:], pose[3:], strict=True):
        joint, _, axis = name.rpartition("_r")
        vectors[skeleton.JOINT_NAMES.index(joint), "xyz".index(axis)] = value
    world = np.zeros((len(skeleton.JOINTS), 4, 4))
    for j, parent in enumerate(skeleton.PARENTS):
        local = np.eye(4)
        local[:3, :3] = Rotation.from_rotvec(vectors[j]).as_matrix()
        local[:3, 3] = pose[:3] if parent < 0 else body.joints[j] - body.joints[parent]
        world[j] = local if parent < 0 else world[parent] @ local
    return world


def skin_by_matrices(body: Body, pose: np.ndarray) -> np.ndarray:
    world = chain_by_matrices(body, pose)
    out = np.zeros_like(body.vertices)
    for v, (joints, weights) in enumerate(zip(body.skin_joints, body.skin_weights, strict=True)):
        for j, weight in zip(joints, weights, strict=True):
            out[v] += weight * (world[j, :3, :3] @ (body.vertices[v] - body.joints[j]) + world[j, :3, 3])
    return out


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def edges_of(faces: np.ndarray) -> np.ndarray:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


@pytest.fixture(scope="module")
def body() -> Body:
    return load_body()


def test_forward_kinematics_and_skinning_agree_with_multiplied_matrices(body: Body) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        pose = random_pose(rng)
        placed, world = body.place(pose), chain_by_matrices(body, pose)
        np.testing.assert_allclose(placed.rotations, world[:, :3, :3], atol=1e-12)
        np.testing.assert_allclose(placed.origins, world[:, :3, 3], atol=1e-12)
        np.testing.assert_allclose(body.vertex_positions(pose), skin_by_matrices(body, pose), atol=1e-12)


def test_reported_joints_are_derived_from_hips_and_shoulders(body: Body) -> None:
    pose = random_pose(np.random.default_rng(4))
    joints = dict(zip(skeleton.REPORTED, body.joint_positions(pose), strict=True))
    world = chain_by_matrices(body, pose)
    for name in ("left_shoulder", "right_knee", "left_wrist"):
        np.testing.assert_allclose(joints[name], world[skeleton.JOINT_NAMES.index(name), :3, 3], atol=1e-12)
    np.testing.assert_allclose(joints["pelvis"], (joints["left_hip"] + joints["right_hip"]) / 2, atol=1e-12)
    np.testing.assert_allclose(joints["neck"], (joints["left_shoulder"] + joints["right_shoulder"]) / 2, atol=1e-12)
    np.testing.assert_allclose(joints["spine"], 0.6 * joints["pelvis"] + 0.4 * joints["neck"], atol=1e-12)
    carrier = world[skeleton.JOINT_NAMES.index("cervical")]
    head = carrier[:3, :3] @ (body.sites[0] - body.joints[skeleton.JOINT_NAMES.index("cervical")]) + carrier[:3, 3]
    np.testing.assert_allclose(joints["head"], head, atol=1e-12)


def test_limits_are_mirror_images_and_admit_the_rest_pose() -> None:
    limits = dict(zip(skeleton.POSE_NAMES, skeleton.POSE_LIMITS, strict=True))
    for name, (low, high) in limits.items():
        assert low <= 0 <= high
        if name.startswith("left"):
            mirrored = limits[name.replace("left", "right")]
            np.testing.assert_array_equal(mirrored, (low, high) if name.endswith("x") else (-high, -low))


def mirrored_pose(pose: np.ndarray) -> np.ndarray:
    """Return the pose mirrored at x = 0: sides exchanged, rotations about y and z negated."""
    values = dict(zip(skeleton.POSE_NAMES, pose, strict=True))
    out = []
    for name in skeleton.POSE_NAMES:
        other = name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")
        negative = name == "root_tx" or (name[-2] == "r" and name[-1] in "yz")
        out.append(-values[other] if negative else values[other])
    return np.array(out)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_a_mirrored_pose_gives_mirrored_joints_and_tips(seed: int) -> None:
    body, pose = load_body(), random_pose(np.random.default_rng(seed))
    mirrored = body.joint_positions(mirrored_pose(pose)) * (-1, 1, 1)
    np.testing.assert_allclose(mirrored[LEFT_RIGHT], body.joint_positions(pose), atol=1e-6)
    tips = body.end_effector_positions(mirrored_pose(pose)) * (-1, 1, 1)
    np.testing.assert_allclose(tips[[1, 0, 3, 2, 4]], body.end_effector_positions(pose), atol=1e-6)


@pytest.mark.parametrize("name", ["neutral", "slim_male", "heavy_female", "child"])
def test_the_rest_pose_is_a_t_pose_with_the_left_at_positive_x(name: str) -> None:
    body = load_body(name)
    joint = dict(zip(skeleton.JOINT_NAMES, body.joints, strict=True))
    np.testing.assert_allclose(joint["root"], 0.0)
    np.testing.assert_allclose((joint["left_hip"] + joint["right_hip"]) / 2, 0.0, atol=1e-6)
    for side, sign in (("left", 1), ("right", -1)):
        arm = [joint[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist")]
        leg = [joint[f"{side}_{part}"] for part in ("hip", "knee", "ankle")]
        for upper, lower in zip(arm[:-1], arm[1:], strict=True):
            assert sign * (lower - upper)[0] > 0.12
            np.testing.assert_allclose((lower - upper)[1:], 0.0, atol=2e-3)
        for upper, lower in zip(leg[:-1], leg[1:], strict=True):
            assert (lower - upper)[1] < -0.25
            np.testing.assert_allclose((lower - upper)[[0, 2]], 0.0, atol=2e-3)
    assert body.sites[3, 2] > joint["left_ankle"][2] + 0.05, "feet point to +z"
    assert body.vertices[body.end_effectors[4], 1] > body.sites[0, 1] + 0.05, "the crown is above the head's centre"
    assert body.vertices[body.end_effectors[0], 0] > body.sites[1, 0] + 0.04, "fingertips are beyond the knuckles"
    assert body.vertices[body.end_effectors[2], 2] > body.sites[3, 2] + 0.02, "toe tips are beyond the ball of the foot"


@pytest.mark.parametrize("name", ShapeSpace.load().named)
def test_every_mesh_is_closed_with_its_faces_outward(name: str) -> None:
    for body in (load_body(name), subject_body(name, seed=1)):
        first, second = edges_of(body.faces).T.astype(np.int64)
        forward, backward = np.unique(first * len(body.vertices) + second), first + second * len(body.vertices)
        assert len(forward) == 3 * len(body.faces), "no edge is walked twice in one direction"
        np.testing.assert_array_equal(np.unique(backward), forward, err_msg="each edge has a face on both sides")
        assert len(body.vertices) - len(forward) // 2 + len(body.faces) == 2, "one closed surface without handles"
        assert 0.015 < volume(body.vertices, body.faces) < 0.12, "a person in cubic metres, faces outward"


@settings(max_examples=8)
@given(st.lists(st.floats(-3, 3), min_size=16, max_size=16))
def test_shape_coefficients_come_back_from_their_body(coefficients: list[float]) -> None:
    space = ShapeSpace.load()
    np.testing.assert_allclose(space.project(space.body(coefficients)), coefficients, atol=1e-5)


@pytest.mark.parametrize(
    ("component", "covered", "elsewhere"),
    [(0, "cervical", "left_knee"), (1, "thorax", "left_wrist"), (2, "left_elbow", "left_wrist"),
     (3, "right_hip", "right_ankle"), (4, "left_knee", "cervical"), (5, "right_ankle", "lumbar")],
)  # fmt: skip
def test_clothing_moves_the_skin_that_it_covers_outwards(component: int, covered: str, elsewhere: str) -> None:
    space = ShapeSpace.load()
    bare, dressed = space.body(), space.body(np.eye(space.size)[10 + component])
    moved = np.einsum("vc,vc->v", dressed.vertices - bare.vertices, bare.normals)
    np.testing.assert_allclose(dressed.joints, bare.joints)
    parts = [bare.part == skeleton.JOINT_NAMES.index(name) for name in (covered, elsewhere)]
    np.testing.assert_allclose(np.median(moved[parts[0]]), 0.01, atol=1e-3)
    np.testing.assert_allclose(np.median(moved[parts[1]]), 0.0, atol=1e-3)
    assert moved.min() > -1e-6 and moved.max() < 0.0105


def test_a_subject_is_finer_and_skinned_by_other_weights_than_the_tracker(body: Body) -> None:
    subject = subject_body("neutral")
    assert len(subject.vertices) == 13_380
    np.testing.assert_allclose(subject.joints, body.joints, atol=5e-3)
    nearest = np.linalg.norm(body.vertices[:, None] - subject.vertices[None, ::4], axis=2).argmin(axis=1)
    assert (subject.part[::4][nearest] == body.part).mean() > 0.85


def test_stretching_changes_the_named_bones_and_nothing_else(body: Body) -> None:
    longer = stretched(body, {"shoulder": 1.1, "knee": 0.9})

    def length(which: Body, upper: str, lower: str) -> float:
        a, b = (which.joints[skeleton.JOINT_NAMES.index(name)] for name in (upper, lower))
        return float(np.linalg.norm(a - b))

    for side in ("left", "right"):
        for (upper, lower), factor in (
            (("shoulder", "elbow"), 1.1), (("elbow", "wrist"), 1.0), (("hip", "knee"), 1.0), (("knee", "ankle"), 0.9),
        ):  # fmt: skip
            before, after = (length(b, f"{side}_{upper}", f"{side}_{lower}") for b in (body, longer))
            assert after == pytest.approx(factor * before, rel=1e-3)
    np.testing.assert_allclose(stretched(body, {}).vertices, body.vertices, atol=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: load_body("giant"), "neutral"),
        (lambda: subject_body("giant"), "neutral"),
        (lambda: ShapeSpace.load().body(np.zeros(17)), "at most 16"),
        (lambda: ShapeSpace.load().body([np.nan]), "finite"),
        (lambda: load_body().scaled(0.0), "positive"),
        (lambda: ShapeSpace.load().project(subject_body("neutral")), "vertices"),
        (lambda: load_body().joint_positions(np.zeros(7)), "43"),
        (lambda: load_body().vertex_positions(np.full(43, np.nan)), "finite"),
    ],
)
def test_a_bad_argument_is_named_with_the_way_out(call: object, words: str) -> None:
    with pytest.raises(BodyError, match=words):
        call()  # type: ignore[operator]
