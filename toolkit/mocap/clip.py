"""Motion clips: a moving skeleton of a file (`Clip`), and a sequence of poses of the project's body (`PoseClip`)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import MocapError


@dataclass(frozen=True, eq=False)
class Clip:
    """Moving skeleton in metres and radians, in the file's own world (normally y up).

    Attributes
    ----------
    name : name in reports, normally the stem of its file
    joint_names : the J joints, parents before children, the root first
    parents : int64 (J,), -1 for the root
    offsets : float64 (J, 3), rest position of each joint relative to its parent; at rest every rotation is the identity
    rotations : float64 (T, J, 3, 3), each joint's rotation relative to its parent
    root_positions : float64 (T, 3), world position of the root joint
    frame_rate : frames a second
    translations : float64 (T, J, 3), positions relative to the parent that replace `offsets`, or None (the root's row
        is ignored)
    end_sites : joint name -> offset (3,) from that joint to the tip of its bone
    """

    name: str
    joint_names: tuple[str, ...]
    parents: np.ndarray
    offsets: np.ndarray
    rotations: np.ndarray
    root_positions: np.ndarray
    frame_rate: float
    translations: np.ndarray | None = None
    end_sites: dict[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        max_extent = 1e5  # largest plausible distance from the origin, metres
        for array in (self.offsets, self.root_positions, self.rotations, self.translations):
            if array is not None and not max(array.max(), -array.min()) <= max_extent:
                raise MocapError(
                    f"clip {self.name!r} moves farther than {max_extent:g} m or holds values that are not finite; "
                    "repair it or give its unit"
                )

    def __len__(self) -> int:
        return len(self.root_positions)

    @cached_property
    def rest(self) -> np.ndarray:
        """Float64 (J, 3): joint positions in the rest pose, root at the origin, metres."""
        positions = np.zeros_like(self.offsets)
        for j, parent in enumerate(self.parents):
            if parent >= 0:
                positions[j] = positions[parent] + self.offsets[j]
        return positions

    def world(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the world positions (T, J, 3) in metres and rotations (T, J, 3, 3) of every joint in every frame."""
        positions = np.empty((len(self), len(self.joint_names), 3))
        rotations = np.empty_like(self.rotations)
        for j, parent in enumerate(self.parents):
            if parent < 0:
                rotations[:, j] = self.rotations[:, j]
                positions[:, j] = self.root_positions
                continue
            rotations[:, j] = rotations[:, parent] @ self.rotations[:, j]
            step = self.offsets[j][:, None] if self.translations is None else self.translations[:, j, :, None]
            positions[:, j] = positions[:, parent] + (rotations[:, parent] @ step)[..., 0]
        return positions, rotations

    def index(self, joint: str) -> int:
        """Return the number of a joint by its name; raise MocapError for an unknown name."""
        if joint not in self.joint_names:
            raise MocapError(f"clip {self.name!r} has no joint {joint!r}; it has: {', '.join(self.joint_names)}")
        return self.joint_names.index(joint)

    def resampled(self, rate: float) -> Clip:
        """Return the clip at `rate` frames a second: rotations by slerp, positions by linear interpolation."""
        if not rate > 0:
            raise MocapError(f"a clip cannot be resampled to {rate} frames a second; use a positive rate")
        times = _sample_times(len(self), self.frame_rate, rate)
        low, weight = _neighbours(times * self.frame_rate, len(self))
        blend = weight[:, None]
        moved = None
        if self.translations is not None:
            moved = _lerp(self.translations, low, weight[:, None, None])
        return replace(
            self,
            rotations=_slerp(self.rotations, low, weight),
            root_positions=_lerp(self.root_positions, low, blend),
            translations=moved,
            frame_rate=float(rate),
        )


@dataclass(frozen=True, eq=False)
class PoseClip:
    """Sequence of poses of the project's body.

    Attributes
    ----------
    name : name in reports
    poses : float64 (T, P), `skeleton.POSE_NAMES`, in a y-up world frame, metres and radians
    frame_rate : frames a second
    source : file or generator of the poses
    clamped : float64 (P,), fraction of frames in which an entry was clipped to its limits
    """

    name: str
    poses: np.ndarray
    frame_rate: float
    source: str
    clamped: np.ndarray = field(default_factory=lambda: np.zeros(skeleton.POSE_SIZE))

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", skeleton.check_pose(self.poses))

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def timestamps(self) -> np.ndarray:
        """Float64 (T,), seconds from the first frame."""
        return np.arange(len(self)) / self.frame_rate

    def every(self, rate: float) -> PoseClip:
        """Return the nearest whole frames at about `rate` frames a second (at most the clip's own rate)."""
        times = _sample_times(len(self), self.frame_rate, min(rate, self.frame_rate))
        rows = np.round(times * self.frame_rate).astype(np.int64)
        return replace(self, poses=self.poses[rows], frame_rate=min(float(rate), self.frame_rate))


def _sample_times(frames: int, rate: float, new_rate: float) -> np.ndarray:
    """Return times (seconds from the first frame) at `new_rate` within `frames` frames at `rate`."""
    count = int(np.floor((frames - 1) / rate * new_rate + 1e-9)) + 1
    return np.arange(count) / new_rate


def _neighbours(places: np.ndarray, frames: int) -> tuple[np.ndarray, np.ndarray]:
    low = np.clip(np.floor(places + 1e-9).astype(np.int64), 0, max(frames - 2, 0))
    return low, np.clip(places - low, 0.0, 1.0)


def _lerp(values: np.ndarray, low: np.ndarray, weight: np.ndarray) -> np.ndarray:
    high = np.minimum(low + 1, len(values) - 1)
    return values[low] * (1.0 - weight) + values[high] * weight


def _slerp(rotations: np.ndarray, low: np.ndarray, weight: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    high = np.minimum(low + 1, len(rotations) - 1)
    start = rotations[low]
    turn = Rotation.from_matrix((np.swapaxes(start, -1, -2) @ rotations[high]).reshape(-1, 3, 3)).as_rotvec()
    share = np.repeat(weight, rotations.shape[1])[:, None]
    return start @ Rotation.from_rotvec(turn * share).as_matrix().reshape(start.shape)
