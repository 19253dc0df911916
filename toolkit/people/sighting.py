"""Interface of a people finder: sightings out, predicted bodies in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

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
    depth : float32 (H, W), metres along z, cleaned: depth of the person alone, 0 elsewhere; a new array
    unobserved : bool (H, W), unobserved pixels: no measurement there, or something nearer that is not the person. None
        where every pixel is observed. Everything outside the image is unobserved as well
    camera : camera of that depth, without lens distortion
    joints : the person's joints in the image, in pixels of `depth`, or None without a source of joints
    """

    id: int
    depth: np.ndarray
    unobserved: np.ndarray | None
    camera: Camera
    joints: Joints2D | None = None


@dataclass(frozen=True, eq=False)
class PredictedBody:
    """Expected body of a tracked person in the next frame.

    Attributes
    ----------
    vertices : float64 (V, 3), metres, camera frame
    faces : int32 (F, 3)
    stature : metres
    head : float64 (3,), metres, camera frame, centre of the head; None where the body is not verified
    """

    vertices: np.ndarray
    faces: np.ndarray
    stature: float
    head: np.ndarray | None = None


class PeopleFinder(Protocol):
    """Finder of the people in the frames of one stream, in order.

    Attributes
    ----------
    CHECKPOINT : attributes on which the next frame depends, see `toolkit.io.checkpoint`
    camera : camera of every sighting
    evidence : track id -> evidence that the track is a person; empty where all tracks are people
    """

    CHECKPOINT: tuple[str, ...]
    camera: Camera

    @property
    def evidence(self) -> Mapping[int, Evidence]:
        """Return the evidence by track id."""
        ...

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        """Find the people in the next frame, each once, by rising id.

        Parameters
        ----------
        depth_mm : uint16 (H, W), millimetres along z, 0 = no measurement
        timestamp : seconds
        predicted : the people followed so far, by id
        """
        ...

    def redetect(self) -> PeopleFinder | None:
        """Return a stateless finder of all people in the stream; None where the settings select one person."""
        ...


class WrappedFinder:
    """Part of a `PeopleFinder` that has the state of another finder of the same stream."""

    CHECKPOINT: tuple[str, ...] = ("_finder",)
    _finder: PeopleFinder

    def redetect(self) -> PeopleFinder | None:
        """See `PeopleFinder.redetect`."""
        return self._finder.redetect()
