"""The 40 relational features: Boolean relations between joints (thesis 2.2, Table 2.1; Mueller and Roeder 2006).

`FEATURES` is the specification as a table. Every feature is a real-valued quantity, a comparison, and a loose and a
strict threshold with hysteresis; lengths are in body-relative units, measured in the first frame. World frame: y up,
right-handed. Features are computed at the motion's own rate, then sampled at the columns nearest to a 30 Hz clock.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion import relations as r
from toolkit.retrieval.features.grades import FULL, SCALES, grade
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion
from toolkit.retrieval.features.places import ROWS, places_of

FEATURE_RATE = 30.0
"""Columns per second of a feature matrix."""


@dataclass(frozen=True, eq=False)
class FeatureMatrix:
    """Relational features of a motion or of a document of several motions.

    Attributes
    ----------
    name : name of the motion
    values : bool (40, T), row i is feature F(i+1)
    frame_rate : columns per second
    measured : int8 (40, T), grades of the features (`grades.grade`), None if only the Booleans are known
    placed : int8 (24, T), limb positions (`places.places_of`), None if unknown
    """

    name: str
    values: np.ndarray
    frame_rate: float = FEATURE_RATE
    measured: np.ndarray | None = None
    placed: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.values.ndim != 2 or self.values.shape[0] != len(FEATURES) or self.values.dtype != bool:
            raise RetrievalError(
                f"features of {self.name!r} are {self.values.dtype} of shape {self.values.shape}; "
                f"expected bool ({len(FEATURES)}, frames)"
            )

    def __len__(self) -> int:
        return self.values.shape[1]

    @property
    def duration(self) -> float:
        """Seconds."""
        return len(self) / self.frame_rate

    @cached_property
    def words(self) -> np.ndarray:
        """Columns as bit words, uint64 (T,), for comparison with templates and the index; packed once."""
        return pack(self.values)

    @cached_property
    def grades(self) -> np.ndarray:
        """Grades of the features, int8 (40, T); extreme grades if they were not measured."""
        return np.where(self.values, FULL, -FULL).astype(np.int8) if self.measured is None else self.measured

    @property
    def places(self) -> np.ndarray:
        """Limb positions, int8 (24, T); 0 if unknown."""
        return np.zeros((ROWS, len(self)), dtype=np.int8) if self.placed is None else self.placed

    def sliced(self, start: int, stop: int) -> FeatureMatrix:
        """Return columns start to stop - 1."""
        measured, placed = (None if a is None else a[:, start:stop] for a in (self.measured, self.placed))
        return replace(self, values=self.values[:, start:stop], measured=measured, placed=placed)


def pack(values: np.ndarray) -> np.ndarray:
    """Return the columns of a boolean matrix (up to 64, T) as bit words: uint64 (T,), row i is bit i."""
    words = np.zeros(values.shape[1], dtype=np.uint64)
    for i, row in enumerate(values):
        words |= row.astype(np.uint64) << np.uint64(i)
    return words


@dataclass(frozen=True)
class Feature:
    """Relational feature: 1 from the first strict frame on for as long as the loose test holds.

    Attributes
    ----------
    number : i of F(i), 1 to 40
    meaning : meaning of a 1
    test : "<", "<=", ">", ">=" against the threshold, or "within" that distance of 90 degrees, ends included
    loose, strict : thresholds in units
    unit : unit of the thresholds: a body length (per second for velocities) or "deg" (degrees, also per second)
    operation : measured quantity, see `kernels.motion.relations`
    points : named joints in the order of the operation; a plane contains the first three (or the third, perpendicular
        to the line of the first two), and the distance of the fourth is relative to the third or to a fifth
    window : milliseconds over which velocities are smoothed
    sign : factor, 1 or -1; 0 for the absolute value
    """

    number: int
    meaning: str
    test: str
    loose: float
    strict: float
    unit: str
    operation: int
    points: tuple[str, ...]
    window: float = 0.0
    sign: int = 1

    def holds(self, values: np.ndarray, threshold: float) -> np.ndarray:
        """Test values (T,) against a threshold in their unit: bool (T,)."""
        return np.asarray(_TESTS[self.test](values, threshold))

    def margin(self, values: np.ndarray) -> np.ndarray:
        """Return the margin of values (T,), in units, over the middle of the two thresholds: float64 (T,)."""
        middle = 0.5 * (self.loose + self.strict)
        if self.test == "within":
            return middle - np.abs(values - 90.0)
        return middle - values if self.test.startswith("<") else values - middle


_TESTS: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "within": lambda values, width: np.abs(values - 90.0) <= width,
}


def _pair(
    number: int, meaning: str, test: str, loose: float, strict: float, unit: str, operation: int,
    points: tuple[str, ...], window: float = 0.0,
) -> Iterator[Feature]:  # fmt: skip
    """Yield an odd feature of the right side and the even one of the left; `*` in a point stands for the side."""
    for offset, side in enumerate(("right", "left")):
        own = tuple(point.replace("*", side) for point in points)
        yield Feature(number + offset, f"{side} {meaning}", test, loose, strict, unit, operation, own, window)


# The rows of the specification: comparison, loose and strict threshold, unit, operation, points, and the window of the
# velocities in milliseconds.
FEATURES: tuple[Feature, ...] = (
    # upper body
    *_pair(1, "hand moving forwards", ">", 1.3, 1.8, "HL",
        r.VPLANE, ("neck", "right_hip", "left_hip", "*_wrist"), window=250),
    *_pair(3, "hand above neck", ">=", 0.0, 0.2, "CN",
        r.NPLANE, ("chest", "neck", "neck", "*_wrist")),
    *_pair(5, "hand moving upwards", ">", 1.3, 1.8, "HL",
        r.VNPLANE, ("chest", "neck", "neck", "*_wrist"), window=250),
    *_pair(7, "elbow bent", "<=", 120, 110, "deg",
        r.ANGLE, ("*_elbow", "*_shoulder", "*_elbow", "*_wrist")),
    Feature(9, "hands far apart, sideways", ">=", 2.0, 2.5, "SW",
        r.NPLANE, ("left_shoulder", "right_shoulder", "left_wrist", "right_wrist"), sign=0),
    Feature(10, "hands approaching each other", ">=", 1.2, 1.4, "HR",
        r.VNPLANE, ("left_wrist", "right_wrist", "right_wrist", "left_wrist"), window=100),
    *_pair(11, "hand moving away from root", ">=", 1.2, 1.4, "HR",
        r.VNPLANE, ("*_wrist", "root", "*_wrist", "root")),
    *_pair(13, "hand fast", ">=", 2.0, 2.5, "HR",
        r.SPEED, ("*_fingers",), window=100),
    # lower body
    Feature(15, "right foot behind left leg", ">=", 0.0, 0.375, "HR",
        r.PLANE, ("root", "left_hip", "left_ankle", "right_ankle")),
    Feature(16, "left foot behind right leg", ">=", 0.0, 0.375, "HR",
        r.PLANE, ("root", "right_ankle", "right_hip", "left_ankle")),
    *_pair(17, "foot raised", ">=", 1.0, 1.2, "HR",
        r.HEIGHT, ("*_toes",)),
    Feature(19, "feet far apart, sideways", ">=", 1.8, 2.1, "HR",
        r.NPLANE, ("left_hip", "right_hip", "left_ankle", "right_ankle"), sign=0),
    *_pair(20, "knee bent", "<=", 120, 110, "deg",
        r.ANGLE, ("*_knee", "*_hip", "*_knee", "*_ankle")),
    Feature(22, "feet crossed over", "<=", 0.0, -0.125, "HW",
        r.NPLANE, ("left_hip", "right_hip", "left_ankle", "right_ankle")),
    Feature(23, "feet moving towards each other, sideways", ">=", 1.3, 1.5, "HR",
        r.VNPLANE, ("left_hip", "right_hip", "right_ankle", "left_ankle"), window=100),
    Feature(24, "feet moving apart, sideways", ">=", 1.3, 1.5, "HR",
        r.VNPLANE, ("left_hip", "right_hip", "left_ankle", "right_ankle"), window=100),
    *_pair(25, "foot fast", ">=", 2.0, 2.5, "HR",
        r.SLOWER, ("*_toes", "*_ankle"), window=100),
    # mixed
    *_pair(27, "humerus abducted", "<", 155, 150, "deg",
        r.ANGLE, ("root", "neck", "*_shoulder", "*_elbow")),
    *_pair(29, "femur abducted", ">", 45, 50, "deg",
        r.ANGLE, ("root", "neck", "*_knee", "*_hip")),
    Feature(31, "root behind frontal plane", "<", -0.35, -0.5, "HR",
        r.PLANE, ("left_ankle", "neck", "right_ankle", "root")),
    Feature(32, "spine horizontal", "within", 30, 20, "deg",
        r.INCLINE, ("root", "neck")),
    *_pair(33, "hand lowered", "<", 1.4, 1.2, "HR",
        r.HEIGHT, ("*_fingers", "*_fingers", "*_wrist")),
    Feature(35, "shoulders rotated right", ">", 0.35, 0.40, "HL",
        r.PLANE, ("right_hip", "left_hip", "neck", "left_shoulder", "right_shoulder")),
    Feature(36, "shoulders rotated left", ">", 0.35, 0.40, "HL",
        r.PLANE, ("right_hip", "left_hip", "neck", "left_shoulder", "right_shoulder"), sign=-1),
    Feature(37, "Y-extents of body small", "<=", 0.9, 0.8, "BL",
        r.TALL, ()),
    Feature(38, "XZ-extents of body large", ">=", 3.0, 3.25, "HR",
        r.WIDE, ("left_ankle", "right_ankle", "left_wrist", "right_wrist", "headtop", "root")),
    Feature(39, "root fast", ">=", 2.0, 2.3, "HR",
        r.SPEED, ("root",)),
    Feature(40, "root rotates around Y", ">=", 100, 110, "deg",
        r.YAW, ()),
)  # fmt: skip


def relational_features(motion: Motion, lengths: BodyLengths | None = None) -> FeatureMatrix:
    """Return all 40 features of a motion at 30 Hz (thesis 2.2).

    Parameters
    ----------
    motion : motion at its native rate, at which velocities and hysteresis are evaluated
    lengths : units of length; None measures the first frame

    Returns
    -------
    FeatureMatrix
        bool (40, T30), their grades and the limb positions, in the columns nearest to multiples of 1/30 s.
    """
    native, margins = native_features(motion, lengths)
    columns = feature_columns(len(motion), motion.frame_rate)
    grades = grade(margins[:, columns])
    return FeatureMatrix(motion.name, native[:, columns], measured=grades, placed=places_of(motion, columns))


def feature_columns(frames: int, frame_rate: float) -> np.ndarray:
    """Return the frames of a motion nearest to a 30 Hz clock, the columns of its feature matrix: int64 (T30,)."""
    count = max(1, int(np.ceil(frames * FEATURE_RATE / frame_rate - 1e-9)))
    columns = np.rint(np.arange(count) * frame_rate / FEATURE_RATE).astype(np.int64)
    return np.minimum(columns, frames - 1)


@lru_cache(maxsize=16)
def program(frame_rate: float) -> np.ndarray:
    """Return the quantities of all features at a frame rate, for `kernels.motion.relations`: int64 (40, 8)."""
    found = np.zeros((len(FEATURES), 8), dtype=np.int64)
    for row, feature in enumerate(FEATURES):
        places = [NAMED_JOINTS.index(point) for point in feature.points]
        if feature.operation in _SETS:
            single = _SETS[feature.operation]
            places = [*places[:single], sum(1 << place for place in places[single:])]
        elif len(places) == 4 and feature.operation in _PLANES:
            places.append(places[2])
        found[row, 0], found[row, 1 : 1 + len(places)] = feature.operation, places
        found[row, 6] = max(1, int(np.ceil(feature.window * frame_rate / 1000.0 - 1e-9)))
        found[row, 7] = feature.sign
    return found


_SETS = {r.HEIGHT: 1, r.WIDE: 0}
"""Operations whose points from that index on are a set."""
_PLANES = (r.PLANE, r.NPLANE, r.VPLANE, r.VNPLANE)
"""Operations whose fourth point is relative to the third, unless there is a fifth."""


def native_features(motion: Motion, lengths: BodyLengths | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return all 40 features at the motion's own rate.

    Returns
    -------
    values : bool (40, T)
    margins : float32 (40, T), margin over the middle of the two thresholds, in the feature's unit
    """
    lengths = BodyLengths.of(motion) if lengths is None else lengths
    quantities = quantities_of(motion)
    margins = np.empty(quantities.shape, dtype=np.float32)
    for row, (feature, values) in enumerate(zip(FEATURES, quantities, strict=True)):
        margins[row] = feature.margin(values / lengths.unit(feature.unit))
    return hysteresis(*tests_of(quantities, lengths)), margins


