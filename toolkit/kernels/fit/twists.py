"""Normal equations of an articulated body, gathered per joint as 6x6 twist quadratics, compiled.

A pair (point p carried by joint j, residual e, metric M) costs `(e + B x)' M (e + B x)` for a small motion
`x = (omega, tau)` of joint j, with `B = [-[p]x, I]`. Pairs add to the quadratic of their joint; quadratics of joints
below are summed into their parents (the composite rigid bodies of articulated dynamics); a pose entry with twist `s`
then reads its row from the composite of its joint. Assembling costs joints times entries, however many pairs there are.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.linear import cholesky, substitute


@njit(cache=True)
def add_pair(
    hessian: np.ndarray,
    gradient: np.ndarray,
    joint: int,
    px: float,
    py: float,
    pz: float,
    nx: float,
    ny: float,
    nz: float,
    ex: float,
    ey: float,
    ez: float,
    plane: float,
    point: float,
) -> None:
    """Add one pair with metric `plane n n' + point I` to joint `joint` of `hessian` (J, 6, 6) and `gradient` (J, 6).

    Only the upper triangle of each 6x6 block is kept.
    """
    h = hessian[joint]
    g = gradient[joint]
    if plane > 0.0:
        s0 = py * nz - pz * ny
        s1 = pz * nx - px * nz
        s2 = px * ny - py * nx
        r = plane * (nx * ex + ny * ey + nz * ez)
        g[0] += r * s0
        g[1] += r * s1
        g[2] += r * s2
        g[3] += r * nx
        g[4] += r * ny
        g[5] += r * nz
        w0, w1, w2 = plane * s0, plane * s1, plane * s2
        h[0, 0] += w0 * s0
        h[0, 1] += w0 * s1
        h[0, 2] += w0 * s2
        h[1, 1] += w1 * s1
        h[1, 2] += w1 * s2
        h[2, 2] += w2 * s2
        h[0, 3] += w0 * nx
        h[0, 4] += w0 * ny
        h[0, 5] += w0 * nz
        h[1, 3] += w1 * nx
        h[1, 4] += w1 * ny
        h[1, 5] += w1 * nz
        h[2, 3] += w2 * nx
        h[2, 4] += w2 * ny
        h[2, 5] += w2 * nz
        h[3, 3] += plane * nx * nx
        h[3, 4] += plane * nx * ny
        h[3, 5] += plane * nx * nz
        h[4, 4] += plane * ny * ny
        h[4, 5] += plane * ny * nz
        h[5, 5] += plane * nz * nz
    if point > 0.0:
        g[0] += point * (py * ez - pz * ey)
        g[1] += point * (pz * ex - px * ez)
        g[2] += point * (px * ey - py * ex)
        g[3] += point * ex
        g[4] += point * ey
        g[5] += point * ez
        h[0, 0] += point * (py * py + pz * pz)
        h[1, 1] += point * (px * px + pz * pz)
        h[2, 2] += point * (px * px + py * py)
        h[0, 1] -= point * px * py
        h[0, 2] -= point * px * pz
        h[1, 2] -= point * py * pz
        h[0, 4] -= point * pz
        h[0, 5] += point * py
        h[1, 3] += point * pz
        h[1, 5] -= point * px
        h[2, 3] -= point * py
        h[2, 4] += point * px
        h[3, 3] += point
        h[4, 4] += point
        h[5, 5] += point


@njit(cache=True)
def assemble(
    hessian: np.ndarray,
    gradient: np.ndarray,
    parents: np.ndarray,
    dof_joint: np.ndarray,
    axes: np.ndarray,
    origins: np.ndarray,
    reference: np.ndarray,
    translation: np.ndarray,
    below: np.ndarray,
    matrix: np.ndarray,
    vector: np.ndarray,
) -> None:
    """Sum joint quadratics up the tree and read off `matrix` (P, P) = J'MJ and `vector` (P,) = J'Me.

    The twists are taken about `reference`, from which the pairs' points count; `origins` are absolute. `translation`
    (3, 3) holds the directions of the three root translations as columns. `hessian` and `gradient` are overwritten by
    the composites.
    """
    joints = parents.shape[0]
    for j in range(joints - 1, -1, -1):
        for a in range(6):
            for b in range(a):
                hessian[j, a, b] = hessian[j, b, a]
        p = parents[j]
        if p >= 0:
            for a in range(6):
                gradient[p, a] += gradient[j, a]
                for b in range(a, 6):
                    hessian[p, a, b] += hessian[j, a, b]
    size = 3 + dof_joint.shape[0]
    twists = np.zeros((size, 6))
    joint_of = np.zeros(size, dtype=np.int64)
    for k in range(3):
        for a in range(3):
            twists[k, 3 + a] = translation[a, k]
    for k in range(3, size):
        i = dof_joint[k - 3]
        joint_of[k] = i
        ax, ay, az = axes[k - 3, 0], axes[k - 3, 1], axes[k - 3, 2]
        ox, oy, oz = origins[i, 0] - reference[0], origins[i, 1] - reference[1], origins[i, 2] - reference[2]
        twists[k, 0], twists[k, 1], twists[k, 2] = ax, ay, az
        twists[k, 3] = oy * az - oz * ay
        twists[k, 4] = oz * ax - ox * az
        twists[k, 5] = ox * ay - oy * ax
    row = np.empty(6)
    for k in range(size):
        j = joint_of[k]
        total = 0.0
        for a in range(6):
            total += twists[k, a] * gradient[j, a]
            row[a] = 0.0
            for b in range(6):
                row[a] += hessian[j, a, b] * twists[k, b]
        vector[k] = total
        for other in range(k + 1):
            value = 0.0
            # Entries of one joint or of an ancestor share the composite of the deeper joint, k's: parents come first.
            if below[joint_of[other], j]:
                for a in range(6):
                    value += row[a] * twists[other, a]
            matrix[k, other] = value
            matrix[other, k] = value


@njit(cache=True)
def add_gaussian(
    matrix: np.ndarray, vector: np.ndarray, pose: np.ndarray, mean: np.ndarray, precision: np.ndarray, weight: float
) -> None:
    """Add `1/2 weight (pose - mean)' precision (pose - mean)` over the entries after the root's, linearised at `pose`.

    `pose`, `mean` and `vector` (P,), `matrix` (P, P), `precision` (P - 6, P - 6).
    """
    for i in range(precision.shape[0]):
        total = 0.0
        for k in range(precision.shape[1]):
            matrix[6 + i, 6 + k] += weight * precision[i, k]
            total += precision[i, k] * (pose[6 + k] - mean[6 + k])
        vector[6 + i] += weight * total


@njit(cache=True)
def advance(pose: np.ndarray, step: np.ndarray) -> float:
    """Add `step` (P,) to `pose` (P,), in place; returns the largest entry of the step.

    The root's rotation vector stays shorter than pi: a longer one is written as the same rotation, turned the other
    way.
    """
    largest = 0.0
    for i in range(pose.shape[0]):
        pose[i] += step[i]
        largest = max(largest, abs(step[i]))
    angle = np.sqrt(pose[3] ** 2 + pose[4] ** 2 + pose[5] ** 2)
    if angle > np.pi:
        for i in range(3, 6):
            pose[i] *= 1.0 - 2.0 * np.pi / angle
    return largest


@njit(cache=True)
def bounded_step(
    matrix: np.ndarray,
    vector: np.ndarray,
    pose: np.ndarray,
    limits: np.ndarray,
    damping: np.ndarray,
    step: np.ndarray,
) -> None:
    """Minimise `x' (matrix + diag(damping)) x / 2 + vector' x` within joint limits (damped least squares).

    Entries that would leave their limits are fixed at the limit and the rest is solved again (an active set that only
    grows, three rounds); what still leaves is clamped. Fills `step` (P,). A matrix that is not positive definite gives
    no step.
    """
    size = vector.shape[0]
    fixed = np.zeros(size, dtype=np.bool_)
    step[:] = 0.0
    a = np.empty((size, size))
    y = np.empty(size)
    for _ in range(3):
        for i in range(size):
            if fixed[i]:
                for j in range(size):
                    a[i, j] = 0.0
                a[i, i] = 1.0
                y[i] = step[i]
            else:
                total = -vector[i]
                for j in range(size):
                    if fixed[j]:
                        total -= matrix[i, j] * step[j]
                        a[i, j] = 0.0
                    else:
                        a[i, j] = matrix[i, j]
                a[i, i] += damping[i]
                y[i] = total
        if not cholesky(a):
            step[:] = 0.0
            return
        substitute(a, y)
        grown = False
        for i in range(size):
            step[i] = y[i]
            low, high = limits[i, 0] - pose[i], limits[i, 1] - pose[i]
            if y[i] < low or y[i] > high:
                step[i] = min(max(y[i], low), high)
                if not fixed[i]:
                    fixed[i] = True
                    grown = True
        if not grown:
            break
