"""Whose joints are whose: from what a detector found in the image to the sightings of a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from toolkit.io.checkpoint import check_state
from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D, same_rays
from toolkit.sensing.stream import Frame

REACH = 2
"""Pixels beside a cut-out that still count as on it: its contour is deleted, and joints are seldom exact."""
LEAST_SHARE = 0.3
"""Share of the sure joints that have to lie on a cut-out; with fewer they are another person's."""


class JointSource(Protocol):
    """Adds joints in the image to the people who were found.

    Attributes
    ----------
    name : what `run.json` says of it
    needs_color : whether frames have to bring their colour
    """

    name: str
    needs_color: bool

    def add(self, frame: Frame, sightings: Sequence[Sighting]) -> tuple[Sighting, ...]:
        """The sightings of the next frame with the joints that are known of them."""
        ...

    def export_state(self) -> dict[str, Any]:
        """All that the next frame depends on, see `PeopleFinder.export_state`."""
        ...

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `export_state` gave."""
        ...


class NoJoints:
    """A source without joints."""

    name = "none"
    needs_color = False

    def add(self, frame: Frame, sightings: Sequence[Sighting]) -> tuple[Sighting, ...]:
        """See `JointSource.add`."""
        return tuple(sightings)

    def export_state(self) -> dict[str, Any]:
        """See `JointSource.export_state`."""
        return {}

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """See `JointSource.restore_state`."""
        check_state(state, {}, what="joints")


class GivenJoints(NoJoints):
    """Joints that the frames bring with them.

    Each person of a detector goes to the sighting on whose cut-out most of their sure joints lie, the clearest case
    first; of equal claims the first in both orders counts.

    Parameters
    ----------
    camera : of the frames, lens distortion included
    """

    name = "given"

    def __init__(self, camera: Camera) -> None:
        self._camera = camera

    def add(self, frame: Frame, sightings: Sequence[Sighting]) -> tuple[Sighting, ...]:
        """See `JointSource.add`."""
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
        """In pixels of the sightings; what lies outside the image is unknown."""
        rows = np.concatenate([same_rays(joints.pixels, self._camera, flat), joints.confidence[:, None]], axis=1)
        u, v = rows[:, 0], rows[:, 1]
        inside = (u >= -0.5) & (u <= flat.width - 0.5) & (v >= -0.5) & (v <= flat.height - 0.5)
        rows[~inside] = np.nan
        return Joints2D.of_rows(rows)


def on_cut_out(joints: Joints2D, depth: np.ndarray) -> np.ndarray:
    """Which of the sure joints lie on a person's depth (H, W), or close beside it: bool (20,)."""
    found = np.zeros(len(joints.sure), dtype=np.bool_)
    for joint in np.flatnonzero(joints.sure):
        u, v = np.rint(joints.pixels[joint]).astype(np.int64)
        rows, columns = slice(max(v - REACH, 0), v + REACH + 1), slice(max(u - REACH, 0), u + REACH + 1)
        found[joint] = depth[rows, columns].any()
    return found
