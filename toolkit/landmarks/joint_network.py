"""Joints of one person in a depth image, by a small network.

The step that Baak 2013, 5.5.5 leaves open. A crop of 96 x 96 pixels of 25 mm around the person goes through a residual
network with anchors (A2J, Xiong 2019); `docs/models.md` describes its training and its errors, `training/` holds the
scripts. Its sums are exact (`toolkit.sensing.exact_network`), so that the joints are the same to the bit everywhere.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.kernels import linear
from toolkit.kernels.learning import joint_crop
from toolkit.sensing.cloud import Cloud, window_of
from toolkit.sensing.exact_network import ExactNetwork
from toolkit.sensing.sensing_settings import SensingSettings

ASSET = Path(__file__).parent / "assets" / "joints.onnx"
SIZE, STRIDE = 96, 8
"""Side of the crop and distance between its anchors, pixels."""
RELIABLE_WITHIN = 0.1
"""Error below which a joint counts as right, metres."""

_ARMS = [
    row for row, name in enumerate(skeleton.REPORTED) if name.split("_")[-1] in ("shoulder", "elbow", "wrist", "hand")
]
_LEGS = [row for row, name in enumerate(skeleton.REPORTED) if name.split("_")[-1] in ("hip", "knee", "ankle", "foot")]
PAIRS: tuple[np.ndarray, np.ndarray] = (np.array(_ARMS), np.array(_LEGS))
"""Rows of the joints of the arms and of the legs, in which the network may exchange left and right."""
OPPOSITE: np.ndarray = np.array(
    [
        skeleton.REPORTED.index({"left": "right_", "right": "left_"}.get(side, side) + rest)
        for side, _, rest in (name.partition("_") for name in skeleton.REPORTED)
    ]
)
"""Row of each joint's counterpart on the other side."""


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """Joints of a person, estimated by the network from one frame.

    Attributes
    ----------
    points : float64 (20, 3), metres, level frame
    confidence : float64 (20,), 0 to 1: weight of a squared distance, the inverse square of the error to expect
    in_view : float64 (20,), 0 to 1: probability that the joint is inside the image with nothing foreign before it
    reliability : float64 (20,), 0 to 1: probability that the joint is within 10 cm and on its own side
    """

    points: np.ndarray
    confidence: np.ndarray
    in_view: np.ndarray = field(default_factory=lambda: np.ones(len(skeleton.REPORTED)))
    reliability: np.ndarray = field(default_factory=lambda: np.ones(len(skeleton.REPORTED)))


class JointNetwork:
    """Joint network of the package, or of another file."""

    def __init__(self, path: Path = ASSET) -> None:
        side = SIZE // STRIDE
        self._anchors = (5 * len(skeleton.REPORTED), side, side)
        self._net = ExactNetwork(path, (1, 3, SIZE, SIZE), ("anchors", "sides"))
        self._estimates: dict[bytes, JointEstimate] = {}

    def estimate(self, cloud: Cloud, unobserved: np.ndarray | None = None) -> JointEstimate:
        """Estimate the joints of a person whose points are `cloud`, or return the earlier estimate of the same input.

        `unobserved` bool (H, W) are the pixels of the cloud's image in which something nearer hides what is there,
        where that is known. The image's border needs no mention.
        """
        own = cloud.depth.take(cloud.pixels)
        hidden = None if unobserved is None else np.packbits(unobserved)
        key = _digest(cloud.pixels, own, np.array(cloud.camera.intrinsics), cloud.rotation, hidden)
        known = self._estimates.get(key)
        # Estimates that are kept, 2 kB each; body estimation, first and second pass read many frames again.
        remembered = 4096
        if known is None:
            if len(self._estimates) >= remembered:
                del self._estimates[next(iter(self._estimates))]
            known = self._estimates[key] = self._estimated(cloud, unobserved)
        return known

    def _estimated(self, cloud: Cloud, unobserved: np.ndarray | None) -> JointEstimate:
        depth, rotation = without_specks(cloud), cloud.rotation
        fx, fy, cx, cy = cloud.camera.intrinsics
        own = depth.take(cloud.pixels)
        rows, columns = np.divmod(cloud.pixels[own > 0.0], depth.shape[1])
        reference = float(np.median(own[own > 0.0]))
        middle = np.array([(np.median(columns) - cx) / fx, (np.median(rows) - cy) / fy, reference])
        down = _down(rotation)
        unknown = np.zeros((0, 0), dtype=np.bool_) if unobserved is None else np.ascontiguousarray(unobserved)
        crop = np.empty((3, SIZE, SIZE), dtype=np.float32)
        pixel = 0.025  # size of a pixel of the crop in metres, at the person's median depth
        joint_crop.crop(depth, unknown, cloud.camera.intrinsics, middle, down, pixel, crop)
        anchors, logits = self._net.run(crop[None])

        places, scales = np.empty((len(skeleton.REPORTED), 3)), np.empty(len(skeleton.REPORTED))
        joint_crop.joints_of_anchors(anchors.reshape(self._anchors), STRIDE * pixel, places, scales)
        sides = np.array([1.0 / (1.0 + joint_crop.exponential(-abs(float(logit)))) for logit in logits.ravel()])
        order = np.arange(len(OPPOSITE))
        for limb, logit in zip(PAIRS, logits.ravel(), strict=True):
            if logit < 0.0:
                order[limb] = OPPOSITE[limb]
        places, scales = places[order], scales[order]
        across = places[:, 0] * down[1] + places[:, 1] * down[0]
        along = places[:, 1] * down[1] - places[:, 0] * down[0]
        z = np.maximum(places[:, 2] + reference, pixel)
        x, y = middle[0] + across / reference, middle[1] + along / reference
        camera = np.stack([x * z, y * z, z], axis=1)
        # Scale on real frames against the network's own, and metres of it that add: 62 % of an earlier network's errors
        # lay within it on UTD-MHAD, 60 % on MSR Action3D (63 % of an exponential distribution); see `docs/models.md`.
        real_factor, real_floor = 1.4, 0.05
        scale = np.sqrt((real_factor * scales) ** 2 + real_floor**2)
        pixels = np.stack([x * fx + cx, y * fy + cy], axis=1)
        in_view = _in_view(pixels, z / fx, scale, depth.shape, unobserved)
        points, confidence = linear.rotated(camera, rotation.T), (real_floor / scale) ** 2
        return JointEstimate(points, confidence, in_view, _reliability(scale, sides))


