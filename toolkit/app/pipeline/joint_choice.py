"""Where the joints in the image come from: files, the recording, or a detector."""

from __future__ import annotations

import hashlib
import logging
from dataclasses import dataclass
from pathlib import Path

from toolkit.io.errors import ModelError, RecordingError, UsageError
from toolkit.people.joint_masks import GivenJoints, JointSource, NoJoints
from toolkit.recordings.joint_files import read_joints
from toolkit.sensing.recording import Recording

AUTO, COLOUR, DEPTH, NONE = "auto", "colour", "depth", "none"
"""Words for sources; whatever else is named is a folder."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class JointChoice:
    """Where joints are to come from.

    Attributes
    ----------
    source : "colour" or "depth" detects them in the colour or in the shaded depth images, "none" goes without, anything
        else is a folder of OpenPose JSON. "auto" takes those that the recording holds, else its colour, else its depth
        (a tracker to which they are "offered" has none detected unless the user says where)
    size : width and height of the images in which the joints of a folder were found, if they are not the depth's
    """

    source: str | Path = AUTO
    size: tuple[int, int] | None = None

    @property
    def folder(self) -> Path | None:
        """The folder, if it is one."""
        return None if str(self.source) in (AUTO, COLOUR, DEPTH, NONE) else Path(self.source)

    def check(self, recordings: int = 1) -> None:
        """Raise UsageError for a size without a folder, or a folder for several recordings."""
        if self.folder is not None and recordings > 1:
            raise UsageError(f"the joints in {self.folder} belong to one recording, not to {recordings}")
        if self.size is not None and self.folder is None:
            raise UsageError("--joints-size belongs to a folder of joints; name it with --joints, or leave it out")


def give_joints(recording: Recording, choice: JointChoice) -> None:
    """Read the joints of a folder, if one is chosen, into the recording.

    Raises
    ------
    RecordingError
        See `read_joints`.
    """
    choice.check()
    if choice.folder is not None:
        rows = read_joints(choice.folder, len(recording), recording.raw_camera, choice.size)
        recording.give_joints_2d(rows)


def joint_source(recording: Recording, choice: JointChoice, wanted: str) -> JointSource:
    """What adds joints to the people of a recording.

    Parameters
    ----------
    recording : after `give_joints`
    choice : what the user said
    wanted : what the tracker does with them, see `Tracker.joints_wanted`

    Raises
    ------
    UsageError
        Joints were asked for and the tracker has no use for them.
    RecordingError
        Joints are to be detected in the colour of a recording that has none.
    ModelError
        The detector is needed and cannot be used, see `PoseModel`.
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

    try:
        return DetectedJoints(PoseModel.load(), recording.camera, in_color=has_color and source != DEPTH)
    except ModelError as error:
        if source == AUTO and wanted == "welcome":
            logger.info("%s: no joints in the image: %s", recording.name, error)
            return NoJoints()
        raise


def name_of(source: JointSource, recording: Recording) -> str:
    """What `run.json` says: the kind of source, and of given joints their digest."""
    if isinstance(source, GivenJoints) and recording.image_joints is not None:
        return f"given {hashlib.sha256(recording.image_joints.tobytes()).hexdigest()}"
    return source.name
