"""Plausibility of a mocap clip: frame rate, units of angles, sides and root motion."""

from __future__ import annotations

import warnings

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import MocapError, PlausibilityWarning, RigError
from toolkit.mocap.clip import Clip, PoseClip
from toolkit.mocap.rig import load_rig

FEWEST_FRAMES = 10
"""Minimum number of frames for a statement about motion."""


def check_clip(clip: Clip) -> Clip:
    """Return a clip after a check of its plausibility.

    Raises
    ------
    MocapError
        The frame rate is outside 5 to 1,000 Hz.

    Warns
    -----
    PlausibilityWarning
        No joint turns, the root stays in place while the joints turn, or left and right are exchanged at rest.
    """
    slowest, fastest = 5.0, 1000.0  # frame rates in Hz of motion capture; a frame time in milliseconds gives 0.03 Hz
    if not slowest <= clip.frame_rate <= fastest:
        raise MocapError(
            f"clip {clip.name!r} has {clip.frame_rate:g} frames a second; motion capture has {slowest:g} to "
            f"{fastest:g}: write the frame time in seconds, not milliseconds"
        )
    for text in _doubts(clip):
        warnings.warn(PlausibilityWarning(f"{clip.name}: {text}; see docs/troubleshooting.md"), stacklevel=3)
    return clip


def check_limits(clip: PoseClip) -> PoseClip:
    """Return retargeted poses after a check of the entries that were clipped to the limits of the body.

    Warns
    -----
    PlausibilityWarning
        An entry was clipped in most frames, as by wrong units, sides or joint names.
    """
    mostly = 0.5  # fraction of the frames; 84 of 88 clips of HDM05 and CMU have no such angle
    clipped = [i for i in np.argsort(-clip.clamped, kind="stable").tolist() if clip.clamped[i] > mostly]
    if clipped and len(clip.poses) >= FEWEST_FRAMES:
        entries = ", ".join(f"{skeleton.POSE_NAMES[i]} {100 * clip.clamped[i]:.0f} %" for i in clipped[:3])
        text = f"angles are beyond the limits of the body in most frames ({entries}); check units, sides and joint map"
        warnings.warn(PlausibilityWarning(f"{clip.name}: {text}; see docs/troubleshooting.md"), stacklevel=3)
    return clip


def _doubts(clip: Clip) -> list[str]:
    try:
        joints = {key: clip.joint_names.index(name) for key, name in load_rig(clip).joints.items()}
    except RigError:
        joints = {}
    found = []
    step = 30.0  # degrees that a knee turns in a step or a squat, which move the root
    if len(clip) >= FEWEST_FRAMES:
        turns = _turns(clip)
        knees = [turns[joints[key]] for key in ("left_knee", "right_knee") if key in joints]
        full_turn = 2.0 * np.pi  # degrees: range of the angles of a full turn if radians are read as degrees
        if turns.max() < full_turn:
            still = f"no joint turns by more than {turns.max():.1f} degrees"
            found.append(f"{still}; nothing moves, or radians have to be given in degrees")
        elif max(knees, default=0.0) > step and np.ptp(clip.root_positions, axis=0).max() == 0.0:
            found.append("the root stays in one place; export the motion with position channels of the root")
    # Minimum of the normalised triple product of left, up and forward, for a statement about sides; 1 at right
    # angles.
    sideways = 0.3
    if _sides(clip, joints) < -sideways:
        found.append("the rest pose has left and right exchanged, or is mirrored by a negative scale")
    return found


def _turns(clip: Clip) -> np.ndarray:
    """Return the largest rotation of each joint from its rotation in the first frame, degrees: float64 (J,)."""
    cosines = (np.einsum("tjaa->tj", np.einsum("jba,tjbc->tjac", clip.rotations[0], clip.rotations)) - 1.0) / 2.0
    return np.asarray(np.rad2deg(np.arccos(np.clip(cosines, -1.0, 1.0)).max(axis=0)))


def _sides(clip: Clip, joints: dict[str, int]) -> float:
    """Return the triple product of left, up and forward at rest, each of length 1; 0 for a skeleton without feet.

    `joints` are the numbers of the joints by the keys of a rig.
    """
    if not {"left_foot", "right_foot"} <= joints.keys():
        return 0.0

    def place(key: str) -> np.ndarray:
        return clip.rest[joints[key]]

    left, up = place("left_hip") - place("right_hip"), place("head") - place("root")
    forward = place("left_foot") + place("right_foot") - place("left_ankle") - place("right_ankle")
    lengths = np.linalg.norm(left) * np.linalg.norm(up) * np.linalg.norm(forward)
    return float(left @ np.cross(up, forward) / lengths) if lengths > 0 else 0.0