@cache
def joint_network() -> JointNetwork:
    """Load the network of the package once.

    Raises
    ------
    ModelError
        The installed OpenCV cannot run it.
    """
    return JointNetwork()


def without_specks(cloud: Cloud) -> np.ndarray:
    """Return a person's depth image, float32 (H, W), metres, without small surfaces far behind the person.

    Stereo cameras measure specks between a person and the background. The network was trained without them and confuses
    front and back if they are there. Nearer small surfaces are kept, because they may be parts of limbs.
    """
    import cv2

    depth, own = cloud.depth, cloud.depth.take(cloud.pixels)
    mean = float(own.mean(dtype=np.float64)) if own.size else 0.0
    area, behind = 0.01, 0.3  # m^2; metres behind the mean depth
    if not (own > mean + behind).any():
        return depth
    pixel = mean / math.sqrt(cloud.camera.fx * cloud.camera.fy)
    window = window_of(depth)
    # Metres between neighbouring pixels of one surface: as for its contour, and a slope of 2.
    step = SensingSettings.contour_tolerance + SensingSettings.quantisation * mean**2 + 2.0 * pixel
    millimetres = np.minimum(np.rint(1000.0 * depth[window]), np.iinfo(np.int16).max).astype(np.int16)
    cv2.filterSpeckles(millimetres, 0.0, int(area / pixel**2), 1000.0 * step)
    cleaned = depth.copy()
    cleaned[window][(depth[window] > mean + behind) & (millimetres == 0)] = 0.0
    return cleaned


def _digest(*arrays: np.ndarray | None) -> bytes:
    """Return a digest of the shapes and values of arrays."""
    digest = hashlib.blake2b(digest_size=16)
    for array in arrays:
        if array is not None:
            digest.update(repr(array.shape).encode())
            digest.update(np.ascontiguousarray(array).data)
    return digest.digest()


def _down(rotation: np.ndarray) -> np.ndarray:
    """Return the image direction (2,) that points downwards, of `R_level_camera`; (0, 1) for a camera without roll."""
    down = -rotation[1, :2]
    length = float(np.hypot(down[0], down[1]))
    # Length of the vertical in the image plane below which a camera looks up or down so steeply that it has no roll.
    steepest = 0.3
    return np.array([0.0, 1.0]) if length < steepest else down / length


def _reliability(scale: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """Return the probability (20,) that joints are right, by scale (20,) and the probability (2,) of the sides.

    It is 1 - exp(-steepness (RELIABLE_WITHIN / scale)**1.5), fitted between 800 held-out simulated crops and UTD-MHAD
    without the mean offset of each joint, see `docs/models.md`.
    """
    ratio = RELIABLE_WITHIN / scale
    steepness = 1.4
    near = 1.0 - np.array([joint_crop.exponential(-steepness * r * math.sqrt(r)) for r in ratio])
    for rows, side in zip(PAIRS, sides, strict=True):
        near[rows] *= side
    return near


def _in_view(
    pixels: np.ndarray, metres: np.ndarray, scale: np.ndarray, shape: tuple[int, ...], unobserved: np.ndarray | None
) -> np.ndarray:
    """Return the probability (N,) that joints at `pixels` (N, 2), `metres` (N,) a pixel, are in view."""
    limits = np.array([shape[1], shape[0]]) - 0.5
    inside = np.minimum(pixels + 0.5, limits - pixels).min(axis=1) * metres
    view_margin = 0.5  # scales of a joint inside the image at which it is in view with probability 1 / (1 + 1/e)
    odds = np.clip(inside / (view_margin * scale), -20.0, 20.0)
    chance = np.array([1.0 / (1.0 + joint_crop.exponential(-value)) for value in odds])
    if unobserved is not None:
        u, v = np.clip(np.rint(pixels), 0, limits - 0.5).astype(np.int64).T
        chance = np.where(unobserved[v, u], 0.0, chance)
    return chance
