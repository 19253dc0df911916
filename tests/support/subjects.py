"""Moving subjects in front of a depth camera, without files: the input of the speed benchmarks."""

from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.kernels.image import raster
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud

LEVEL = np.diag([1.0, -1.0, -1.0])
"""`R_level_camera` of a camera that looks horizontally."""
DISTANCE = 2.8
"""Distance from the camera to the subject, metres."""


def moving_poses(count: int, rng: np.random.Generator) -> np.ndarray:
    """Return poses (count, P), level frame: joints swing within a third of their limits about standing with arms down.

    Frequencies of 0.2 to 0.6 Hz at 30 frames a second; the body turns by up to 30 degrees.
    """
    times = np.arange(count)[:, None] / 30.0
    low, high = skeleton.POSE_LIMITS[6:].T
    waves = np.sin(2 * np.pi * (times * rng.uniform(0.2, 0.6, len(low)) + rng.random(len(low))))
    rest = np.zeros(skeleton.POSE_SIZE)
    for side, angle in (("left", -0.9), ("right", 0.9)):
        rest[skeleton.POSE_NAMES.index(f"{side}_shoulder_rz")] = angle
    poses = np.tile(rest, (count, 1))
    poses[:, 6:] = np.clip(poses[:, 6:] + waves * (high - low) / 6, low, high)
    poses[:, 2] = -DISTANCE
    poses[:, 4] = np.radians(30) * np.sin(2 * np.pi * 0.3 * times[:, 0])
    return poses


def draw(body: Body, pose: np.ndarray, camera: Camera, rng: np.random.Generator) -> np.ndarray:
    """Return the depth image float32 (H, W), metres, of a body in a pose (level frame), with 4 mm noise."""
    vertices_camera = body.vertex_positions(pose) @ LEVEL
    projected = np.empty_like(vertices_camera)
    raster.project(vertices_camera, np.asarray(camera.intrinsics, dtype=np.float64), projected)
    inverse = np.empty((camera.height, camera.width))
    raster.rasterise(projected, body.faces, inverse, np.empty(inverse.shape, dtype=np.int32))
    depth = np.zeros(inverse.shape, dtype=np.float32)
    seen = inverse > 0
    depth[seen] = 1.0 / inverse[seen] + rng.normal(0.0, 0.004, int(seen.sum()))
    return depth


def camera_for(pixels: float) -> Camera:
    """Return a camera with a Kinect's field of view that sees `pixels` pixels of the average subject at `DISTANCE`."""
    scale = np.sqrt(pixels / 5270.0)
    width, height = round(320 * scale), round(240 * scale)
    return Camera(285.6 * scale, 285.6 * scale, (width - 1) / 2, (height - 1) / 2, width, height)


def moving_clouds(pixels: float, count: int) -> list[Cloud]:
    """Return clouds of `count` frames of a moving subject with about `pixels` points each."""
    rng = np.random.default_rng(0)
    body = subject_body("neutral", seed=0)
    camera = camera_for(pixels)
    return [Cloud.from_depth(draw(body, pose, camera, rng), camera, LEVEL) for pose in moving_poses(count, rng)]


def write_recording(path: Path, pixels: float, count: int) -> None:
    """Write the frames of `moving_clouds` as a recording with the true joints."""
    rng = np.random.default_rng(0)
    body = subject_body("neutral", seed=0)
    camera = camera_for(pixels)
    poses = moving_poses(count, rng)
    frames = (np.rint(1000 * draw(body, pose, camera, rng)).astype(np.uint16) for pose in poses)
    joints = (body.joint_positions(poses) @ LEVEL).astype(np.float32)
    save_recording(path, depth=frames, camera=camera, timestamps=np.arange(count) / 30.0, joints=joints)
