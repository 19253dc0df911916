"""Solvers of the two offsets between sensor and limb: `q_I(t) = q_G q_T(t) q_L` for all t (thesis, Eq. 7.5).

`park_martin` is the thesis's method, linear and not robust. `heading` uses the known vertical of both worlds, so that
`q_G` is an angle. It weights frames by Geman and McClure, from a wide scale to a narrow one, against tracking errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.body.rotations import quaternions as quat

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
    sensor : number of the sensor; its segments share `q_L`
    group : number of the heading, shared by its segments
    inertial : float64 (N, 4), `q_I`
    tracked : float64 (N, 4), `q_T`
    """

    sensor: int
    group: int
    inertial: np.ndarray
    tracked: np.ndarray

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


def park_martin(alpha: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """Return `X` (4,) with `A X = X B`, from rotation vectors (N, 3) of A and B (thesis, Eq. 7.13 and 7.14).

    `X` comes from the singular vectors with determinant +1, which equals `(M'M)^(-1/2) M'` if that is a rotation.
    """
    u, _, v = np.linalg.svd(np.einsum("ni,nj->ij", alpha, beta))
    return quat.from_matrices((u * [1.0, 1.0, np.linalg.det(u) * np.linalg.det(v)]) @ v)


def thesis(inertial: np.ndarray, tracked: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return `q_G` and `q_L` (4,) of orientations (N, 4), by pairs of frames (thesis, Eq. 7.7 and 7.15)."""
    s, t = rng.integers(0, len(tracked), size=(2, 4000))
    turn = quat.angle(tracked[s], tracked[t])
    least_turn = np.radians(20.0)  # radians, smallest rotation between two frames with a usable axis
    largest_turn = np.radians(160.0)  # radians, largest such rotation; near a half turn the axis flips
    fine = (turn > least_turn) & (turn < largest_turn)
    s, t = (s[fine], t[fine]) if fine.any() else (s, t)

    def pair(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return quat.logarithm(quat.multiply(first, second))

    local = park_martin(pair(quat.conjugate(inertial[s]), inertial[t]), pair(quat.conjugate(tracked[s]), tracked[t]))
    world = park_martin(pair(inertial[s], quat.conjugate(inertial[t])), pair(tracked[s], quat.conjugate(tracked[t])))
    return world, quat.conjugate(local)


def residuals(segment: SynchronisedSegment, world: np.ndarray, mounting: np.ndarray) -> np.ndarray:
    """Return the angles (N,), radians, between measured and tracked orientation (thesis, Eq. 7.16)."""
    return quat.angle(segment.inertial, quat.multiply(quat.multiply(world, segment.tracked), mounting))


def yaw(psi: float) -> np.ndarray:
    """Return the rotation about y (4,)."""
    return quat.exponential([0.0, psi, 0.0])


def heading(segments: Sequence[SynchronisedSegment], groups: int, sensors: int) -> tuple[np.ndarray, np.ndarray]:
    """Return headings (groups,) and mountings (sensors, 4) of segments whose worlds both have y up.

    `q_I = yaw(psi_group) q_T q_L_sensor`. Given the headings a mounting is a weighted chordal mean; given the mountings
    a heading has a closed form. The headings of `by_vertical` are the start.
    """
    rough_rows = 120  # frames per segment until the last scale
    rough = [segment.thinned(rough_rows) for segment in segments]
    psis, mountings = by_vertical(rough, groups, sensors), np.tile(quat.IDENTITY, (sensors, 1))
    for k in {s.sensor for s in rough}:
        mountings[k] = _mounting([(s, np.ones(len(s.inertial))) for s in rough if s.sensor == k], psis)
    best = _alternated(rough, sensors, (psis, mountings), SCALES.repeat(ROUNDS))
    last_rounds = 12  # iterations at the last scale
    return _alternated(segments, sensors, best, SCALES[-1:].repeat(last_rounds))


def heading_given(segments: Sequence[SynchronisedSegment], mountings: np.ndarray) -> float:
    """Return the common heading of segments with known mountings (sensors, 4), robustly, from twelve starts."""
    difference = [
        quat.multiply(quat.multiply(s.inertial, quat.conjugate(mountings[s.sensor])), quat.conjugate(s.tracked))
        for s in segments
    ]
    turns = np.concatenate(difference)
    best, least = 0.0, np.inf
    for start in START_HEADINGS:
        psi = float(start)
        for width in np.append(SCALES, SCALES[-1:].repeat(ROUNDS)):
            psi = _heading_of(turns, weights_of(quat.angle(turns, yaw(psi)), width))
        cost = cost_of(quat.angle(turns, yaw(psi)), float(SCALES[-1]))
        if cost < least - 1e-12:
            best, least = psi, cost
    return best


def _alternated(
    segments: Sequence[SynchronisedSegment], sensors: int, start: tuple[np.ndarray, np.ndarray], scales: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return headings and mountings after alternating updates at each scale."""
    psis, mountings = start[0].copy(), start[1].copy()
    groups = len(psis)
    for scale in scales:
        weights = [weights_of(residuals(s, yaw(psis[s.group]), mountings[s.sensor]), scale) for s in segments]
        for k in range(sensors):
            own = [(s, w) for s, w in zip(segments, weights, strict=True) if s.sensor == k]
            if own:
                mountings[k] = _mounting(own, psis)
        for g in range(groups):
            own = [(s, w) for s, w in zip(segments, weights, strict=True) if s.group == g]
            if own:
                turns = [_turns(s, mountings[s.sensor]) for s, _ in own]
                psis[g] = _heading_of(np.concatenate(turns), np.concatenate([w for _, w in own]))
    return psis, mountings


def by_vertical(segments: Sequence[SynchronisedSegment], groups: int, sensors: int) -> np.ndarray:
    """Return headings (groups,), radians, with mountings that align the measured vertical with the limbs', robustly."""
    psis, mountings = np.zeros(groups), np.tile(quat.IDENTITY, (sensors, 1))
    for k in {s.sensor for s in segments}:
        own = [s for s in segments if s.sensor == k]
        seen = _verticals(np.concatenate([s.inertial for s in own]))
        tracked = _verticals(np.concatenate([s.tracked for s in own]))
        weights = np.ones(len(seen))
        for scale in SCALES.repeat(ROUNDS):
            mountings[k] = quat.from_matrices(_wahba(seen, tracked, weights))
            cosine = (quat.rotate(mountings[k], seen) * tracked).sum(axis=1)
            weights = weights_of(np.arccos(np.clip(cosine, -1.0, 1.0)), float(scale))
    for g in {s.group for s in segments}:
        psis[g] = heading_given([s for s in segments if s.group == g], mountings)
    return psis


def _verticals(orientations: np.ndarray) -> np.ndarray:
    """Return the vertical in the local frame of orientations (N, 4): float64 (N, 3)."""
    return quat.rotate(quat.conjugate(orientations), np.array([0.0, 1.0, 0.0]))


def _wahba(vectors: np.ndarray, targets: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) that best aligns `vectors` (N, 3) with `targets` (N, 3)."""
    u, _, v = np.linalg.svd(np.einsum("n,ni,nj->ij", weights, targets, vectors))
    return np.asarray((u * [1.0, 1.0, np.linalg.det(u) * np.linalg.det(v)]) @ v)


def _mounting(own: Sequence[tuple[SynchronisedSegment, np.ndarray]], psis: np.ndarray) -> np.ndarray:
    local = [quat.multiply(quat.conjugate(s.tracked), quat.multiply(yaw(-psis[s.group]), s.inertial)) for s, _ in own]
    return quat.mean(np.concatenate(local), np.concatenate([w for _, w in own]))


def _turns(segment: SynchronisedSegment, mounting: np.ndarray) -> np.ndarray:
    """Return rotations (N, 4) from the tracked to the measured limb; about y for exact data."""
    return quat.multiply(quat.multiply(segment.inertial, quat.conjugate(mounting)), quat.conjugate(segment.tracked))


def _heading_of(turns: np.ndarray, weights: np.ndarray) -> float:
    """Return the weighted mean angle about y of rotations (N, 4), from the first eigenvector of their w, y part."""
    w, y = turns[:, 0], turns[:, 2]
    return float(np.arctan2(2.0 * (weights * w * y).sum(), (weights * (w * w - y * y)).sum()))
