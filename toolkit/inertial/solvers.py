"""The two offsets between sensor and limb: `q_I(t) = q_G q_T(t) q_L` for all t (thesis, Eq. 7.5).

`park_martin` is the thesis's own, linear and unprotected. `heading` knows the vertical in both worlds, so that `q_G` is
an angle, and weighs each frame by Geman and McClure, from a wide scale to a narrow one, so that frames in which the
tracker erred lose their say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.body.rotations import quaternions as quat

SCALES = np.radians([40.0, 28.0, 20.0, 14.0, 10.0])
"""Scale of the weights, narrower and narrower, radians: ten degrees is what soft tissue and a good track differ by."""
ROUNDS, LAST_ROUNDS = 3, 12
"""Rounds at each scale, and at the last."""
STARTS = 12
"""Headings that are tried first, 30 degrees apart."""
FINALISTS = 3
"""Starts that compete to the end."""
ROUGH_ROWS = 120
"""Frames per strand while the starts compete."""
LEAST_TURN, MOST_TURN = np.radians(20.0), np.radians(160.0)
"""Turns between two frames that have an axis worth having: below it is noise, near a half turn it flips."""


@dataclass(frozen=True, eq=False)
class SynchronisedSegment:
    """Orientations of one sensor in one take.

    Attributes
    ----------
    sensor : number of the sensor; all its strands share `q_L`
    group : number of the heading; all its strands share it
    inertial : float64 (N, 4), `q_I`
    tracked : float64 (N, 4), `q_T`
    """

    sensor: int
    group: int
    inertial: np.ndarray
    tracked: np.ndarray

    def thinned(self, rows: int) -> SynchronisedSegment:
        """At most so many rows, evenly."""
        step = max(1, -(-len(self.inertial) // rows))
        return SynchronisedSegment(self.sensor, self.group, self.inertial[::step], self.tracked[::step])


def weights_of(angles: np.ndarray, scale: float) -> np.ndarray:
    """Geman-McClure weights (N,) of angles (N,), radians."""
    return 1.0 / (1.0 + (angles / scale) ** 2) ** 2


def cost_of(angles: np.ndarray, scale: float) -> float:
    """Mean Geman-McClure cost, 0 to 1."""
    squares = (angles / scale) ** 2
    return float((squares / (1.0 + squares)).mean())


def park_martin(alpha: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """`X` (4,) with `A X = X B`, of rotation vectors (N, 3) of A and B (thesis, Eq. 7.13 and 7.14).

    `X` is taken from the singular vectors with determinant +1, which is `(M'M)^(-1/2) M'` where that is a rotation.
    """
    u, _, v = np.linalg.svd(np.einsum("ni,nj->ij", alpha, beta))
    return quat.from_matrices((u * [1.0, 1.0, np.linalg.det(u) * np.linalg.det(v)]) @ v)


def thesis(inertial: np.ndarray, tracked: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """`q_G` and `q_L` (4,) of orientations (N, 4), by pairs of frames (thesis, Eq. 7.7 and 7.15)."""
    s, t = rng.integers(0, len(tracked), size=(2, 4000))
    turn = quat.angle(tracked[s], tracked[t])
    fine = (turn > LEAST_TURN) & (turn < MOST_TURN)
    s, t = (s[fine], t[fine]) if fine.any() else (s, t)

    def pair(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return quat.logarithm(quat.multiply(first, second))

    local = park_martin(pair(quat.conjugate(inertial[s]), inertial[t]), pair(quat.conjugate(tracked[s]), tracked[t]))
    world = park_martin(pair(inertial[s], quat.conjugate(inertial[t])), pair(tracked[s], quat.conjugate(tracked[t])))
    return world, quat.conjugate(local)


def residuals(strand: SynchronisedSegment, world: np.ndarray, mounting: np.ndarray) -> np.ndarray:
    """Angles (N,), radians, between what the sensor says and what the track says of it (thesis, Eq. 7.16)."""
    return quat.angle(strand.inertial, quat.multiply(quat.multiply(world, strand.tracked), mounting))


def yaw(psi: float) -> np.ndarray:
    """A turn about y (4,)."""
    return quat.exponential([0.0, psi, 0.0])


def heading(strands: Sequence[SynchronisedSegment], groups: int, sensors: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Headings (groups,) and mountings (sensors, 4) of strands whose worlds both have y up, and the cost.

    `q_I = yaw(psi_group) q_T q_L_sensor`. Given the headings a mounting is a weighted chordal mean; given the mountings
    a heading has a closed form. Every start fixes the first heading; the others follow through the sensors they share.
    One more start needs no heading: the mountings that bring the vertical of all strands together. The best few of
    them, by the widest scale, compete to the end.
    """
    rough = [strand.thinned(ROUGH_ROWS) for strand in strands]
    starts = [_spread(rough, groups, sensors, psi) for psi in np.arange(STARTS) * (2.0 * np.pi / STARTS)]
    starts.append(by_vertical(rough, groups, sensors))
    tried = sorted(
        (_alternated(rough, sensors, start, SCALES[:1].repeat(ROUNDS)) for start in starts),
        key=lambda found: found[2],
    )
    ends = (_alternated(rough, sensors, found[:2], SCALES.repeat(ROUNDS)) for found in tried[:FINALISTS])
    best = min(ends, key=lambda found: found[2])[:2]
    return _alternated(strands, sensors, best, SCALES[-1:].repeat(LAST_ROUNDS))


