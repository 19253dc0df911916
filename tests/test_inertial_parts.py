"""Parts of the inertial wing on made-up numbers: orientation from raw data, errors of a track, suspicions, streams."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.body.rotations import quaternions as quat
from toolkit.inertial.distance import Distances, errors_of, runs_above
from toolkit.inertial.fusion import UP, fused, gyroscope_bias
from toolkit.inertial.stream import GRAVITY, Sensors, checked_stream
from toolkit.inertial.suspicions import agreement, clock_suspicion, suspicions
from toolkit.inertial.synchronise import SMOOTHING, Signal, highest_peak, on_grid, parabola, track_signals
from toolkit.io.errors import InertialError

TIMES = np.arange(0.0, 4.0, 0.01)


def still_gyro(bias: tuple[float, float, float]) -> np.ndarray:
    """A sensor that rests for a second and then turns."""
    gyro = np.tile(bias, (len(TIMES), 1))
    gyro[100:] += np.stack([np.sin(7.0 * TIMES[100:]), np.cos(5.0 * TIMES[100:]), 1.0 + 0.0 * TIMES[100:]], axis=1)
    return gyro


def test_the_bias_of_a_gyroscope_is_what_it_says_at_rest() -> None:
    assert gyroscope_bias(TIMES, still_gyro((0.03, -0.02, 0.01))) == pytest.approx([0.03, -0.02, 0.01])


def test_a_steady_fast_turn_is_no_rest_and_too_few_rows_say_nothing() -> None:
    assert gyroscope_bias(TIMES, np.tile([0.5, 0.0, 0.0], (len(TIMES), 1))).tolist() == [0.0, 0.0, 0.0]
    assert gyroscope_bias(TIMES[:20], still_gyro((0.03, 0.0, 0.0))[:20]).tolist() == [0.0, 0.0, 0.0]


def tilted_stream(tilt: float, bias: float = 0.0, magnetic: bool = False, heading: float = 0.0):
    """A sensor that rests, tilted about x and headed by so many radians, in an inertial world with z up."""
    turned = quat.multiply(quat.exponential([0.0, 0.0, heading]), quat.exponential([tilt, 0.0, 0.0]))
    q = np.tile(turned, (len(TIMES), 1))
    up = quat.rotate(quat.conjugate(q), GRAVITY * UP)
    field = quat.rotate(quat.conjugate(q), np.array([30.0, 0.0, -20.0])) if magnetic else None
    gyro = np.tile([0.0, 0.0, bias], (len(TIMES), 1))
    return checked_stream("pelvis", TIMES, gyro=gyro, acceleration=up, magnetic=field), q


def test_gravity_tells_how_a_resting_sensor_is_tilted() -> None:
    stream, q = tilted_stream(0.7)
    found = fused(stream)
    assert found.rotations is not None
    assert quat.rotate(found.rotations, quat.rotate(quat.conjugate(q), UP)) == pytest.approx(
        np.tile(UP, (len(TIMES), 1)), abs=1e-6
    )


def test_a_resting_gyroscope_s_bias_turns_nothing() -> None:
    found = fused(tilted_stream(0.3, bias=0.05)[0]).rotations
    assert found is not None
    assert float(quat.angle(found[0], found[-1])) < 1e-3


def test_with_a_steady_field_the_heading_is_that_of_north() -> None:
    stream, q = tilted_stream(0.4, magnetic=True, heading=0.8)
    found = fused(stream)
    assert found.origin.endswith("magnetic north") and found.rotations is not None
    assert quat.angle(found.rotations, q) == pytest.approx(np.zeros(len(TIMES)), abs=1e-3)


def test_the_inertial_world_s_own_vertical_is_kept() -> None:
    found = fused(tilted_stream(0.4)[0], world_up=np.array([0.0, 1.0, 0.0])).rotations
    assert found is not None
    up_sensor = quat.rotate(quat.conjugate(np.tile(quat.exponential([0.4, 0.0, 0.0]), (len(TIMES), 1))), UP)
    assert quat.rotate(found, up_sensor)[:, 1] == pytest.approx(np.ones(len(TIMES)), abs=1e-6)


THRESHOLD = 40.0
FRAMES = 0.06 * np.arange(30)


def curve(**stretches: tuple[int, int, float]) -> np.ndarray:
    """Degrees over 30 frames, 10 but in these stretches."""
    values = np.full(len(FRAMES), 10.0)
    for first, last, value in stretches.values():
        values[first : last + 1] = value
    return values


def test_an_error_begins_and_ends_at_the_release_and_needs_the_threshold() -> None:
    values = curve(rise=(4, 5, 35.0), peak=(6, 8, 50.0), low=(20, 25, 35.0))
    assert runs_above(values, FRAMES, THRESHOLD) == [(4, 8)]
    assert runs_above(curve(peak=(25, 29, 50.0)), FRAMES, THRESHOLD) == [(25, 29)]


def test_short_gaps_between_errors_are_closed_and_short_errors_left_out() -> None:
    values = curve(first=(4, 6, 50.0), second=(8, 10, 50.0), third=(20, 20, 50.0))
    assert runs_above(values, FRAMES, THRESHOLD) == [(4, 6), (8, 10)], "a gap of 0.12 s stays"
    dense = FRAMES / 2.0
    assert runs_above(values, dense, THRESHOLD) == [(4, 10)]
    values[5] = np.nan
    assert runs_above(values, FRAMES, THRESHOLD) == [(8, 10)]


def test_an_error_whose_bone_agrees_is_a_twist() -> None:
    full = curve(peak=(6, 8, 50.0), top=(7, 7, 56.0), other=(15, 18, 60.0))
    axis = curve(other=(15, 18, 55.0))
    twist, error = errors_of(Distances("left_shin", FRAMES, full, axis), THRESHOLD)
    assert (twist.kind, error.kind) == ("twist", "error")
    assert (twist.start, twist.end, twist.peak, twist.mean) == pytest.approx((0.36, 0.48, 56.0, 52.0))
    assert error.limb == "left_shin" and error.peak == 60.0


def turning(rate: tuple[float, float, float] = (0.0, 0.0, 1.5)):
    """Orientations and gyroscope of a sensor that turns to and fro."""
    swing = np.sin(2.0 * TIMES)[:, None] * np.array(rate) + np.cos(3.0 * TIMES)[:, None] * [0.7, 0.3, 0.0]
    q = [quat.IDENTITY]
    for turn in swing[:-1]:
        q.append(quat.multiply(q[-1], quat.exponential(0.01 * turn)))
    return np.array(q), swing


def test_the_order_of_quaternions_is_told_by_the_gyroscope() -> None:
    q, gyro = turning()
    for read, word in ((q, ""), (quat.conjugate(q), "conjugated"), (q[:, [1, 2, 3, 0]], "x y z w:")):
        said = suspicions(Sensors((checked_stream("head", TIMES, rotations=read, gyro=gyro),)))
        assert word in " ".join(said) and bool(said) == bool(word)


def test_units_that_cannot_be_are_suspected() -> None:
    q, gyro = turning()
    rest = np.tile([0.0, 0.0, GRAVITY], (len(TIMES), 1))
    for factor, size, word in ((60.0, 1.0, "deg/s"), (1.0, 1.0 / GRAVITY, "in g"), (1.0, 0.05, "without gravity")):
        stream = checked_stream("head", TIMES, gyro=factor * gyro, acceleration=size * rest)
        assert any(word in sentence for sentence in suspicions(Sensors((stream,))))
    assert suspicions(Sensors((checked_stream("head", TIMES, gyro=gyro, acceleration=rest),))) == []
    assert clock_suspicion(1.04) == [] and "0.900" in clock_suspicion(0.9)[0]


def test_agreement_is_a_correlation() -> None:
    q, gyro = turning()
    rows = np.ones(len(TIMES) - 1, dtype=bool)
    assert agreement(q, TIMES, gyro[:-1], rows) == pytest.approx(1.0, abs=1e-6)
    assert agreement(q, TIMES, -gyro[:-1], rows) == pytest.approx(-1.0, abs=1e-6)
    assert agreement(q, TIMES, np.zeros((len(TIMES) - 1, 3)), rows) == 0.0


def test_rows_without_a_measurement_or_a_time_of_their_own_do_not_count() -> None:
    q = np.tile(quat.IDENTITY, (6, 1))
    q[2] = 0.0
    q[3] = 2.0
    stream = checked_stream("head", np.array([0.0, 0.1, 0.2, 0.3, 0.3, 0.4]), rotations=q)
    assert stream.times.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert stream.valid.tolist() == [True, True, False, False, True]
    raw = checked_stream("head", TIMES[:3], gyro=np.zeros((3, 3)), acceleration=np.diag([1.0, 0.0, 1.0]))
    assert raw.valid.tolist() == [True, False, True]
    with pytest.raises(InertialError, match="run backwards at row 2"):
        checked_stream("head", np.array([0.0, 0.2, 0.1]), rotations=q[:3])


def test_between_rows_orientations_are_interpolated_and_in_long_gaps_unknown() -> None:
    q = quat.exponential(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.4], [0.0, 0.0, 0.8]]))
    stream = checked_stream("head", np.array([0.0, 0.1, 9.0]), rotations=q)
    found, known = stream.at(np.array([-0.5, 0.0, 0.025, 0.1, 5.0, 9.0, 9.5]))
    assert known.tolist() == [False, True, True, False, False, False, False]
    assert quat.logarithm(found[2]) == pytest.approx([0.0, 0.0, 0.1])
    assert stream.gaps == 1


def test_a_signal_is_known_on_whole_steps_but_for_holes() -> None:
    times = np.array([0.014, 0.02, 0.03, 0.04, 0.16, 0.17, 0.18])
    grid, values, known = on_grid(times, times[:, None] * [2.0])
    assert grid == pytest.approx(np.arange(2, 19) * 0.01)
    assert values[:, 0] == pytest.approx(2.0 * grid)
    assert known.tolist() == [True, True, *[False] * 12, True, True, True]


def test_a_peak_is_placed_by_its_neighbours_and_a_second_one_found() -> None:
    curve_of = -((np.arange(7) - 3.3) ** 2)
    assert parabola(curve_of, 3) == pytest.approx(0.3)
    assert parabola(curve_of, 0) == 0.0
    whole = np.array([0.0, 8.0, 5.0, 1.0, 2.0, 0.5, 9.0])
    assert highest_peak(np.where(np.arange(7) == 1, np.nan, whole), whole) == 2.0
    assert highest_peak(np.full(7, np.nan), whole) == -1.0


class Motion:
    """A limb that rests upright, then falls freely."""

    times = np.arange(0.0, 3.0, 1 / 30)
    valid = np.ones(90, dtype=bool)

    def __init__(self, fall: float) -> None:
        self.path = np.zeros((90, 3))
        self.path[:, 1] = -0.5 * fall * self.times**2

    def orientation(self, limb: str) -> np.ndarray:
        return np.tile(quat.IDENTITY, (90, 1))

    def middle(self, limb: str) -> np.ndarray:
        return self.path


@pytest.mark.parametrize(("fall", "size"), [(0.0, GRAVITY), (GRAVITY, 0.0), (-GRAVITY, 2.0 * GRAVITY)])
def test_what_an_accelerometer_on_a_tracked_limb_would_measure_holds_gravity(fall: float, size: float) -> None:
    rates, acceleration = track_signals(Motion(fall), "head", 1.0, SMOOTHING)  # type: ignore[arg-type]
    assert isinstance(acceleration, Signal) and rates.values.max() < 1e-9
    inner = acceleration.values[60:-60]
    assert inner == pytest.approx(np.full(len(inner), size), abs=0.05)
