"""Skeleton of a motion file in file units, its size, and its conversion to a clip in metres."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from toolkit.body.rotations.matrices import of_euler
from toolkit.io.errors import MocapError
from toolkit.mocap.clip import Clip

CMU_UNIT = 0.0254 / 0.45
"""Metres per file unit of the CMU and HDM05 skeletons: inches, scaled by 1 / 0.45 (0.056444 m)."""


@dataclass
class FileSkeleton:
    """Joint tree of a file: the root first, parents before children, file units.

    Attributes
    ----------
    file : name of the file, for messages
    names, parents : joints, and the numbers of their parents, -1 for the root
    offsets : (3,) each, rest position relative to the parent
    channels : columns of each joint: "t" (position) or "r" (rotation) and an axis; "l" (length) has no effect. Axes in
        small letters are fixed, the first one applied first; those in capitals turn with the rotations before them
    tips : joint -> offset (3,) to the tip of its bone
    frames : (3, 3) each, axes of a joint's rotations at rest; empty: those of the file
    shifted : position channels of a joint below the root are added to its offset instead of replacing it
    """

    file: str
    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[np.ndarray] = field(default_factory=list)
    channels: list[list[str]] = field(default_factory=list)
    tips: dict[str, np.ndarray] = field(default_factory=dict)
    frames: list[np.ndarray] = field(default_factory=list)
    shifted: bool = False

    def check(self) -> None:
        """Raise MocapError for a repeated joint or channel."""
        if repeated := [joint for joint, count in Counter(self.names).items() if count > 1]:
            raise MocapError(f"{self.file} names the joint {repeated[0]!r} twice; rename one of them")
        for joint, channels in zip(self.names, self.channels, strict=True):
            if len(set(channels)) < len(channels):
                moved = " ".join(channels)
                raise MocapError(f"{self.file} moves {joint!r} twice about one axis or along it ({moved}); repair it")

    def size(self) -> float:
        """Return the largest extent of joints and tips at rest: about the height, in T-pose and A-pose alike."""
        places: dict[str, np.ndarray] = {}
        for joint, offset, parent in zip(self.names, self.offsets, self.parents, strict=True):
            places[joint] = offset + places[self.names[parent]] if parent >= 0 else np.zeros(3)
        tips = [places[joint] + tip for joint, tip in self.tips.items()]
        return float(np.ptp(np.array([*places.values(), *tips]), axis=0).max())

    def clip(self, name: str, values: np.ndarray, frame_rate: float, metres: float, *, degrees: bool = True) -> Clip:
        """Return the clip of a table (T, columns) as written; `metres` is one file unit.

        Raises
        ------
        MocapError
            An angle is no joint angle.
        """
        offsets = np.array(self.offsets, dtype=np.float64) * metres
        rotations = np.broadcast_to(np.eye(3), (len(values), len(self.names), 3, 3)).copy()
        places = np.broadcast_to(offsets, (len(values), len(self.names), 3)).copy()
        start = 0
        for j, channels in enumerate(self.channels):
            own = values[:, start : start + len(channels)]
            start += len(channels)
            if order := "".join(channel[1] for channel in channels if channel[0] == "r"):
                angles = own[:, [channel[0] == "r" for channel in channels]]
                turned = of_euler(order, angles, degrees=degrees, name=f"{self.names[j]!r} of {self.file}")
                rotations[:, j] = self.frames[j] @ turned @ self.frames[j].T if self.frames else turned
            for k, channel in enumerate(channels):
                if channel[0] == "t":
                    axis = "xyz".index(channel[1].lower())
                    moved = own[:, k] * metres
                    places[:, j, axis] = moved + offsets[j, axis] if self.shifted and j else moved
        moves_joints = any(channel[0] == "t" for channels in self.channels[1:] for channel in channels)
        return Clip(
            name=name,
            joint_names=tuple(self.names),
            parents=np.array(self.parents, dtype=np.int64),
            offsets=offsets,
            rotations=rotations,
            root_positions=places[:, 0].copy(),
            frame_rate=frame_rate,
            translations=places if moves_joints else None,
            end_sites={joint: tip * metres for joint, tip in self.tips.items()},
        )


def metres_per_unit(size: float, name: str) -> float:
    """Return the metres of one file unit of a skeleton of `size` file units, by the first unit that fits.

    The skeleton is 0.9 to 2.3 m tall then: 0.9 to 2.3 units are metres, 16 to 40.7 CMU units, 40.8 to 90 inches, 90 to
    230 centimetres, 900 to 2,300 millimetres.

    Raises
    ------
    MocapError
        No unit fits.
    """
    # Metres, CMU units, inches, centimetres, millimetres. Only sizes of 35 to 41 fit two: CMU units, and inches of a
    # child.
    for guess in (1.0, CMU_UNIT, 0.0254, 0.01, 0.001):
        if is_person(size * guess):
            return guess
    raise MocapError(
        f"{name}: the skeleton is {size:.4g} file units tall, which fits no usual unit; scale it to metres"
    )


def is_person(metres: float) -> bool:
    """Return True for the size of a child or an adult, 0.9 to 2.3 m."""
    return 0.9 <= metres <= 2.3
