"""Source of the image joints: files, the recording, or the pose network."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from toolkit.io.errors import RecordingError, UsageError
from toolkit.people.joint_masks import GivenJoints, JointSource, NoJoints
from toolkit.recordings.joint_files import read_joints
from toolkit.sensing.recording import Recording

AUTO, COLOUR, DEPTH, NONE = "auto", "colour", "depth", "none"
"""Names of sources; any other text is the path of a folder."""


@dataclass(frozen=True)
class JointChoice:
    """Choice of the source of image joints.

    Attributes
    ----------
    source : "colour" or "depth" runs the pose network on the colour or the shaded depth images, "none" uses no joints,
        any other text is a folder of OpenPose JSON. "auto" uses the joints of the recording, else its colour, else its
        depth (but runs no network for a tracker with `joints_wanted` "offered")
    size : width and height of the images in which the joints of a folder were found; default: those of the depth
    """

    source: str | Path = AUTO
    size: tuple[int, int] | None = None

    @property
    def folder(self) -> Path | None:
        """Return the folder, or None for another source."""
        return None if str(self.source) in (AUTO, COLOUR, DEPTH, NONE) else Path(self.source)

    def check(self, recordings: int = 1) -> None:
        """Raise UsageError for a size without a folder, or a folder for several recordings."""
        if self.folder is not None and recordings > 1:
            raise UsageError(f"the joints in {self.folder} belong to one recording, not to {recordings}")
        if self.size is not None and self.folder is None:
            raise UsageError("--joints-size belongs to a folder of joints; name it with --joints, or leave it out")


def give_joints(recording: Recording, choice: JointChoice) -> None:
    """Attach the joints of the chosen folder to the recording.

    Raises
    ------
    RecordingError
        See `read_joints`.
    """
    choice.check()
    if choice.folder is not None:
        rows = read_joints(choice.folder, recording.stored_frames, recording.raw_camera, choice.size)
        recording.give_joints_2d(rows)


def joint_source(recording: Recording, choice: JointChoice, wanted: str) -> JointSource:
    """Return the object that adds joints to the people of a recording, or None.

    Parameters
    ----------
    recording : after `give_joints`
    choice : option of the user
    wanted : use of joints by the tracker, see `Tracker.joints_wanted`

    Raises
    ------
    UsageError
        Joints were requested for a tracker without joint input.
    RecordingError
        Joints in colour were requested for a recording without colour.
    ModelError
        The pose network is needed and cannot be loaded, see `PoseModel`.
    """
    source = str(choice.source)
    if wanted == "none" and source not in (AUTO, NONE):
        raise UsageError("this tracker uses no joints in the image; leave --joints out, or choose --config swarm")
    if wanted == "none" or source == NONE:
        return NoJoints()
    if source not in (COLOUR, DEPTH) and recording.image_joints is not None:
        return GivenJoints(recording.camera)
    if wanted == "offered" and source == AUTO:
        return NoJoints()
    has_color = recording.has_color
    if source == COLOUR and not has_color:
        raise RecordingError(f"{recording.path} has no colour; use --joints depth, a folder of OpenPose JSON, or none")
    from toolkit.people.image_joints.detected_joints import DetectedJoints
    from toolkit.people.image_joints.pose_model import PoseModel

    return DetectedJoints(PoseModel.load(), recording.camera, in_color=has_color and source != DEPTH)


def name_of(source: JointSource, recording: Recording) -> str:
    """Return the entry of `run.json`: the kind of source, and the digest of given joints."""
    if isinstance(source, GivenJoints) and recording.image_joints is not None:
        return f"given {hashlib.sha256(recording.image_joints.tobytes()).hexdigest()}"
    return source.name
