"""Assignment of detected image joints to the sightings of a frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D, same_rays
from toolkit.sensing.stream import Frame

LEAST_SHARE = 0.3
"""Minimum fraction of the sure joints on a mask."""


class JointSource(Protocol):
    """Source of image joints for sightings.

    Attributes
    ----------
    CHECKPOINT : attributes on which the next frame depends, see `toolkit.io.checkpoint`
    name : name in `run.json`
    needs_color : True if frames must hold colour
    """

    CHECKPOINT: tuple[str, ...]
    name: str
    needs_color: bool

    def add(self, frame: Frame, sightings: Sequence[Sighting]) -> tuple[Sighting, ...]:
        """Return the sightings of the next frame with their joints."""
        ...


class NoJoints:
    """Source without joints."""

    CHECKPOINT: tuple[str, ...] = ()
    name = "none"
    needs_color = False

    def add(self, frame: Frame, sightings: Sequence[Sighting]) -> tuple[Sighting, ...]:
        """Return the sightings unchanged, see `JointSource.add`."""
        return tuple(sightings)


class GivenJoints(NoJoints):
    """Source of joints that the frames hold.

    Each detected person goes to the sighting whose mask holds most of the sure joints, the clearest case first; ties
    go to the first in both orders.

    Parameters
    ----------
    camera : camera of the frames, lens distortion included
    """

    name = "given"

    def __init__(self, camera: Camera) -> None:
        self._camera = camera

    def add(self, frame: Frame, sightings: Sequence[Sighting]) -> tuple[Sighting, ...]:
        """Add the joints of the frame, see `JointSource.add`."""
        if not frame.joints or not sightings:
            return tuple(sightings)
        seen = [self._seen_by(joints, sightings[0].camera) for joints in frame.joints]
        claims = np.array([[on_cut_out(joints, s.depth).sum() for joints in seen] for s in sightings])
        sure = np.array([np.count_nonzero(joints.sure) for joints in seen])
        claims[claims < LEAST_SHARE * sure] = 0
        with_joints = list(sightings)
        while claims.any():
            i, k = divmod(int(np.argmax(claims)), claims.shape[1])
            with_joints[i] = replace(sightings[i], joints=seen[k])
            claims[i], claims[:, k] = 0, 0
        return tuple(with_joints)

    def _seen_by(self, joints: Joints2D, flat: Camera) -> Joints2D:
        """Convert to pixels of the sightings; joints outside the image are unknown."""
        rows = np.concatenate([same_rays(joints.pixels, self._camera, flat), joints.confidence[:, None]], axis=1)
        u, v = rows[:, 0], rows[:, 1]
        inside = (u >= -0.5) & (u <= flat.width - 0.5) & (v >= -0.5) & (v <= flat.height - 0.5)
        rows[~inside] = np.nan
        return Joints2D.of_rows(rows)


def on_cut_out(joints: Joints2D, depth: np.ndarray) -> np.ndarray:
    """Return the sure joints that lie on a person's depth (H, W), or close beside it: bool (20,)."""
    found = np.zeros(len(joints.sure), dtype=np.bool_)
    reach = 2  # maximum pixels beside a mask: its contour is deleted, and joints are inexact
    for joint in np.flatnonzero(joints.sure):
        u, v = np.rint(joints.pixels[joint]).astype(np.int64)
        rows, columns = slice(max(v - reach, 0), v + reach + 1), slice(max(u - reach, 0), u + reach + 1)
        found[joint] = depth[rows, columns].any()
    return found
