"""Export of poses as BVH, with the joint names of common animation tools."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.errors import UsageError
from toolkit.io.files import save_text
from toolkit.output.export.tree import OWN, JointTree, tree_of

UNITS: dict[str, float] = {"cm": 100.0, "m": 1.0}
"""File units per metre, by name; animation tools expect centimetres."""
EULER_ORDER = "ZXY"
"""Order of a joint's rotation channels: Z, then X, then Y about the rotated axes."""


def export_bvh(
    path: str | Path, body: Body, poses: np.ndarray, frame_rate: float, *, rig: str = OWN, unit: str = "cm"
) -> None:
    """Write poses as BVH: the body's T-pose as rest pose, constant bone lengths, three Euler channels per joint.

    World y up, degrees. The ends of limbs are end sites. The file is written atomically.

    Parameters
    ----------
    path : the file
    body : the body whose bones are written
    poses : float64 (T, P), in a y-up frame (`track.pose` or `PoseClip.poses`), T at least 1
    frame_rate : frames a second
    rig : joint names and hierarchy, see `tree.tree_of`
    unit : "cm" or "m"

    Raises
    ------
    BodyError
        The poses have another length than those of the body, or a value is not finite.
    UsageError
        There are no poses, the frame rate is not positive, or the unit is unknown.
    RigError
        The rig is unknown.
    OutputError
        The file cannot be written.
    """
    from scipy.spatial.transform import Rotation

    poses = skeleton.check_pose(np.atleast_2d(poses))
    if len(poses) == 0 or not frame_rate > 0:
        raise UsageError(f"cannot export {len(poses)} poses at {frame_rate} frames a second; both must be positive")
    if unit not in UNITS:
        raise UsageError(f"--unit {unit} is unknown; choose one of {', '.join(UNITS)}")
    tree, scale = tree_of(body, rig), UNITS[unit]
    lines, order = ["HIERARCHY"], list[int]()
    _write_joint(tree, 0, 0, lines, order, scale)
    lines += ["MOTION", f"Frames: {len(poses)}", f"Frame Time: {1.0 / frame_rate:.9f}"]
    turns = Rotation.from_rotvec(tree.vectors(poses)[:, order].reshape(-1, 3)).as_euler(EULER_ORDER, degrees=True)
    rows = io.StringIO()
    values = [poses[:, skeleton.ROOT_POSITION] * scale, turns.reshape(len(poses), -1)]
    np.savetxt(rows, np.concatenate(values, axis=1), fmt="%.5f")
    save_text(path, "\n".join(lines) + "\n" + rows.getvalue())


def _write_joint(tree: JointTree, joint: int, depth: int, lines: list[str], order: list[int], scale: float) -> None:
    """Append a joint and all below it to the HIERARCHY section, and the joints in file order to `order`."""
    pad = "\t" * depth
    root = tree.parents[joint] < 0
    channels = [f"{axis}rotation" for axis in EULER_ORDER]
    if root:
        channels = ["Xposition", "Yposition", "Zposition", *channels]
    lines += [
        f"{pad}{'ROOT' if root else 'JOINT'} {tree.names[joint]}",
        pad + "{",
        f"{pad}\tOFFSET {_units(tree.offsets[joint], scale)}",
        f"{pad}\tCHANNELS {len(channels)} {' '.join(channels)}",
    ]
    order.append(joint)
    for child in np.flatnonzero(tree.parents == joint):
        _write_joint(tree, int(child), depth + 1, lines, order, scale)
    if joint in tree.tips:
        tip = _units(tree.tips[joint] - tree.rest[joint], scale)
        lines += [f"{pad}\tEnd Site", pad + "\t{", f"{pad}\t\tOFFSET {tip}", pad + "\t}"]
    lines.append(pad + "}")


def _units(vector: np.ndarray, scale: float) -> str:
    return " ".join(f"{value * scale:.6f}" for value in vector)
