"""Seated poses: the upper body of any motion above legs on a seat."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.mocap.choreography import BASE
from toolkit.mocap.procedural import CONTROLS, poses_from_controls
from toolkit.simulation.furniture import SEAT_HEIGHT

LEGS = np.array(
    [i for i, name in enumerate(skeleton.POSE_NAMES) if any(part in name for part in ("hip", "knee", "ankle"))]
)
"""Pose entries of both legs."""
SLOUCH = 6.0
"""Degrees of backward tilt of the pelvis on a seat."""


def seat_height(body: Body) -> float:
    """Return the height of the seat of a person, metres."""
    return SEAT_HEIGHT * body.height


def neck_height(body: Body, *, seated: bool = False) -> float:
    """Return the height of the neck above the floor of an upright person, metres: at the shoulders."""
    neck = 0.30  # height of a seated person's neck above the seat, as a fraction of the stature
    if seated:
        return seat_height(body) + neck * body.height
    shoulder = body.joints[skeleton.JOINT_NAMES.index("left_shoulder"), 1]
    return float(shoulder - body.vertices[:, 1].min())


def seated(poses: np.ndarray, body: Body, rng: np.random.Generator) -> np.ndarray:
    """Return a motion performed by a seated person: poses (T, P) with hips above the origin, facing +z, floor at y = 0.

    Spine, head and arms keep their motion. The root stays on the seat and keeps a quarter of
    its rotation. Thighs are on the seat, shins lean by a random angle of up to 15 degrees, and feet are flat on the
    floor (or hang, if the legs are too short).

    Parameters
    ----------
    poses : float64 (T, P), any y-up frame
    body : body on a seat of height `seat_height(body)`
    rng : generator of the spread, position and restlessness of the legs
    """
    from scipy.spatial.transform import Rotation

    result = poses.copy()
    turns = Rotation.from_rotvec(poses[:, skeleton.ROOT_ROTATION])
    upright = turns.mean().as_euler("YXZ")[0]
    sway = (Rotation.from_euler("Y", -upright) * turns).as_euler("YXZ", degrees=True)
    sway[:, 1:] -= sway[:, 1:].mean(axis=0)
    kept = 0.25  # fraction of the root's own rotation
    sway = kept * np.clip(sway, -40.0, 40.0)
    result[:, skeleton.ROOT_ROTATION] = Rotation.from_euler("YXZ", sway - [0.0, SLOUCH, 0.0], degrees=True).as_rotvec()
    result[:, LEGS] = _legs(len(poses), body, rng)[:, LEGS]
    result[:, skeleton.ROOT_POSITION] = 0.0
    lowest = _thigh_bottom(body, result[0])
    result[:, 1] = seat_height(body) - lowest
    return result


def _legs(count: int, body: Body, rng: np.random.Generator) -> np.ndarray:
    """Return poses (count, P) with the legs of an upright seated person."""
    controls = np.tile(np.array([BASE[name] for name in CONTROLS]), (count, 1))
    times = np.arange(count)[:, None] / 30.0
    for side in ("left", "right"):
        hip, knee, ankle = (skeleton.JOINT_NAMES.index(f"{side}_{name}") for name in ("hip", "knee", "ankle"))
        thigh = np.linalg.norm(body.joints[knee] - body.joints[hip])
        shin = np.linalg.norm(body.joints[ankle] - body.joints[knee])
        sole = body.joints[ankle, 1] - body.vertices[:, 1].min()
        lean = np.radians(rng.uniform(-15.0, 15.0))
        hip_above_floor = seat_height(body) + 0.05 * body.height
        drop = (hip_above_floor - shin * np.cos(lean) - sole) / thigh
        flex = np.degrees(np.arccos(np.clip(drop, -0.2, 0.2)))
        wobble = 2.0 * np.sin(2 * np.pi * (rng.uniform(0.1, 0.4) * times[:, 0] + rng.random()))
        values = {"flex": flex, "knee": flex + np.degrees(lean), "open": rng.uniform(3.0, 14.0) + wobble}
        for name, value in values.items():
            controls[:, CONTROLS.index(f"{side}_{name}")] = value
    legs = poses_from_controls(controls)
    hips = [i for i, name in enumerate(skeleton.POSE_NAMES) if name.endswith("hip_rx")]
    legs[:, hips] += np.radians(SLOUCH)
    low, high = skeleton.POSE_LIMITS[6:].T
    legs[:, 6:] = np.clip(legs[:, 6:], low, high)
    return legs


def _thigh_bottom(body: Body, pose: np.ndarray) -> float:
    """Return the height of the lowest skin of seat and thighs relative to the root, for a root at the origin."""
    carriers = [skeleton.JOINT_NAMES.index(name) for name in ("root", "left_hip", "right_hip")]
    skin = body.vertex_positions(pose)[np.isin(body.part, carriers)]
    near = np.abs(skin[:, 2]) < 0.1 * body.height
    return float(skin[near, 1].min())
