"""Body of a person from T-pose views: coefficients of the shape space, then vertex offsets (Qammaz, 2.1).

The paper registers a manually made mesh to one scan of four views. Here pose and shape are fitted to all views at once,
and offsets of the vertices along their normals represent the remaining shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.placed import PlacedBody, Placer
from toolkit.fitting.refiner import Refiner, mesh_terms
from toolkit.fitting.scene import Scene
from toolkit.fitting.shape import ShapeEstimator, ShapeSettings
from toolkit.io.errors import BodyError
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud


class ScanView(NamedTuple):
    """One view of a person in a T-pose.

    Attributes
    ----------
    cloud : points of the person, level frame
    yaw : approximate angle by which the person is turned to their left, radians; 0 faces the camera
    """

    cloud: Cloud
    yaw: float


class Scan(NamedTuple):
    """Result of a scan.

    Attributes
    ----------
    body : estimated body of the person
    poses : float64 (N, P), of each view, level frame
    seen : bool (V,), vertices that were measured
    residual : metres, median distance of measured points from the body along its normals
    """

    body: Body
    poses: np.ndarray
    seen: np.ndarray
    residual: float


def fit_scan(views: Sequence[ScanView]) -> Scan:
    """Estimate the body of the person in at least two views.

    Raises
    ------
    BodyError
        There are fewer than two views, or they contain no person, different people, or a person without spread arms.
    """
    fitting, stature = FittingSettings(), _checked_stature(views)
    space = ShapeSpace.load()
    body = space.body(space.typical(stature))
    placers = [Placer(body, _small(view.cloud), view.cloud.rotation) for view in views]
    scenes = [Scene(view.cloud, np.zeros((0, 3)), fitting.cloud_samples) for view in views]
    poses = np.array([_t_pose(body, view) for view in views])
    prior = 3.0  # weight of the shape prior, see `ShapeSettings.prior`; each view has many more equations
    shape_settings = ShapeSettings(prior=prior, forgetting=1.0)
    # Number of alternating fits of poses and coefficients; limb length and pose are coupled and converge slowly.
    rounds = 60
    first_rounds, later_rounds = 20, 4  # iterations of each pose in the first round and in later rounds
    for k in range(rounds):
        estimator = ShapeEstimator(body, shape_settings, placers[0], mesh_terms(fitting))
        for i, (placer, scene) in enumerate(zip(placers, scenes, strict=True)):
            iterations = first_rounds if k == 0 else later_rounds
            poses[i] = Refiner(placer, fitting).refine(body, poses[i], scene, iterations=iterations)
            found = estimator.observe(poses[i], scene, placer)
        body = found
    placed = [placer.place(body, pose) for placer, pose in zip(placers, poses, strict=True)]
    measured, weight = _offsets(placed, [view.cloud for view in views])
    smooth = _spread(measured, weight, body.faces)
    own = space.body(body.shape, name="scanned", offsets=smooth)
    seen = weight > 0
    return Scan(own, poses, seen, float(np.median(np.abs(measured - smooth)[seen])) if seen.any() else 0.0)


def _checked_stature(views: Sequence[ScanView]) -> float:
    """Return the stature in metres after checks of the views."""
    if len(views) < 2:
        raise BodyError(f"a body cannot be scanned from {len(views)} view; give two or more, of a person who turns")
    if empty := [i + 1 for i, view in enumerate(views) if len(view.cloud) < 300]:
        raise BodyError(f"view {empty[0]} shows no person; record a person in a T-pose")
    extents = np.array([np.ptp(np.percentile(v.cloud.points, [0.2, 99.8], axis=0), axis=0) for v in views])
    statures = extents[:, 1]
    unlike = 0.08  # maximum relative difference of statures between views of one person
    if np.ptp(statures) > unlike * statures.max():
        raise BodyError(
            f"the views show people of {statures.min():.2f} and {statures.max():.2f} m, or a truncated person; "
            "record one whole person"
        )
    stature = float(np.median(statures))
    narrow = 0.7  # minimum arm span in some view as a fraction of the stature
    if extents[:, 0].max() < narrow * stature:
        raise BodyError(
            f"the arms span {extents[:, 0].max():.2f} m at most, of a stature of {stature:.2f} m; hold them out to the "
            "sides in every view, and face the camera in one"
        )
    return stature


def _small(cloud: Cloud) -> Camera:
    """Return the camera of the image into which the body is drawn."""
    wide = 200  # image width above which the body is drawn at half resolution, pixels
    return cloud.camera.subsampled(2) if cloud.camera.width > wide else cloud.camera


def _t_pose(body: Body, view: ScanView) -> np.ndarray:
    """Return the rest pose at the cloud: equal top of the head, middle of the body behind the surface."""
    points, pose = view.cloud.points, np.zeros(skeleton.POSE_SIZE)
    top, middle = np.percentile(points[:, 1], 99.8), np.median(points, axis=0)
    behind = 0.1  # distance from the surface to the middle of the body, metres
    pose[skeleton.ROOT_POSITION] = middle[0], top - body.vertices[:, 1].max(), middle[2] - behind
    pose[skeleton.ROOT_ROTATION] = 0.0, view.yaw, 0.0
    return pose


def _offsets(placed: Sequence[PlacedBody], clouds: Sequence[Cloud]) -> tuple[np.ndarray, np.ndarray]:
    """Return the signed distance of the surface from each vertex, metres (V,), and its weight, 0 = not measured."""
    total, weight = (np.zeros(len(placed[0].vertices)) for _ in range(2))
    reach = 0.04  # maximum distance of a measured point along the normal of its vertex, metres
    facing = 0.5  # minimum cosine between normal and ray of a well measured vertex
    for one, cloud in zip(placed, clouds, strict=True):
        vertices, normals = one.vertices, one.normals
        rays = vertices / np.sqrt((vertices * vertices).sum(axis=1, keepdims=True))
        cosine = -(normals * rays).sum(axis=1)
        pixels = np.rint(cloud.camera.project(vertices)).astype(np.int64)
        inside = ((pixels >= 0) & (pixels < (cloud.camera.width, cloud.camera.height))).all(axis=1)
        u, v = np.where(inside[:, None], pixels, 0).T
        z = np.where(inside, cloud.depth[v, u], 0.0).astype(np.float64)
        at = np.stack([(u - cloud.camera.cx) * z / cloud.camera.fx, (v - cloud.camera.cy) * z / cloud.camera.fy, z], 1)
        outward = (normals * (at - vertices)).sum(axis=1)
        use = (z > 0) & (cosine > facing) & (np.abs(outward) < reach)
        total += np.where(use, cosine * outward, 0.0)
        weight += np.where(use, cosine, 0.0)
    return np.where(weight > 0, total / np.maximum(weight, 1e-9), 0.0), weight


def _spread(measured: np.ndarray, weight: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return smooth offsets (V,) close to the measured ones, 0 in unmeasured regions, at most 3 cm."""
    ends = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    count = np.bincount(ends.ravel(), minlength=len(measured))
    smooth = np.where(weight > 0, measured, 0.0)
    stiffness = 1.0  # smoothing weight of a vertex's neighbours relative to one measurement
    sweeps = 100  # number of smoothing passes over all vertices
    largest_offset = 0.03  # metres
    for _ in range(sweeps):
        around = np.zeros(len(measured))
        np.add.at(around, ends[:, 0], smooth[ends[:, 1]])
        np.add.at(around, ends[:, 1], smooth[ends[:, 0]])
        smooth = (weight * measured + stiffness * around) / (weight + stiffness * np.maximum(count, 1))
        smooth = np.where(weight > 0, np.clip(smooth, -largest_offset, largest_offset), 0.0)
    return smooth
