"""Joints of sightings, detected in the colour or shaded depth image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from toolkit.io.archives import Column
from toolkit.io.checkpoint import check_state
from toolkit.io.errors import RecordingError
from toolkit.people.image_joints.joint_formats import POSE_MODEL, reported_rows
from toolkit.people.image_joints.pose_model import CENTRE, LEAST_PRESENCE, UPWARD, Crop, Landmarks, PoseModel
from toolkit.people.image_joints.shaded import ENLARGED, shaded
from toolkit.people.joint_masks import LEAST_SHARE, on_cut_out
from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D, same_rays
from toolkit.sensing.stream import Frame


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

    def __init__(self, model: PoseModel, camera: Camera, *, in_color: bool) -> None:
        self._model, self._camera, self.needs_color = model, camera, in_color
        self.name = "colour" if in_color else "depth"
        self._crops: dict[int, Crop] = {}

    def add(self, frame: Frame, sightings: Sequence[Sighting]) -> tuple[Sighting, ...]:
        """Add detected joints, see `JointSource.add`."""
        return tuple(replace(s, joints=self._joints(frame, s)) for s in sightings)

    def export_state(self) -> dict[str, Any]:
        """Return the crops, see `JointSource.export_state`."""
        return {str(person): np.array(crop) for person, crop in self._crops.items()}

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Restore the crops, see `JointSource.restore_state`."""
        crop = Column("f", (len(Crop._fields),), -1e6, 1e6)
        check_state(state, dict.fromkeys(state if isinstance(state, Mapping) else (), crop), what="joint detector")
        self._crops = {int(person): Crop(*map(float, crop)) for person, crop in state.items()}

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
