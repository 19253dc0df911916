"""The joint network: input, output, joints of simulated people, the same bits everywhere."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.landmark_helpers import body_cloud
from tests.placed_bodies import pose
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import ModelError
from toolkit.kernels.learning import joint_crop
from toolkit.landmarks import joint_network
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.exact_network import ExactNetwork, digest_path

BODY = load_body("neutral")
STANDING = pose(left_shoulder_rz=-0.2, right_shoulder_rz=0.9)


@pytest.fixture(scope="module")
def cloud() -> Cloud:
    """Return the cloud of a person who stands 2.5 m from the camera with the right arm raised to the side."""
    return body_cloud(BODY, STANDING)


def errors(estimate: joint_network.JointEstimate) -> np.ndarray:
    return np.linalg.norm(estimate.points - BODY.joint_positions(STANDING), axis=1)


def test_joints_of_a_simulated_person_are_found_with_the_error_to_expect(cloud: Cloud) -> None:
    found = joint_network.joint_network().estimate(cloud)
    assert np.median(errors(found)) < 0.05 and errors(found).max() < 0.2
    assert (found.in_view > 0.9).all() and ((found.confidence > 0) & (found.confidence <= 1)).all()
    assert errors(found)[found.reliability > 0.8].max() < 0.1


def test_equal_frames_are_estimated_once(cloud: Cloud) -> None:
    network = joint_network.JointNetwork()
    first = network.estimate(cloud)
    assert network.estimate(Cloud.from_depth(cloud.depth.copy(), cloud.camera, cloud.rotation)) is first
    assert network.estimate(cloud, np.zeros(cloud.depth.shape, dtype=np.bool_)) is not first
    nearer = Cloud.from_depth(0.9 * cloud.depth, cloud.camera, cloud.rotation)
    assert not np.array_equal(network.estimate(nearer).points, first.points)


def test_specks_far_behind_a_person_are_left_out_and_nearer_ones_are_kept(cloud: Cloud) -> None:
    estimate, depth = joint_network.joint_network().estimate, cloud.depth.copy()
    v, u = np.argwhere(depth == 0)[0] + 4
    depth[v : v + 3, u : u + 3] = 3.2
    behind = estimate(Cloud.from_depth(depth, cloud.camera, cloud.rotation))
    np.testing.assert_array_equal(behind.points, estimate(cloud).points)
    for near in (depth, np.zeros_like(depth)):
        near[v : v + 3, u : u + 3] *= 2.6 / 3.2
        kept = joint_network.without_specks(Cloud.from_depth(near, cloud.camera, cloud.rotation))
        np.testing.assert_array_equal(kept, near)


def test_a_mirrored_image_has_mirrored_joints(cloud: Cloud) -> None:
    estimate = joint_network.joint_network().estimate
    c = cloud.camera
    mirrored = Camera(c.fx, c.fy, c.width - 1 - c.cx, c.cy, c.width, c.height)
    other = estimate(Cloud.from_depth(cloud.depth[:, ::-1], mirrored, cloud.rotation))
    apart = other.points[joint_network.OPPOSITE] * [-1, 1, 1] - estimate(cloud).points
    assert np.linalg.norm(apart, axis=1).max() < 0.1


def test_a_camera_on_its_side_finds_the_joints_of_a_level_one(cloud: Cloud) -> None:
    estimate, c = joint_network.joint_network().estimate, cloud.camera
    # A quarter turn: the new x is the old y, the new y the old -x.
    turned = Camera(c.fy, c.fx, c.cy, c.width - 1 - c.cx, c.height, c.width)
    to_old = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rotation = np.stack([[sum(row[k] * to_old[k, j] for k in range(3)) for j in range(3)] for row in cloud.rotation])
    found = estimate(Cloud.from_depth(np.rot90(cloud.depth), turned, rotation))
    assert np.abs(found.points - estimate(cloud).points).max() < 0.02


def test_joints_below_the_image_and_behind_something_nearer_are_out_of_view(cloud: Cloud) -> None:
    estimate = joint_network.joint_network().estimate
    knees = [skeleton.REPORTED.index(f"{side}_knee") for side in ("left", "right")]
    pixels = cloud.camera.project(BODY.joint_positions(STANDING)[knees] * [1, -1, -1])
    last = round(float(pixels[:, 1].min())) - 3
    depth = cloud.depth.copy()
    depth[last:] = 0.0
    ankles = [skeleton.REPORTED.index(f"{side}_ankle") for side in ("left", "right")]
    behind = np.zeros(depth.shape, dtype=bool)
    behind[last:] = True
    hidden = estimate(Cloud.from_depth(depth, cloud.camera, cloud.rotation), behind)
    c = cloud.camera
    cut = Camera(c.fx, c.fy, c.cx, c.cy, c.width, last)
    below = estimate(Cloud.from_depth(depth[:last], cut, cloud.rotation))
    for found in (hidden, below):
        assert (found.in_view[ankles] < 0.2).all() and found.in_view[skeleton.REPORTED.index("head")] > 0.9


def test_a_crop_holds_depth_around_the_middle_and_marks_what_is_unobserved() -> None:
    depth = np.zeros((60, 80), dtype=np.float32)
    depth[20:40, 30:50] = 2.0
    depth[25, 35] = 2.1
    behind = np.zeros(depth.shape, dtype=bool)
    behind[:20] = True
    crop = np.empty((3, 96, 96), dtype=np.float32)
    # One pixel of the crop is one of the image: 0.025 m at 2 m.
    intrinsics, middle = np.array([80.0, 80.0, 39.5, 29.5]), np.array([0.0, 0.0, 2.0])
    joint_crop.crop(depth, behind, intrinsics, middle, np.array([0.0, 1.0]), 0.025, crop)
    assert set(np.unique(crop[0])) == {0.0, 256.0} and crop[0].sum() == 400 * 256
    assert sorted(np.unique(crop[1])) == [0.0, 51.0] and (crop[1] == 51).sum() == 1
    known = crop[2] == 0
    assert known.sum() == 40 * 80 and not known[:18].any()


def test_anchors_are_averaged_by_the_softmax_of_their_weights() -> None:
    rng = np.random.default_rng(0)
    anchors = rng.normal(0, 2, (10, 4, 4)).astype(np.float32)
    joints, scales = np.empty((2, 3)), np.empty(2)
    joint_crop.joints_of_anchors(anchors, 0.2, joints, scales)
    for joint, out in enumerate(anchors.reshape(2, 5, 16).astype(float)):
        weight = np.exp(out[0]) / np.exp(out[0]).sum()
        y, x = np.divmod(np.arange(16), 4)
        places = 0.2 * np.stack([x - 1.5, y - 1.5, 0 * x]) + joint_crop.OFFSET * out[1:4]
        assert joints[joint] == pytest.approx((weight * places).sum(axis=1), abs=1e-12)
        log_scale = (weight * out[4]).sum() + joint_crop.LOG_SCALE_BIAS
        limits = joint_crop.MIN_LOG_SCALE, joint_crop.MAX_LOG_SCALE
        assert scales[joint] == pytest.approx(np.exp(np.clip(log_scale, *limits)), rel=1e-12)


def test_the_exponential_function_is_that_of_numpy() -> None:
    x = np.linspace(-40.0, 5.0, 500)
    assert [joint_crop.exponential(value) for value in x] == pytest.approx(np.exp(x), rel=1e-14)


def test_a_network_of_other_values_or_none_is_refused_in_a_sentence(tmp_path: Path) -> None:
    shape, outputs = (1, 3, 96, 96), ("anchors", "sides")
    copy = tmp_path / joint_network.ASSET.name
    copy.write_bytes(joint_network.ASSET.read_bytes())
    digest_path(copy).write_text("0" * 64)
    with pytest.raises(ModelError, match="computes other values") as refused:
        ExactNetwork(copy, shape, outputs)
    assert "\n" not in str(refused.value)
    copy.write_bytes(joint_network.ASSET.read_bytes()[:1000])
    with pytest.raises(ModelError, match="cannot run"):
        ExactNetwork(copy, shape, outputs)


def test_all_instruction_sets_and_numbers_of_threads_give_the_same_bits() -> None:
    """Loading a network compares its outputs with the digest of its export."""
    program = (
        "import sys, cv2; cv2.setNumThreads(int(sys.argv[1]));"
        "from toolkit.landmarks.joint_network import joint_network; joint_network()"
    )
    for threads, disabled in ((1, "AVX512-SKX"), (2, "AVX512-SKX,AVX2,FMA3,FP16,AVX")):
        environment = {**os.environ, "OPENCV_CPU_DISABLE": disabled}
        subprocess.run([sys.executable, "-c", program, str(threads)], env=environment, check=True)
