"""What looks wrong with sensor data, said with the evidence: units, order of quaternions, clocks, places.

Nothing is mended by itself: a suspicion may be wrong, and a person who exported the file knows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.body import skeleton
from toolkit.body.rotations import quaternions as quat
from toolkit.inertial import solvers
from toolkit.inertial.calibrate import CalibrationSequence, upright
from toolkit.inertial.solvers import SynchronisedSegment
from toolkit.inertial.stream import GRAVITY, Sensors, SensorStream

FASTEST = 35.0
"""rad/s: the range of common gyroscopes (2000 deg/s); no person turns a limb faster."""
MOVING = 0.3
"""rad/s: slower rows say nothing about the order of a quaternion."""
OVER = 0.1
"""Seconds over which orientations are differentiated."""
LEAST = 20
"""Rows in motion that say something about the order of a quaternion."""
AGREEMENT = 0.6
"""Least correlation of gyroscope and derivative of the orientation in a stream that is as it should be."""
FAR_RATE = 0.05
"""By how much clocks may differ in rate before it is said: quartz differs by a ten thousandth."""

PLACE_ROWS = 120
"""Frames per sensor and part of the body by which a placement is tried."""
BETTER = 0.7
"""Share of its own residual that another assignment must stay below before it is believed."""

_ORDERS: dict[str, tuple[str, list[int], list[float]]] = {
    "conjugated": ("they turn world into sensor coordinates", [0, 1, 2, 3], [1.0, -1.0, -1.0, -1.0]),
    "x y z w": ("their real part stands last", [3, 0, 1, 2], [1.0, 1.0, 1.0, 1.0]),
    "x y z w, conjugated": (
        "their real part stands last and they turn world into sensor coordinates",
        [3, 0, 1, 2],
        [1.0, -1.0, -1.0, -1.0],
    ),
}


def suspicions(sensors: Sensors) -> list[str]:
    """Sentences about single streams: units, order of quaternions, times."""
    return [sentence for stream in sensors for sentence in (*_units(stream), *_order(stream))]


def clock_suspicion(rate: float) -> list[str]:
    """A sentence where the ratio of the clocks is far from 1."""
    if abs(rate - 1.0) <= FAR_RATE:
        return []
    return [
        f"the sensors' clock runs {rate:.3f} times as fast as the camera's: one of the two recordings says the wrong "
        f"frame rate; if it is the camera's, its frames lie {1000 * rate / 30.0:.0f} ms apart where it says 33"
    ]


def _units(stream: SensorStream) -> list[str]:
    found = []
    if stream.gyro is not None:
        speed = np.linalg.norm(stream.gyro[stream.valid], axis=1)
        if len(speed) and (fast := float(np.quantile(speed, 0.99))) > FASTEST:
            found.append(
                f"sensor {stream.name} turns by up to {fast:.0f} rad/s; its gyroscope may be in deg/s "
                "(--units gyro=deg/s)"
            )
    if stream.acceleration is not None:
        sizes = np.linalg.norm(stream.acceleration[stream.valid], axis=1)
        size = float(np.median(sizes)) if len(sizes) else GRAVITY
        if 0.8 < size < 1.25:
            found.append(
                f"sensor {stream.name} measures {size:.2f} m/s2 most of the time; its accelerometer may be in g "
                "(--units acceleration=g)"
            )
        elif size < 0.5 * GRAVITY:
            found.append(
                f"sensor {stream.name} measures {size:.2f} m/s2 most of the time, less than gravity; its acceleration "
                "may be without gravity, which cannot be used"
            )
    return found


def _order(stream: SensorStream) -> list[str]:
    """Whether another reading of the quaternions agrees with the gyroscope where this one does not."""
    if stream.rotations is None or stream.gyro is None:
        return []
    rows = np.flatnonzero(stream.valid)
    # over single steps the derivative is mostly noise
    rows = rows[:: max(1, round(OVER * stream.rate))]
    q, times = stream.rotations[rows], stream.times[rows]
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(np.where(stream.valid[:, None], stream.gyro, 0.0), axis=0)])
    counts = np.concatenate([[0], np.cumsum(stream.valid)])
    rates = (sums[rows[1:]] - sums[rows[:-1]]) / np.maximum(counts[rows[1:]] - counts[rows[:-1]], 1)[:, None]
    if len(rates) < LEAST:
        return []
    scale = np.pi / 180.0 if np.quantile(np.linalg.norm(rates, axis=1), 0.99) > FASTEST else 1.0
    close = (np.diff(times) < 2.0 * OVER) & (np.linalg.norm(rates, axis=1) * scale > MOVING)
    if close.sum() < LEAST:
        return []
    as_read = agreement(q, times, rates, close)
    if as_read >= AGREEMENT:
        return []
    scores = {
        name: agreement(q[:, places] * signs, times, rates, close) for name, (_, places, signs) in _ORDERS.items()
    }
    best = max(scores, key=lambda name: scores[name])
    if scores[best] < max(AGREEMENT, as_read + 0.2):
        return [
            f"the gyroscope of sensor {stream.name} contradicts its orientations (correlation {as_read:.2f}), in any "
            "order of the quaternion; check axes and handedness"
        ]
    return [
        f"the quaternions of sensor {stream.name} look {best}: {_ORDERS[best][0]}; so read they agree with its "
        f"gyroscope (correlation {scores[best]:.2f}, as they are {as_read:.2f})"
    ]


def agreement(q: np.ndarray, times: np.ndarray, rates: np.ndarray, rows: np.ndarray) -> float:
    """Correlation, -1 to 1, of the derivative of orientations (N, 4) with rates of turn (N - 1, 3) in some rows."""
    derived, measured = quat.angular_velocity(q, times)[rows], rates[rows]
    size = float(np.sqrt((derived**2).sum() * (measured**2).sum()))
    return float((derived * measured).sum() / size) if size > 0 else 0.0


def other_side(limb: str) -> str:
    """The same part of the body on the other side; itself where it has none."""
    if limb.startswith("left_"):
        return "right_" + limb.removeprefix("left_")
    return "left_" + limb.removeprefix("right_") if limb.startswith("right_") else limb


def residual(take: CalibrationSequence, sensor: str, limb: str) -> float:
    """Median residual in degrees of one sensor of a take, calibrated by itself on any part of the body."""
    inertial, rows = take.measured(sensor)
    if rows.sum() < 10:
        return 180.0
    change = quat.conjugate(upright(take.sensors.world_up))
    tracked = take.motion.orientation(limb)[rows]
    strand = SynchronisedSegment(0, 0, quat.multiply(change, inertial[rows]), tracked).thinned(PLACE_ROWS)
    psis, mountings, _ = solvers.heading([strand], 1, 1)
    return float(np.degrees(np.median(solvers.residuals(strand, solvers.yaw(psis[0]), mountings[0]))))


def place_suspicions(take: CalibrationSequence) -> list[str]:
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


def mirrored_take(take: CalibrationSequence) -> CalibrationSequence:
    """The take as it would have been tracked in a mirror at x = 0: left and right exchanged."""
    rows = [skeleton.JOINT_NAMES.index(other_side(name)) for name in skeleton.JOINT_NAMES]
    rotations = take.motion.rotations[:, rows] * (1.0, 1.0, -1.0, -1.0)
    origins = take.motion.origins[:, rows] * (-1.0, 1.0, 1.0)
    return replace(take, motion=replace(take.motion, rotations=rotations, origins=origins))
