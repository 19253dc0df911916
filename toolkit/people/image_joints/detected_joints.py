"""Joints of sightings, detected in the colour image or in a shaded picture of the depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.people.image_joints.joint_formats import POSE_MODEL, reported_rows
from toolkit.people.image_joints.pose_model import CENTRE, LEAST_PRESENCE, UPWARD, Crop, Landmarks, PoseModel
from toolkit.people.joint_masks import LEAST_SHARE, on_cut_out
from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D, same_rays
from toolkit.sensing.stream import Frame

ENLARGED = 3
"""Enlargement of the picture against the depth image: its contours are smooth as in a photograph."""
GREY = 120.0
"""Grey value of the background."""
KEY = np.array([-0.48, -0.64, -0.6])
"""Direction towards the light, camera frame."""


def shaded(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Shade a person's depth, float32 (H, W), metres, 0 elsewhere: uint8 (3H, 3W, 3), RGB, on grey.

    Pixels keep their areas: pixel u of the depth image is around 3u + 1 in the picture.
    """
    height, width = depth.shape
    picture = np.full((ENLARGED * height, ENLARGED * width, 3), int(GREY), dtype=np.uint8)
    rows, columns = np.flatnonzero(depth.any(axis=1)), np.flatnonzero(depth.any(axis=0))
    if not len(rows):
        return picture
    box, large = [], []
    border = 4  # pixels around a person that are shaded too: the enlarged contour needs two
    for there, size in ((rows, height), (columns, width)):
        first, last = max(int(there[0]) - border, 0), min(int(there[-1]) + border + 1, size)
        box.append(slice(first, last))
        large.append(slice(ENLARGED * first, ENLARGED * last))
    slopes = np.concatenate([camera.rays(), np.ones((*camera.shape, 1))], axis=-1)
    picture[tuple(large)] = lit(depth[tuple(box)], slopes[tuple(box)])
    return picture


