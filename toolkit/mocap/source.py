"""Conversion of a foreign clip to the keys of a joint map, in a y-up world, relative to the body frame at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body.rotations.matrices import apply, swing, transposed, unit
from toolkit.io.errors import RigError
from toolkit.mocap.clip import Clip
from toolkit.mocap.rig import Rig

LIMB_BONES: tuple[tuple[str, str], ...] = tuple(
    (f"{side}_{start}", f"{side}_{stop}")
    for side in ("left", "right")
    for start, stop in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
)


@dataclass(frozen=True, eq=False)
class KeyedClip:
    """Positions and rotations of a clip for the keys of a rig and for `skull`, the centre of the skull.

    Attributes
    ----------
    positions : key -> float64 (T, 3), metres, y-up world
    rotations : key -> float64 (T, 3, 3), from the body frame at rest to the world
    rest : key -> float64 (3,), rest position in the body frame, metres
    """

    positions: dict[str, np.ndarray]
    rotations: dict[str, np.ndarray]
    rest: dict[str, np.ndarray]

    @staticmethod
    def of(clip: Clip, rig: Rig) -> KeyedClip:
        """Convert a clip by a joint map, without its leading calibration frames.

        Raises RigError if a limb bone has no length, or the rest pose is not aligned with the axes.
        """
        axes = _rest_axes(clip, rig)
        placed, turned = clip.world()
        upright = _upright_world(turned[:, clip.index(rig.joints["root"])], axes[:, 1])
        source = KeyedClip({}, {}, {})
        for key, joint in rig.joints.items():
            j = clip.index(joint)
            source.positions[key] = placed[:, j] @ upright.T
            source.rotations[key] = upright @ turned[:, j] @ axes
            source.rest[key] = clip.rest[j] @ axes
        source.positions.setdefault(
            "cervical", 0.5 * (source.positions["left_shoulder"] + source.positions["right_shoulder"])
        )
        source.rest.setdefault("cervical", 0.5 * (source.rest["left_shoulder"] + source.rest["right_shoulder"]))
        tips = [("skull", "head", 0.5)]
        tips += [
            (f"{s}_{tip}", f"{s}_{end}", 1.0)
            for s in ("left", "right")
            for tip, end in (("hand", "wrist"), ("foot", "ankle"))
        ]
        for tip, carrier, share in tips:
            if tip in source.rest:
                continue
            offset = clip.end_sites.get(rig.joints[carrier])
            if offset is None and tip != "skull":
                continue
            local = np.zeros(3) if offset is None else share * offset @ axes
            source.rest[tip] = source.rest[carrier] + local
            source.positions[tip] = source.positions[carrier] + source.rotations[carrier] @ local
        return source._from(calibration_frames(source, clip.frame_rate))

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.positions["root"])

    @property
    def pelvis(self) -> np.ndarray:
        """Midpoint of the hips, float64 (T, 3)."""
        return 0.5 * (self.positions["left_hip"] + self.positions["right_hip"])

    def has(self, key: str) -> bool:
        """Return True if the clip has a joint or a tip."""
        return key in self.rest

    def bone(self, start: str, stop: str) -> tuple[np.ndarray, np.ndarray]:
        """Return unit vectors from one key to another: at rest in the body frame (3,), and in every frame (T, 3)."""
        return unit(self.rest[stop] - self.rest[start]), unit(self.positions[stop] - self.positions[start])

    def _from(self, start: int) -> KeyedClip:
        return KeyedClip(
            {key: values[start:] for key, values in self.positions.items()},
            {key: values[start:] for key, values in self.rotations.items()},
            self.rest,
        )


def _rest_axes(clip: Clip, rig: Rig) -> np.ndarray:
    """Return left, up and forward of the rest pose as columns: a rotation (3, 3) from the body frame."""
    rest = {key: clip.rest[clip.index(joint)] for key, joint in rig.joints.items()}
    for start, stop in (*LIMB_BONES, ("left_hip", "right_hip"), ("left_shoulder", "right_shoulder")):
        if np.linalg.norm(rest[stop] - rest[start]) < 1e-4:
            raise RigError(
                f"{rig.joints[start]} and {rig.joints[stop]} of {clip.name!r} lie at one place in the rest pose; "
                "export it with a T-pose or A-pose as rest pose"
            )
    hips, shoulders = rest["left_hip"] + rest["right_hip"], rest["left_shoulder"] + rest["right_shoulder"]
    left = _nearest_axis(rest["left_hip"] - rest["right_hip"])
    up = _nearest_axis(shoulders - hips)
    if left @ up != 0.0:
        raise RigError(
            f"the rest pose of {clip.name!r} does not stand along the axes of its file; "
            "export it with a T-pose or A-pose as rest pose"
        )
    return np.stack([left, up, np.cross(left, up)], axis=1)


def _upright_world(root_rotations: np.ndarray, up_at_rest: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of a file's world to y up.

    The world's vertical is +y or the upward axis of the rest pose, whichever is nearer to the root's mean upward axis.
    """
    mean = (root_rotations @ up_at_rest).mean(axis=0)
    if mean @ up_at_rest <= mean[1]:
        return np.eye(3)
    return swing(up_at_rest, np.array([0.0, 1.0, 0.0]))[0]


def calibration_frames(source: KeyedClip, frame_rate: float) -> int:
    """Return the number of leading frames of a calibration pose (CMU BVH: one, rarely two).

    In all of them each limb bone is close to the T-pose or the file's rest pose; after them at least one bone jumps.
    """
    longest = 5  # largest number of leading calibration frames
    near = np.cos(0.4)  # of the largest angle of a limb bone from the T-pose and from the file's rest pose, radians
    fast, far = 20.0, 0.7  # radians a second, and radians in one frame, beyond which a limb bone ends the pose
    head = min(longest + 1, source.frames)
    still, jumps = np.ones(head, dtype=bool), np.zeros(head, dtype=bool)
    root = transposed(source.rotations["root"][:head])
    least_jump = min(fast / frame_rate, far)
    for start, stop in LIMB_BONES:
        rest, now = source.bone(start, stop)
        now = now[:head]
        straight = np.array([0.0, -1.0, 0.0])
        if "hip" not in start and "knee" not in start:
            straight = np.array([1.0 if start.startswith("left") else -1.0, 0.0, 0.0])
        own = apply(root, now)
        still &= np.maximum(own @ straight, own @ rest) > near
        jumps[:-1] |= (now[1:] * now[:-1]).sum(axis=1) < np.cos(least_jump)
    return max((t + 1 for t in range(head) if jumps[t] and still[: t + 1].all()), default=0)


def _nearest_axis(vector: np.ndarray) -> np.ndarray:
    axis = np.zeros(3)
    k = int(np.abs(vector).argmax())
    axis[k] = np.sign(vector[k])
    return axis
