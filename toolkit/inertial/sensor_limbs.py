"""Parts of the body with a sensor, and their tracked orientation and path."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.body.body import BONE_AXIS, Body
from toolkit.io.errors import InertialError
from toolkit.tracks import TRACKED, RunInfo, Track

_CENTRAL = {"head": ("cervical", "head"), "chest": ("thorax", "cervical"), "pelvis": ("root", "root")}
_PAIRED = {
    "upper_arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist"), "hand": ("wrist", "hand"),
    "thigh": ("hip", "knee"), "shin": ("knee", "ankle"), "foot": ("ankle", "foot"),
}  # fmt: skip

PARTS: dict[str, tuple[str, str]] = {
    **_CENTRAL,
    **{f"{s}_{limb}": (f"{s}_{a}", f"{s}_{b}") for s in ("left", "right") for limb, (a, b) in _PAIRED.items()},
}
"""Joint whose frame each part of the body has, and the joint or site at its other end."""


def joint_of(limb: str) -> int:
    """Return the row of `skeleton.JOINTS` whose frame a part of the body has."""
    return skeleton.JOINT_NAMES.index(PARTS[limb][0])


def bone_axis(limb: str) -> np.ndarray:
    """Return the unit vector (3,) along the part's bone in its frame."""
    return np.eye(3)[BONE_AXIS[PARTS[limb][0].removeprefix("left_").removeprefix("right_")]]


def bone_vector(body: Body, limb: str) -> np.ndarray:
    """Return the vector from the joint of a part of the body to its other end at rest: float64 (3,), metres."""
    start, stop = PARTS[limb]
    points = dict(zip(skeleton.JOINT_NAMES, body.joints, strict=True))
    points.update(zip((name for name, _ in skeleton.SITES), body.sites, strict=True))
    return points[stop] - points[start]


@dataclass(frozen=True, eq=False)
class TrackedMotion:
    """Tracked motion of a body, for comparison with sensors.

    Attributes
    ----------
    name : name of the run
    times : float64 (T,), seconds, increasing
    rotations : float64 (T, 18, 3, 3), of the joints' frames, level frame
    origins : float64 (T, 18, 3), of the joints, level frame, metres
    valid : bool (T,), frames with a tracked person
    body : body of the motion
    sensors_sha256 : SHA-256 of the sensor file that guided the tracker, empty without one
    """

    name: str
    times: np.ndarray
    rotations: np.ndarray
    origins: np.ndarray
    valid: np.ndarray
    body: Body
    sensors_sha256: str = ""

    @classmethod
    def of_poses(
        cls, body: Body, poses: np.ndarray, times: np.ndarray, valid: np.ndarray | None = None, name: str = "motion"
    ) -> TrackedMotion:
        """Return the motion of poses (T, P), level frame, at `times` (T,), by forward kinematics."""
        placed = [body.place(pose) for pose in np.atleast_2d(poses)]
        return cls(
            name,
            np.asarray(times, np.float64),
            np.array([p.rotations for p in placed]),
            np.array([p.origins for p in placed]),
            np.ones(len(placed), dtype=bool) if valid is None else np.asarray(valid, dtype=bool),
            body,
        )

    @classmethod
    def load(cls, run: str | Path) -> TrackedMotion:
        """Return the motion of a finished run folder.

        Raises
        ------
        TrackError
            There is no run, or its body differs.
        InertialError
            Fewer than three frames were tracked.
        """
        track, info = Track.load(run), RunInfo.load(run)
        valid = track.state == TRACKED
        if valid.sum() < 3:
            raise InertialError(f"{run} holds {valid.sum()} tracked frames; at least 3 are needed")
        motion = cls.of_poses(info.body(), track.pose, track.timestamps, valid, Path(run).name)
        return replace(motion, sensors_sha256=info.sensors_sha256)

    def orientation(self, limb: str) -> Rotation:
        """Return the T orientations of a part of the body, level frame."""
        return Rotation.from_matrix(self.rotations[:, joint_of(limb)])

    def middle(self, limb: str) -> np.ndarray:
        """Return the path of the midpoint of a part of the body, level frame: float64 (T, 3), metres."""
        return self.origins[:, joint_of(limb)] + self.orientation(limb).apply(0.5 * bone_vector(self.body, limb))