def lit(depth: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Shade any part of an image as `shaded`; `slopes` (H, W, 3) are the rays of its pixels with z = 1."""
    import cv2

    mask = (depth > 0).astype(np.float32)
    smoothed = 5  # side of the window, pixels, over which depth is averaged before normals are computed
    window = (smoothed, smoothed)
    share = cv2.blur(mask, window, borderType=cv2.BORDER_CONSTANT)
    smooth = np.where(mask > 0, cv2.blur(depth, window, borderType=cv2.BORDER_CONSTANT) / np.maximum(share, 1e-6), 0.0)
    normals = _normals(smooth, mask > 0, slopes)
    from_head = -(normals * slopes).sum(axis=-1) / np.sqrt((slopes * slopes).sum(axis=-1))
    from_key = (normals * KEY).sum(axis=-1)
    # Fractions of ambient light, light from the camera, and light from above left.
    ambient, head_light, key_light = 0.35, 0.4, 0.35
    light = ambient + head_light * np.maximum(from_head, 0.0) + key_light * np.maximum(from_key, 0.0)
    skin = (224.0, 172.0, 138.0)
    picture = np.where(mask[..., None] > 0, np.array(skin) * light[..., None], GREY)
    size = (ENLARGED * depth.shape[1], ENLARGED * depth.shape[0])
    large = cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_CUBIC)
    return np.clip(np.rint(large), 0, 255).astype(np.uint8)


def _normals(depth: np.ndarray, mask: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return unit normals towards the camera (H, W, 3) of the surface."""
    points = slopes * depth[..., None]
    across, down = _difference(points, mask, 1), _difference(points, mask, 0)
    normals = np.cross(down, across)
    length = np.sqrt((normals * normals).sum(axis=-1, keepdims=True))
    away = slopes / np.sqrt((slopes * slopes).sum(axis=-1, keepdims=True))
    return np.where(length > 0, normals / np.maximum(length, 1e-12), -away)


def _difference(points: np.ndarray, mask: np.ndarray, axis: int) -> np.ndarray:
    """Return differences of neighbours along one axis, central where both exist, else one-sided; else 0."""
    after, before = np.roll(points, -1, axis), np.roll(points, 1, axis)
    has_after, has_before = np.roll(mask, -1, axis), np.roll(mask, 1, axis)
    edge: list[slice | int] = [slice(None), slice(None)]
    edge[axis] = -1
    has_after[tuple(edge)] = False
    edge[axis] = 0
    has_before[tuple(edge)] = False
    ahead = np.where(has_after[..., None], after, points)
    behind = np.where(has_before[..., None], before, points)
    return np.where(mask[..., None], ahead - behind, 0.0)


class DetectedJoints:
    """Detector of each person's joints by a network, in a crop that follows the person; see `JointSource`.

    A new person, or one whose crop was lost, is detected twice: in a crop around the silhouette, and in the crop of the
    points found there.

    Parameters
    ----------
    model : finds the points in a crop
    camera : camera of the frames, lens distortion included
    in_color : in the colour images; otherwise in the shaded depth
    """

    CHECKPOINT: tuple[str, ...] = ("_crops",)
    _crops: dict[int, Crop]

    def __init__(self, model: PoseModel, camera: Camera, *, in_color: bool) -> None:
        self._model, self._camera, self.needs_color = model, camera, in_color
        self.name = "colour" if in_color else "depth"
        self._crops = {}

    def add(self, frame: Frame, sightings: Sequence[Sighting]) -> tuple[Sighting, ...]:
        """Add detected joints, see `JointSource.add`."""
        return tuple(replace(s, joints=self._joints(frame, s)) for s in sightings)

    def _joints(self, frame: Frame, sighting: Sighting) -> Joints2D | None:
        if not sighting.depth.any():
            self._crops.pop(sighting.id, None)
            return None
        picture, scale = self._picture(frame, sighting)
        crop = self._crops.pop(sighting.id, None)
        joints = None
        if crop is not None:
            joints = self._found(self._model.find(picture, crop.scaled(scale)), sighting, scale)
        if joints is None:
            first = self._around(sighting).scaled(scale)
            rough = self._model.find(picture, first)
            again = Crop.of_points(rough.points[CENTRE], rough.points[UPWARD])
            joints = self._found(self._model.find(picture, again), sighting, scale)
        return joints

    def _picture(self, frame: Frame, sighting: Sighting) -> tuple[np.ndarray, float]:
        """Return the picture, and its scale against the raw frame, or without colour, the sighting."""
        if not self.needs_color:
            return shaded(sighting.depth, sighting.camera), float(ENLARGED)
        color, camera = frame.color, self._camera
        if color is None:
            raise RecordingError("a frame has no colour to find joints in; use --joints depth or --joints none")
        height, width = color.shape[:2]
        scale = width / camera.width
        aspect = 0.01  # maximum relative difference of width and height between the scales of colour and depth
        if abs(height / camera.height - scale) > aspect * scale:
            raise RecordingError(
                f"colour of {width}x{height} does not show what depth of {camera.width}x{camera.height} shows; "
                "register it to the depth, or use --joints depth"
            )
        return color, scale

    def _around(self, sighting: Sighting) -> Crop:
        """Return the crop around a silhouette, in pixels of the raw frame, or without colour, of the sighting."""
        crop = Crop.around(sighting.depth > 0)
        if not self.needs_color:
            return crop
        raw, flat = self._camera, sighting.camera
        (u, v), (edge, _) = same_rays(np.array([[crop.u, crop.v], [crop.u + crop.side, crop.v]]), flat, raw)
        return Crop(float(u), float(v), float(edge - u), 0.0)

    def _found(self, seen: Landmarks, sighting: Sighting, scale: float) -> Joints2D | None:
        """Return the person's joints and store the crop; None if the network detects no person or another one."""
        if seen.presence < LEAST_PRESENCE:
            return None
        pixels = (seen.points + 0.5) / scale - 0.5
        crop = Crop.of_points(pixels[CENTRE], pixels[UPWARD])
        if self.needs_color:
            pixels = same_rays(pixels, self._camera, sighting.camera)
        found = np.concatenate([pixels, seen.visibility[:, None]], axis=1)
        joints = Joints2D.of_rows(reported_rows(found, POSE_MODEL))
        if on_cut_out(joints, sighting.depth).sum() < LEAST_SHARE * joints.sure.sum() or crop.side < 1.0:
            return None
        self._crops[sighting.id] = crop
        return joints
