"""Compiled loops over sensor data: integration of angular velocity, correlation over lags."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True)
def integrate(times: np.ndarray, gyro: np.ndarray, out: np.ndarray) -> None:
    """Integrate orientations (N, 4) of a sensor in the frame of its first row; fills `out`.

    Parameters
    ----------
    times : float64 (N,), seconds, increasing
    gyro : float64 (N, 3), rad/s, sensor frame; between two rows their mean is used
    """
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    for i in range(times.shape[0]):
        if i > 0:
            share = 0.25 * (times[i] - times[i - 1])
            hx = share * (gyro[i - 1, 0] + gyro[i, 0])
            hy = share * (gyro[i - 1, 1] + gyro[i, 1])
            hz = share * (gyro[i - 1, 2] + gyro[i, 2])
            half = math.sqrt(hx * hx + hy * hy + hz * hz)
            scale = math.sin(half) / half if half > 1e-12 else 1.0
            dw, dx, dy, dz = math.cos(half), hx * scale, hy * scale, hz * scale
            w, x, y, z = (
                w * dw - x * dx - y * dy - z * dz,
                w * dx + x * dw + y * dz - z * dy,
                w * dy - x * dz + y * dw + z * dx,
                w * dz + x * dy - y * dx + z * dw,
            )
            length = math.sqrt(w * w + x * x + y * y + z * z)
            w, x, y, z = w / length, x / length, y / length, z / length
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = w, x, y, z


@njit(cache=True)
def correlation_over_lags(
    first: np.ndarray, first_known: np.ndarray, second: np.ndarray, second_known: np.ndarray, lags: np.ndarray,
    least: int, out: np.ndarray,
) -> None:  # fmt: skip
    """Compute the normalised correlation of `first[i]` with `second[i + lag]` over the rows known in both.

    Parameters
    ----------
    first, second : float64 (N,) and (M,), on a common time grid
    first_known, second_known : bool (N,) and (M,)
    lags : int64 (L,), in rows
    least : a lag with fewer common rows is unknown
    out : float64 (L,), filled, -1 to 1; NaN if a lag is unknown or a signal is constant
    """
    for k in range(lags.shape[0]):
        lag = lags[k]
        count = 0
        sa, sb, saa, sbb, sab = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(max(0, -lag), min(first.shape[0], second.shape[0] - lag)):
            j = i + lag
            if first_known[i] and second_known[j]:
                a, b = first[i], second[j]
                count += 1
                sa += a
                sb += b
                saa += a * a
                sbb += b * b
                sab += a * b
        out[k] = np.nan
        if count >= least and count > 1:
            va = saa - sa * sa / count
            vb = sbb - sb * sb / count
            if va > 1e-9 * saa and vb > 1e-9 * sbb:
                out[k] = (sab - sa * sb / count) / math.sqrt(va * vb)
