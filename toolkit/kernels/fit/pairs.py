"""Correspondences between mesh and depth image, in both directions, added to the joint quadratics, compiled.

All quantities are in the camera frame. The weight of a pair falls with its distance d as `1 / (1 + (d / sigma)^2)^2`
(Geman-McClure), which limits the effect of wrong correspondences.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.fit.twists import add_pair
from toolkit.kernels.image.pixel_search import longest_ray, nearest_pixels
from toolkit.kernels.image.raster import NEAREST
from toolkit.kernels.kinematics import carry


@njit(cache=True)
def visible_vertices(
    chosen: np.ndarray,
    vertices: np.ndarray,
    normals: np.ndarray,
    model_depth: np.ndarray,
    model_intrinsics: np.ndarray,
    evidence: np.ndarray,
    evidence_intrinsics: np.ndarray,
    facing: float,
    tolerance: float,
    out: np.ndarray,
) -> None:
    """Compute the visible chosen vertices: facing the camera, at an observed pixel, not occluded by the body.

    A vertex faces the camera when the cosine between its normal and the direction to the camera exceeds `facing`; it is
    hidden when the drawn body is nearer by more than `tolerance` metres. Pixels outside the image and NaN pixels of
    `evidence` (H, W) are unobserved. Fills `out` (C,) bool.
    """
    height, width = model_depth.shape
    for i in range(chosen.shape[0]):
        v = chosen[i]
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        out[i] = False
        if z <= NEAREST:
            continue
        cosine = -(normals[v, 0] * x + normals[v, 1] * y + normals[v, 2] * z) / np.sqrt(x * x + y * y + z * z)
        if cosine < facing:
            continue
        pu = int(np.rint(model_intrinsics[0] * x / z + model_intrinsics[2]))
        pv = int(np.rint(model_intrinsics[1] * y / z + model_intrinsics[3]))
        if not (pu >= 0 and pu < width and pv >= 0 and pv < height):
            continue
        front = model_depth[pv, pu]
        if front > 0.0 and front < z - tolerance:
            continue
        out[i] = is_observed(x, y, z, evidence, evidence_intrinsics)


@njit(cache=True)
def is_observed(x: float, y: float, z: float, evidence: np.ndarray, intrinsics: np.ndarray) -> bool:
    """Return whether a point in front of the camera projects onto a pixel of `evidence` (H, W) that is not NaN."""
    if z <= NEAREST:
        return False
    u = int(np.rint(intrinsics[0] * x / z + intrinsics[2]))
    v = int(np.rint(intrinsics[1] * y / z + intrinsics[3]))
    return u >= 0 and u < evidence.shape[1] and v >= 0 and v < evidence.shape[0] and not np.isnan(evidence[v, u])


@njit(cache=True)
def observed_points(points: np.ndarray, evidence: np.ndarray, intrinsics: np.ndarray, out: np.ndarray) -> None:
    """Fill `out` (N,) float64 with 1 where `is_observed` holds for `points` (N, 3), camera frame, else with 0."""
    for i in range(points.shape[0]):
        out[i] = 1.0 if is_observed(points[i, 0], points[i, 1], points[i, 2], evidence, intrinsics) else 0.0


@njit(cache=True)
def support_of_joints(
    around: np.ndarray, gaps: np.ndarray, observed: np.ndarray, width: float, support: np.ndarray, share: np.ndarray
) -> None:
    """Compute the support of each joint by the measured points near its vertices, and the observed fraction of these.

    `around` (J, C) holds weights of the C vertices around each joint; `gaps` (C,) metres, NaN for none: they count as a
    Gaussian of `width`; `observed` (C,) is 1 or 0. Fills `support` (J,), twice the mean, at most 1, and `share` (J,).
    """
    near = np.empty(gaps.shape[0])
    for i in range(gaps.shape[0]):
        near[i] = 0.0 if np.isnan(gaps[i]) else np.exp(-gaps[i] * gaps[i] / (2.0 * width * width))
    for j in range(around.shape[0]):
        close, seen = 0.0, 0.0
        for i in range(gaps.shape[0]):
            close += around[j, i] * near[i]
            seen += around[j, i] * observed[i]
        support[j] = min(2.0 * close, 1.0)
        share[j] = seen


@njit(cache=True)
def nearest_medians(
    points: np.ndarray,
    wanted_points: np.ndarray,
    depth: np.ndarray,
    intrinsics: np.ndarray,
    reach: float,
    wanted: int,
    out: np.ndarray,
) -> None:
    """Compute the median of the nearest measured points of each wanted point; fills `out` (C, 3), NaN without."""
    width = depth.shape[1]
    ray = longest_ray(depth.shape[0], width, intrinsics)
    squared = np.empty(wanted)
    pixels = np.empty(wanted, dtype=np.int64)
    sample = np.empty((3, wanted))
    for i in range(points.shape[0]):
        out[i, 0] = np.nan
        if not wanted_points[i]:
            continue
        found = nearest_pixels(points[i, 0], points[i, 1], points[i, 2], depth, intrinsics, ray, reach, squared, pixels)
        if found == 0:
            continue
        for n in range(found):
            u = pixels[n] % width
            v = pixels[n] // width
            z = depth[v, u]
            sample[0, n] = (u - intrinsics[2]) * z / intrinsics[0]
            sample[1, n] = (v - intrinsics[3]) * z / intrinsics[1]
            sample[2, n] = z
        for a in range(3):
            # Insertion sort: at most nine values.
            for n in range(1, found):
                value = sample[a, n]
                m = n
                while m > 0 and sample[a, m - 1] > value:
                    sample[a, m] = sample[a, m - 1]
                    m -= 1
                sample[a, m] = value
            out[i, a] = 0.5 * (sample[a, (found - 1) // 2] + sample[a, found // 2])


@njit(cache=True)
def vertex_gaps(points: np.ndarray, nearest: np.ndarray, visible: np.ndarray, cap: float, gaps: np.ndarray) -> float:
    """Return the mean distance of visible `points` (C, 3) to their `nearest` (C, 3), each at most `cap`.

    Points without a measurement (NaN) count as the cap, as does a body without visible points. Fills `gaps` (C,) with
    the distances.
    """
    total, count = 0.0, 0
    for i in range(points.shape[0]):
        dx, dy, dz = points[i, 0] - nearest[i, 0], points[i, 1] - nearest[i, 1], points[i, 2] - nearest[i, 2]
        gaps[i] = np.sqrt(dx * dx + dy * dy + dz * dz)
        if visible[i]:
            total += gaps[i] if gaps[i] < cap else cap
            count += 1
    return total / count if count else cap


@njit(cache=True)
def sample_gaps(points: np.ndarray, vertex_of: np.ndarray, samples: np.ndarray, cap: float, gaps: np.ndarray) -> float:
    """Return the mean distance of `samples` (N, 3) to their `points` (N, 3), each at most `cap`; 0 without any.

    A sample with negative `vertex_of` counts as the cap. Fills `gaps` (N,) with the distances.
    """
    total = 0.0
    for i in range(samples.shape[0]):
        gaps[i] = cap
        if vertex_of[i] >= 0:
            dx, dy, dz = points[i, 0] - samples[i, 0], points[i, 1] - samples[i, 1], points[i, 2] - samples[i, 2]
            gaps[i] = min(np.sqrt(dx * dx + dy * dy + dz * dz), cap)
        total += gaps[i]
    return total / max(samples.shape[0], 1)


@njit(cache=True)
def nearest_model_points(
    samples: np.ndarray,
    model_depth: np.ndarray,
    model_triangle: np.ndarray,
    model_intrinsics: np.ndarray,
    faces: np.ndarray,
    vertices: np.ndarray,
    reach: float,
    points: np.ndarray,
    vertex_of: np.ndarray,
) -> None:
    """Find the nearest visible surface point of the drawn body for each measured sample (N, 3).

    Fills `points` (N, 3) and `vertex_of` (N,), the corner of the drawn triangle nearest to that point; -1 where none is
    within `reach` metres.
    """
    width = model_depth.shape[1]
    ray = longest_ray(model_depth.shape[0], width, model_intrinsics)
    squared = np.empty(1)
    pixels = np.empty(1, dtype=np.int64)
    for i in range(samples.shape[0]):
        vertex_of[i] = -1
        found = nearest_pixels(
            samples[i, 0], samples[i, 1], samples[i, 2], model_depth, model_intrinsics, ray, reach, squared, pixels
        )
        if found == 0:
            continue
        u = pixels[0] % width
        v = pixels[0] // width
        z = model_depth[v, u]
        x = (u - model_intrinsics[2]) * z / model_intrinsics[0]
        y = (v - model_intrinsics[3]) * z / model_intrinsics[1]
        points[i, 0], points[i, 1], points[i, 2] = x, y, z
        best = np.inf
        for c in range(3):
            corner = faces[model_triangle[v, u], c]
            dx, dy, dz = vertices[corner, 0] - x, vertices[corner, 1] - y, vertices[corner, 2] - z
            d2 = dx * dx + dy * dy + dz * dz
            if d2 < best:
                best = d2
                vertex_of[i] = corner


@njit(cache=True)
def add_pairs(
    targets: np.ndarray,
    points: np.ndarray,
    vertex_of: np.ndarray,
    weights: np.ndarray,
    normals: np.ndarray,
    skin_joints: np.ndarray,
    skin_weights: np.ndarray,
    reference: np.ndarray,
    sigma: float,
    plane: float,
    point: float,
    hessian: np.ndarray,
    gradient: np.ndarray,
) -> None:
    """Add pairs from points (N, 3) of the body's surface, near vertices `vertex_of` (N,), to targets (N, 3), with a
    plane and a point part; a negative vertex or a NaN target has no pair.
    """
    for i in range(targets.shape[0]):
        v = vertex_of[i]
        if v < 0 or np.isnan(targets[i, 0]):
            continue
        ex = points[i, 0] - targets[i, 0]
        ey = points[i, 1] - targets[i, 1]
        ez = points[i, 2] - targets[i, 2]
        ratio = 1.0 + (ex * ex + ey * ey + ez * ez) / (sigma * sigma)
        robust = weights[i] / (ratio * ratio)
        for s in range(skin_joints.shape[1]):
            w = skin_weights[v, s] * robust
            if w > 0.0:
                add_pair(
                    hessian, gradient, skin_joints[v, s],
                    points[i, 0] - reference[0], points[i, 1] - reference[1], points[i, 2] - reference[2],
                    normals[v, 0], normals[v, 1], normals[v, 2], ex, ey, ez, w * plane, w * point,
                )  # fmt: skip


@njit(cache=True)
def add_contacts(
    contacts: np.ndarray,
    ball_joint: np.ndarray,
    ball_offset: np.ndarray,
    radii: np.ndarray,
    rotations: np.ndarray,
    origins: np.ndarray,
    reference: np.ndarray,
    soft: float,
    weight: float,
    hessian: np.ndarray,
    gradient: np.ndarray,
) -> None:
    """Add a repulsion of the balls of `contacts` (K, 2) that are nearer than `soft` times the sum of their radii.

    Each of the two moves the whole distance, as if the other were fixed. Ball b is carried by joint `ball_joint[b]` at
    `ball_offset[b]` from it; `rotations` (J, 3, 3) and `origins` (J, 3) place the joints.
    """
    centres = np.empty(ball_offset.shape)
    carry(ball_joint, ball_offset, rotations, origins, centres)
    for n in range(contacts.shape[0]):
        first, second = contacts[n, 0], contacts[n, 1]
        reach = soft * (radii[first] + radii[second])
        dx = centres[first, 0] - centres[second, 0]
        dy = centres[first, 1] - centres[second, 1]
        dz = centres[first, 2] - centres[second, 2]
        squared = dx * dx + dy * dy + dz * dz
        if squared >= reach * reach or squared < 1e-12:
            continue
        distance = np.sqrt(squared)
        # The residual is the overlap, along the line from the second ball to the first.
        nx, ny, nz = dx / distance, dy / distance, dz / distance
        overlap = distance - reach
        for ball, sign in ((first, 1.0), (second, -1.0)):
            add_pair(
                hessian, gradient, ball_joint[ball],
                centres[ball, 0] - reference[0], centres[ball, 1] - reference[1], centres[ball, 2] - reference[2],
                nx, ny, nz, sign * overlap * nx, sign * overlap * ny, sign * overlap * nz, weight, 0.0,
            )  # fmt: skip


@njit(cache=True)
def mean_nearest(points: np.ndarray, vertices: np.ndarray, cap: float) -> float:
    """Return the mean capped distance of `points` (N, 3) to the nearest of `vertices` (V, 3); 0 without points."""
    total = 0.0
    for i in range(points.shape[0]):
        best = cap * cap
        for v in range(vertices.shape[0]):
            dx = points[i, 0] - vertices[v, 0]
            dy = points[i, 1] - vertices[v, 1]
            dz = points[i, 2] - vertices[v, 2]
            best = min(best, dx * dx + dy * dy + dz * dz)
        total += np.sqrt(best)
    return total / max(points.shape[0], 1)
