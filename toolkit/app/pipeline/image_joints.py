"""Image joints: their source (files, the recording, or the pose network), and storing them with a recording."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.io.errors import RecordingError, UsageError
from toolkit.io.files import check_output
from toolkit.io.progress import Count, silent
from toolkit.people.joint_masks import GivenJoints, JointSource, NoJoints
from toolkit.people.sighting import PeopleFinder
from toolkit.people.survey import find
from toolkit.recordings.joint_files import read_joints
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.joints2d import Joints2D, same_rays
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings

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


def store_joints(
    recording: Recording,
    output: str | Path,
    choice: JointChoice | None = None,
    *,
    people: int | None = 1,
    sensing: SensingSettings | None = None,
    progress: Count = silent,
) -> Recording:
    """Write a recording as NPZ with its image joints (`depthmocap joints`).

    Parameters
    ----------
    choice : source of the joints
    people : maximum number of people with joints, None = all; 1 is the person selected by the settings
    sensing : settings of the segmentation
    progress : called with the number of frames done and of all frames

    Returns
    -------
    The new recording, opened for reading.

    Raises
    ------
    UsageError
        The source of joints is "none", or `output` is no .npz file or would replace the recording.
    RecordingError
        See `give_joints`.
    ModelError
        The pose network cannot be loaded.
    OutputError
        The file cannot be written.
    """
    if Path(output).suffix != ".npz":
        raise UsageError(f"a recording is one .npz file, not {output}; choose a name such as take.npz")
    check_output(output, [recording.path], sealed=[recording.path])
    choice = choice or JointChoice()
    give_joints(recording, choice)
    source = joint_source(recording, choice, "required")
    if isinstance(source, GivenJoints):
        rows = recording.image_joints
    elif isinstance(source, NoJoints):
        raise UsageError("there is nothing to store with --joints none; choose colour, depth or a folder")
    else:
        rows = _found(recording, source, find(recording, people, sensing or SensingSettings()), progress)
    frames, known = range(len(recording)), recording.vertical.source in ("file", "option")
    save_recording(
        output,
        depth=recording.frames(),
        camera=recording.camera,
        timestamps=recording.timestamps,
        background=recording.background,
        color=(image for i in frames if (image := recording.color(i)) is not None) if recording.has_color else None,
        up_camera=recording.up_camera if known else None,
        joints=recording.joints,
        reference_joints=recording.reference_joints,
        joints_2d=rows,
    )
    return open_recording(output)


def _found(recording: Recording, source: JointSource, finder: PeopleFinder, progress: Count) -> np.ndarray:
    """Return the joints of all people in all frames, float32 (N, T, 20, 3), in pixels of the depth image."""
    total = len(recording)
    people: dict[int, np.ndarray] = {1: np.full((total, 20, 3), np.nan, dtype=np.float32)}
    for i, frame in enumerate(recording.stream(color=source.needs_color)):
        for sighting in source.add(frame, finder.find(frame.depth_mm, frame.timestamp, {})):
            rows = people.setdefault(sighting.id, np.full((total, 20, 3), np.nan, dtype=np.float32))
            if sighting.joints is not None:
                pixels = same_rays(sighting.joints.pixels, sighting.camera, recording.camera)
                rows[i] = Joints2D(pixels, sighting.joints.confidence).rows
        progress(i + 1, total)
    return np.stack([people[number] for number in sorted(people)])
