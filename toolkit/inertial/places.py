"""Whether every sensor sits where the placement says: each is calibrated against every part of the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit import skeleton
from toolkit.inertial import solvers
from toolkit.inertial.calibrate import Take, upright
from toolkit.inertial.solvers import Strand
from toolkit.rotations import quaternions as quat

ROWS = 120
BETTER = 0.7
"""Share of its own residual that another assignment must stay below before it is believed."""


def other_side(limb: str) -> str:
    """The same part of the body on the other side; itself where it has none."""
    if limb.startswith("left_"):
        return "right_" + limb.removeprefix("left_")
    return "left_" + limb.removeprefix("right_") if limb.startswith("right_") else limb


def residual(take: Take, sensor: str, limb: str) -> float:
    """Median residual in degrees of one sensor of a take, calibrated by itself on any part of the body."""
    stream = next(stream for stream in take.sensors if stream.name == sensor)
    inertial, known = stream.at(take.clock.sensor_times(take.motion.times))
    rows = known & take.motion.valid
    if rows.sum() < 10:
        return 180.0
    change = quat.conjugate(upright(take.sensors.world_up))
    tracked = take.motion.orientation(limb)[rows]
    strand = Strand(0, 0, quat.multiply(change, inertial[rows]), tracked).thinned(ROWS)
    psis, mountings, _ = solvers.heading([strand], 1, 1)
    return float(np.degrees(np.median(solvers.residuals(strand, solvers.yaw(psis[0]), mountings[0]))))


def place_suspicions(take: Take) -> list[str]:
    """Sentences where the sensors fit each other's parts of the body clearly better, or a mirrored track.

    Of a body in a mirror the speeds are right and the turns are not: no offsets can explain them.
    """
    from scipy.optimize import linear_sum_assignment

    names = take.sensors.names
    matrix = np.array([[residual(take, sensor, limb) for limb in names] for sensor in names])
    own = np.diagonal(matrix)
    reflected = mirrored_take(take)
    across = np.array([residual(reflected, name, name) for name in names])
    if across.mean() < BETTER * own.mean() and (across <= own).mean() > 0.5:
        return [
            f"the sensors fit the track better in a mirror (residuals {_listed(across)} instead of {_listed(own)} "
            "degrees); the recording may be mirrored, track it with --mirrored"
        ]
    rows, columns = linear_sum_assignment(matrix)
    moved = [(k, j) for k, j in zip(rows, columns, strict=True) if k != j]
    if not moved or sum(matrix[k, j] for k, j in moved) >= BETTER * sum(own[k] for k, _ in moved):
        return []
    return [
        f"the sensor on {names[k]} fits {names[j]} better, by {matrix[k, j]:.0f} instead of {own[k]:.0f} degrees; "
        "sensors may be exchanged"
        for k, j in moved
    ]


def _listed(values: np.ndarray) -> str:
    return ", ".join(f"{value:.0f}" for value in values)


def mirrored_take(take: Take) -> Take:
    """The take as it would have been tracked in a mirror at x = 0: left and right exchanged."""
    rows = [skeleton.JOINT_NAMES.index(other_side(name)) for name in skeleton.JOINT_NAMES]
    rotations = take.motion.rotations[:, rows] * (1.0, 1.0, -1.0, -1.0)
    origins = take.motion.origins[:, rows] * (-1.0, 1.0, 1.0)
    return replace(take, motion=replace(take.motion, rotations=rotations, origins=origins))
