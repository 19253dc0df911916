"""Image joints stored with a recording, so that tracking needs no pose network."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.app.pipeline.joint_choice import JointChoice, give_joints, joint_source
from toolkit.app.pipeline.run import finder_of
from toolkit.io.errors import UsageError
from toolkit.io.files import check_output
from toolkit.io.progress import Count, silent
from toolkit.people.joint_masks import GivenJoints, JointSource, NoJoints
from toolkit.people.sighting import PeopleFinder
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.joints2d import Joints2D, same_rays
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings


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
        rows = _found(recording, source, finder_of(recording, people, sensing or SensingSettings()), progress)
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
