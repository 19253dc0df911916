"""Solvers of the two offsets between sensor and limb: `q_I(t) = q_G q_T(t) q_L` for all t (thesis, Eq. 7.5).

`thesis` is the thesis's method, linear and not robust. `heading` uses the known vertical of both worlds, so that
`q_G` is an angle. It weights frames by Geman and McClure, from a wide scale to a narrow one, against tracking errors.
"""

from __future__ import annotations

import warnings
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

SCALES = np.radians([40.0, 28.0, 20.0, 14.0, 10.0])
"""Scale of the weights, narrower and narrower, radians: ten degrees is what soft tissue and a good track differ by."""
ROUNDS = 8
"""Iterations at each scale."""
START_HEADINGS: np.ndarray = np.arange(12) * (2.0 * np.pi / 12)
"""Initial headings, radians, 30 degrees apart."""


@dataclass(frozen=True, eq=False)
class SynchronisedSegment:
    """Orientations of one sensor in one sequence.

    Attributes
    ----------
    sensor : key of the sensor; its segments share `q_L`
    group : key of the heading, shared by its segments
    inertial : N rotations, `q_I`
    tracked : N rotations, `q_T`
    """

    sensor: Hashable
    group: Hashable
    inertial: Rotation
    tracked: Rotation

    def thinned(self, rows: int) -> SynchronisedSegment:
        """Return at most `rows` rows, evenly spaced."""
        step = max(1, -(-len(self.inertial) // rows))
        return SynchronisedSegment(self.sensor, self.group, self.inertial[::step], self.tracked[::step])


def weights_of(angles: np.ndarray, scale: float) -> np.ndarray:
    """Return the Geman-McClure weights (N,) of angles (N,), radians."""
    return 1.0 / (1.0 + (angles / scale) ** 2) ** 2


def cost_of(angles: np.ndarray, scale: float) -> float:
    """Return the mean Geman-McClure cost, 0 to 1."""
    squares = (angles / scale) ** 2
    return float((squares / (1.0 + squares)).mean())


def thesis(inertial: Rotation, tracked: Rotation, rng: np.random.Generator) -> tuple[Rotation, Rotation]:
    """Return `q_G` and `q_L` of N orientations, by pairs of frames (thesis, Eq. 7.7 and 7.13 to 7.15)."""
    s, t = rng.integers(0, len(tracked), size=(2, 4000))
    turn = (tracked[s].inv() * tracked[t]).magnitude()
    least_turn = np.radians(20.0)  # radians, smallest rotation between two frames with a usable axis
    largest_turn = np.radians(160.0)  # radians, largest such rotation; near a half turn the axis flips
    fine = (turn > least_turn) & (turn < largest_turn)
    s, t = (s[fine], t[fine]) if fine.any() else (s, t)
    local = [(own[s].inv() * own[t]).as_rotvec() for own in (inertial, tracked)]
    world = [(own[s] * own[t].inv()).as_rotvec() for own in (inertial, tracked)]
    return _aligned(*world), _aligned(*local).inv()


def residuals(segment: SynchronisedSegment, world: Rotation, mounting: Rotation) -> np.ndarray:
    """Return the angles (N,), radians, between measured and tracked orientation (thesis, Eq. 7.16)."""
    return (segment.inertial.inv() * world * segment.tracked * mounting).magnitude()


def yaw(psi: float) -> Rotation:
    """Return the rotation about y."""
    return Rotation.from_rotvec([0.0, psi, 0.0])


Headings = dict[Hashable, float]
Mountings = dict[Hashable, Rotation]


def heading(segments: Sequence[SynchronisedSegment]) -> tuple[Headings, Mountings]:
    """Return the heading of each group and the mounting of each sensor of segments whose worlds both have y up.

    `q_I = yaw(psi_group) q_T q_L_sensor`. Given the headings a mounting is a weighted chordal mean; given the mountings
    a heading has a closed form. The headings of `by_vertical` are the start.
    """
    rough_rows = 120  # frames per segment until the last scale
    rough = [segment.thinned(rough_rows) for segment in segments]
    psis = by_vertical(rough)
    mountings = _mountings_of(rough, [np.ones(len(s.inertial)) for s in rough], psis)
    psis, mountings = _alternated(rough, psis, mountings, SCALES.repeat(ROUNDS))
    last_rounds = 12  # iterations at the last scale
    return _alternated(segments, psis, mountings, SCALES[-1:].repeat(last_rounds))


def heading_given(segments: Sequence[SynchronisedSegment], mountings: Mapping[Hashable, Rotation]) -> float:
    """Return the common heading of segments with known mountings of the sensors, robustly, from twelve starts."""
    turns = Rotation.concatenate([_turns(s, mountings) for s in segments])
    best, least = 0.0, np.inf
    for start in START_HEADINGS:
        psi = float(start)
        for width in np.append(SCALES, SCALES[-1:].repeat(ROUNDS)):
            psi = _heading_of(turns, weights_of((turns.inv() * yaw(psi)).magnitude(), width))
        cost = cost_of((turns.inv() * yaw(psi)).magnitude(), float(SCALES[-1]))
        if cost < least - 1e-12:
            best, least = psi, cost
    return best


def _alternated(
    segments: Sequence[SynchronisedSegment], psis: Headings, mountings: Mountings, scales: np.ndarray
) -> tuple[Headings, Mountings]:
    """Return headings and mountings after alternating updates at each scale."""
    for scale in scales:
        weights = [weights_of(residuals(s, yaw(psis[s.group]), mountings[s.sensor]), scale) for s in segments]
        mountings = _mountings_of(segments, weights, psis)
        turns = [_turns(s, mountings) for s in segments]
        psis = {}
        for group in {s.group for s in segments}:
            own = [k for k, s in enumerate(segments) if s.group == group]
            together = Rotation.concatenate([turns[k] for k in own])
            psis[group] = _heading_of(together, np.concatenate([weights[k] for k in own]))
    return psis, mountings


def by_vertical(segments: Sequence[SynchronisedSegment]) -> Headings:
    """Return headings, radians, with mountings that align the measured vertical with the limbs', robustly."""
    mountings: Mountings = {}
    for sensor in {s.sensor for s in segments}:
        own = [s for s in segments if s.sensor == sensor]
        seen = Rotation.concatenate([s.inertial for s in own]).inv().apply([0.0, 1.0, 0.0])
        tracked = Rotation.concatenate([s.tracked for s in own]).inv().apply([0.0, 1.0, 0.0])
        weights = np.ones(len(seen))
        for scale in SCALES.repeat(ROUNDS):
            mountings[sensor] = _aligned(tracked, seen, weights)
            cosine = (mountings[sensor].apply(seen) * tracked).sum(axis=1)
            weights = weights_of(np.arccos(np.clip(cosine, -1.0, 1.0)), float(scale))
    groups = dict.fromkeys(s.group for s in segments)
    return {group: heading_given([s for s in segments if s.group == group], mountings) for group in groups}


def _aligned(targets: np.ndarray, vectors: np.ndarray, weights: np.ndarray | None = None) -> Rotation:
    """Return the rotation that best aligns `vectors` (N, 3) with `targets` (N, 3), one of them where several do."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Optimal rotation is not uniquely")
        return Rotation.align_vectors(targets, vectors, weights)[0]


def _mountings_of(segments: Sequence[SynchronisedSegment], weights: Sequence[np.ndarray], psis: Headings) -> Mountings:
    """Return the weighted mean of each sensor's mounting at given headings."""
    local = [s.tracked.inv() * yaw(-psis[s.group]) * s.inertial for s in segments]
    found: Mountings = {}
    for sensor in {s.sensor for s in segments}:
        own = [k for k, s in enumerate(segments) if s.sensor == sensor]
        together = Rotation.concatenate([local[k] for k in own])
        found[sensor] = together.mean(np.concatenate([weights[k] for k in own]))
    return found


def _turns(segment: SynchronisedSegment, mountings: Mapping[Hashable, Rotation]) -> Rotation:
    """Return the N rotations from the tracked to the measured limb; about y for exact data."""
    return segment.inertial * mountings[segment.sensor].inv() * segment.tracked.inv()


def _heading_of(turns: Rotation, weights: np.ndarray) -> float:
    """Return the weighted mean angle about y of rotations, from the first eigenvector of their w, y part."""
    _, y, _, w = turns.as_quat().T
    return float(np.arctan2(2.0 * (weights * w * y).sum(), (weights * (w * w - y * y)).sum()))
