"""Poses, databases and small BVH files for the database tests."""

from functools import cache
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.database.canonical import canonicalise
from toolkit.database.database import PoseDatabase, PoseOrigins
from toolkit.database.prior import HEIGHT, SIZE
from toolkit.mocap.clip import PoseClip


def neutral() -> Body:
    """Return the body of all these tests."""
    return load_body("neutral")


def random_poses(rng: np.random.Generator, count: int, reach: float = 0.4) -> np.ndarray:
    """Return poses within `reach` times the joint limits, at random places and headings, float64 (count, P)."""
    limits = skeleton.POSE_LIMITS.copy()
    limits[skeleton.ROOT_POSITION] = (-3.0, 3.0)
    limits[skeleton.ROOT_ROTATION] = (-0.5, 0.5)
    poses = reach * rng.uniform(limits[:, 0], limits[:, 1], (count, skeleton.POSE_SIZE))
    poses[:, 4] += rng.uniform(-np.pi, np.pi, count)
    return poses


def moving_clip(name: str, seed: int, frames: int = 60) -> PoseClip:
    """Return a smooth random motion at 30 frames a second."""
    rng = np.random.default_rng(seed)
    keys = random_poses(rng, 4)
    keys[:, skeleton.ROOT_ROTATION] *= 0.1
    times = np.linspace(0, len(keys) - 1, frames)
    poses = np.stack([np.interp(times, np.arange(len(keys)), column) for column in keys.T], axis=1)
    return PoseClip(name, poses, 30.0, name)


@cache
def small_database(count: int = 200, seed: int = 0) -> PoseDatabase:
    """Return random canonical poses with the offsets that a camera sees."""
    poses = canonicalise(random_poses(np.random.default_rng(seed), count))[0]
    return PoseDatabase.of_poses(
        poses, neutral(), PoseOrigins(["random"], ["0"], np.zeros(count), np.arange(count), np.zeros(count))
    )


def write_bvh(path: Path, seed: int, frames: int = 30) -> None:
    """Write a BVH file of our joint tree (metres, rotations z, x, y) in which all joints sway."""
    body = neutral()
    lines = ["HIERARCHY"]

    def joint(number: int, depth: int) -> None:
        pad = "  " * depth
        parent = skeleton.PARENTS[number]
        offset = body.joints[number] - (body.joints[parent] if parent >= 0 else 0.0)
        lines.append(f"{pad}{'ROOT' if depth == 0 else 'JOINT'} {skeleton.JOINT_NAMES[number]}")
        lines.append(f"{pad}{{\n{pad}  OFFSET {offset[0]:.5f} {offset[1]:.5f} {offset[2]:.5f}")
        order.append(number)
        rotations = "Zrotation Xrotation Yrotation"
        lines.append(
            f"{pad}  CHANNELS " + (f"6 Xposition Yposition Zposition {rotations}" if depth == 0 else f"3 {rotations}")
        )
        for child in np.flatnonzero(skeleton.PARENTS == number):
            joint(int(child), depth + 1)
        for site in np.flatnonzero(skeleton.SITE_PARENTS == number):
            x, y, z = body.sites[site] - body.joints[number]
            lines.append(f"{pad}  End Site\n{pad}  {{\n{pad}    OFFSET {x:.5f} {y:.5f} {z:.5f}\n{pad}  }}")
        lines.append(f"{pad}}}")

    order: list[int] = []
    joint(0, 0)
    rng = np.random.default_rng(seed)
    reach, phase = rng.uniform(2, 25, (len(order), 3)), rng.uniform(0, 6, (len(order), 3))
    lines += ["MOTION", f"Frames: {frames}", "Frame Time: 0.033333"]
    for frame in range(frames):
        angles = reach * np.sin(phase + 0.2 * frame)
        lines.append(" ".join(f"{value:.4f}" for value in [0.01 * frame, 0.9, 0.0, *angles.ravel()]))
    path.write_text("\n".join(lines) + "\n")


def known_without(joints: tuple[str, ...], *, floor: bool = False) -> np.ndarray:
    """Return bool (SIZE,): all variables but the angles of `joints`, and but the height unless `floor` is set.

    Joints are those of `skeleton.JOINT_NAMES`, for example `left_hip`.
    """
    known = np.ones(SIZE, dtype=np.bool_)
    for entry, joint in enumerate(skeleton.DOF_JOINT[3:]):
        known[entry] = skeleton.JOINT_NAMES[joint] not in joints
    known[HEIGHT] = floor
    return known