def heading_given(strands: Sequence[SynchronisedSegment], mountings: np.ndarray) -> float:
    """The one heading of strands whose mountings (sensors, 4) are known, the best of all starts, then robustly."""
    difference = [
        quat.multiply(quat.multiply(s.inertial, quat.conjugate(mountings[s.sensor])), quat.conjugate(s.tracked))
        for s in strands
    ]
    turns = np.concatenate(difference)
    best, least = 0.0, np.inf
    for start in np.arange(STARTS) * (2.0 * np.pi / STARTS):
        psi = float(start)
        for width in np.append(SCALES, SCALES[-1:].repeat(ROUNDS)):
            psi = _heading_of(turns, weights_of(quat.angle(turns, yaw(psi)), width))
        cost = cost_of(quat.angle(turns, yaw(psi)), float(SCALES[-1]))
        if cost < least - 1e-12:
            best, least = psi, cost
    return best


def _alternated(
    strands: Sequence[SynchronisedSegment], sensors: int, start: tuple[np.ndarray, np.ndarray], scales: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mountings and headings in turn, at each of the scales, and the cost at the last of them."""
    psis, mountings = start[0].copy(), start[1].copy()
    groups = len(psis)
    for scale in scales:
        weights = [weights_of(residuals(s, yaw(psis[s.group]), mountings[s.sensor]), scale) for s in strands]
        for k in range(sensors):
            own = [(s, w) for s, w in zip(strands, weights, strict=True) if s.sensor == k]
            if own:
                mountings[k] = _mounting(own, psis)
        for g in range(groups):
            own = [(s, w) for s, w in zip(strands, weights, strict=True) if s.group == g]
            if own:
                turns = [_turns(s, mountings[s.sensor]) for s, _ in own]
                psis[g] = _heading_of(np.concatenate(turns), np.concatenate([w for _, w in own]))
    angles = np.concatenate([residuals(s, yaw(psis[s.group]), mountings[s.sensor]) for s in strands])
    return psis, mountings, cost_of(angles, scales[-1])


def _spread(
    strands: Sequence[SynchronisedSegment], groups: int, sensors: int, start: float
) -> tuple[np.ndarray, np.ndarray]:
    """First headings and mountings: the first group's is `start`; who shares a sensor with a known group is next."""
    psis, mountings = np.full(groups, np.nan), np.full((sensors, 4), np.nan)
    for _ in range(groups + sensors):
        for s in strands:
            if np.isnan(psis[s.group]) and np.isfinite(mountings[s.sensor, 0]):
                turns = _turns(s, mountings[s.sensor])
                psis[s.group] = _heading_of(turns, np.ones(len(turns)))
            if np.isfinite(psis[s.group]) and np.isnan(mountings[s.sensor, 0]):
                mountings[s.sensor] = _mounting([(s, np.ones(len(s.inertial)))], psis)
        open_groups = [s.group for s in strands if np.isnan(psis[s.group])]
        if not open_groups:
            break
        if all(np.isnan(mountings[s.sensor, 0]) for s in strands if np.isnan(psis[s.group])):
            psis[open_groups[0]] = start
    return np.nan_to_num(psis), np.where(np.isnan(mountings), quat.IDENTITY, mountings)


def by_vertical(strands: Sequence[SynchronisedSegment], groups: int, sensors: int) -> tuple[np.ndarray, np.ndarray]:
    """Headings and mountings that bring the vertical as the sensors see it on to that of the limbs, robustly.

    Returns float64 (groups,) radians about the vertical, and quaternions (sensors, 4).
    """
    psis, mountings = np.zeros(groups), np.tile(quat.IDENTITY, (sensors, 1))
    for k in {s.sensor for s in strands}:
        own = [s for s in strands if s.sensor == k]
        seen = _verticals(np.concatenate([s.inertial for s in own]))
        tracked = _verticals(np.concatenate([s.tracked for s in own]))
        weights = np.ones(len(seen))
        for scale in SCALES.repeat(ROUNDS):
            mountings[k] = quat.from_matrices(_wahba(seen, tracked, weights))
            cosine = (quat.rotate(mountings[k], seen) * tracked).sum(axis=1)
            weights = weights_of(np.arccos(np.clip(cosine, -1.0, 1.0)), float(scale))
    for g in {s.group for s in strands}:
        psis[g] = heading_given([s for s in strands if s.group == g], mountings)
    return psis, mountings


def _verticals(orientations: np.ndarray) -> np.ndarray:
    """The vertical as a person of these orientations (N, 4) sees it: float64 (N, 3)."""
    return quat.rotate(quat.conjugate(orientations), np.array([0.0, 1.0, 0.0]))


def _wahba(vectors: np.ndarray, targets: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) that brings `vectors` (N, 3) on to `targets` (N, 3) best."""
    u, _, v = np.linalg.svd(np.einsum("n,ni,nj->ij", weights, targets, vectors))
    return np.asarray((u * [1.0, 1.0, np.linalg.det(u) * np.linalg.det(v)]) @ v)


def _mounting(own: Sequence[tuple[SynchronisedSegment, np.ndarray]], psis: np.ndarray) -> np.ndarray:
    local = [quat.multiply(quat.conjugate(s.tracked), quat.multiply(yaw(-psis[s.group]), s.inertial)) for s, _ in own]
    return quat.mean(np.concatenate(local), np.concatenate([w for _, w in own]))


def _turns(strand: SynchronisedSegment, mounting: np.ndarray) -> np.ndarray:
    """From the tracked to the sensor's idea of the limb (N, 4): turns about y, if all is right."""
    return quat.multiply(quat.multiply(strand.inertial, quat.conjugate(mounting)), quat.conjugate(strand.tracked))


def _heading_of(turns: np.ndarray, weights: np.ndarray) -> float:
    """The angle about y that turns (N, 4) agree on best: twice that of the first eigenvector of their w, y part."""
    w, y = turns[:, 0], turns[:, 2]
    return float(np.arctan2(2.0 * (weights * w * y).sum(), (weights * (w * w - y * y)).sum()))