def tests_of(quantities: np.ndarray, lengths: BodyLengths) -> tuple[np.ndarray, np.ndarray]:
    """Return the loose and the strict tests of quantities (40, T): bool (40, T) each."""
    units = [lengths.unit(feature.unit) for feature in FEATURES]
    rows = list(zip(FEATURES, quantities, units, strict=True))
    loose = np.array([feature.holds(values, feature.loose * unit) for feature, values, unit in rows])
    strict = np.array([feature.holds(values, feature.strict * unit) for feature, values, unit in rows])
    return loose, strict


def quantities_in(joints: np.ndarray, axes: np.ndarray, frame: int, frame_rate: float) -> np.ndarray:
    """Return the quantities of the features, float64 (40,), in one frame of joints (T, 24, 3) and root axes (T, 3)."""
    found = np.empty(len(FEATURES))
    r.quantities(joints, axes, frame, frame_rate, program(frame_rate), found)
    return found


def quantities_of(motion: Motion) -> np.ndarray:
    """Return the quantities of the features, float64 (40, T), in the motion's unit of length."""
    joints, axes = np.ascontiguousarray(motion.joints, dtype=np.float64), motion.root_axis
    if axes is None:
        axes = joints[:, NAMED_JOINTS.index("left_hip")] - joints[:, NAMED_JOINTS.index("right_hip")]
    found = np.empty((len(motion), len(FEATURES)))
    r.quantities_of_all(
        joints, np.ascontiguousarray(axes, dtype=np.float64), motion.frame_rate, program(motion.frame_rate), found
    )
    return np.ascontiguousarray(found.T)


def hysteresis(loose: np.ndarray, strict: np.ndarray) -> np.ndarray:
    """Switch on at a strict frame and off at a frame that is not loose, else keep; off before the start.

    Both tests are bool (..., T), and strict implies loose.
    """
    decided = strict | ~loose
    last = np.where(decided, np.arange(loose.shape[-1]), -1)
    np.maximum.accumulate(last, axis=-1, out=last)
    return np.take_along_axis(strict, np.maximum(last, 0), axis=-1) & (last >= 0)


@lru_cache(maxsize=1)
def feature_fingerprint() -> str:
    """Return sixteen hexadecimal digits that identify the feature definitions, stored with derived data."""
    table = [(f.number, f.meaning, f.test, f.loose, f.strict, f.unit) for f in FEATURES]
    return hashlib.sha256(repr((table, FEATURE_RATE, NAMED_JOINTS, SCALES.tolist())).encode()).hexdigest()[:16]
