"""What a people finder is told and what it says; one person, already cut out, is the simplest case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from toolkit.people.evidence import Evidence
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D


@dataclass(frozen=True, eq=False)
class Sighting:
    """One person in one frame.

    Attributes
    ----------
    id : 1, 2, ... in order of appearance, the same for the same person over a recording
    depth : float32 (H, W), metres along z, cleaned: the person's own depth, 0 elsewhere. A new array
    unobserved : bool (H, W), pixels that say nothing about the person: nothing was measured there, or something nearer
        that is not the person. None where every pixel of the image says something. Whatever lies outside the image is
        unobserved as well
    camera : of that depth, without lens distortion
    joints : the person's joints in the image, in pixels of `depth`, or None without a source of joints
    """

    id: int
    depth: np.ndarray
    unobserved: np.ndarray | None
    camera: Camera
    joints: Joints2D | None = None


@dataclass(frozen=True, eq=False)
class PredictedBody:
    """Where a followed person is expected in the next frame.

    Attributes
    ----------
    vertices : float64 (V, 3), metres, camera frame
    faces : int32 (F, 3)
    stature : metres
    head : float64 (3,), metres, camera frame, the middle of the head; None where the body is not known to be right
    """

    vertices: np.ndarray
    faces: np.ndarray
    stature: float
    head: np.ndarray | None = None


class PeopleFinder(Protocol):
    """Finds the people in the frames of one stream, in order.

    Attributes
    ----------
    camera : of every sighting
    evidence : by id, of each track whether it is a person; empty where all tracks are people
    """

    camera: Camera

    @property
    def evidence(self) -> Mapping[int, Evidence]:
        """See above."""
        ...

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        """The people in the next frame, each once, by rising id.

        Parameters
        ----------
        depth_mm : uint16 (H, W), millimetres along z, 0 = no measurement
        timestamp : seconds
        predicted : the people followed so far, by id
        """
        ...

    def redetect(self) -> PeopleFinder | None:
        """A finder of all people in the stream that has seen nobody yet; None where the settings cut one person out."""
        ...

    def export_state(self) -> dict[str, Any]:
        """All that the next frame depends on: arrays, numbers and text by name, nested; fit for `checkpoint`."""
        ...

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `export_state` of a finder of the same stream and settings gave."""
        ...
