"""A recording tracked without a run folder: people in, tracks out, bit for bit those that a run folder would hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolkit.biomechanics.contact import foot_contacts
from toolkit.body.body import Body
from toolkit.people.evidence import furniture
from toolkit.people.up import floor_height
from toolkit.pipeline.joints import JointChoice, give_joints, joint_source
from toolkit.pipeline.run import Job, finder_of
from toolkit.pipeline.sink import folder_of
from toolkit.progress import Count
from toolkit.runs import Person
from toolkit.sensing.recording import Recording
from toolkit.track import Track
from toolkit.tracking.crowd import Crowd, Row
from toolkit.tracking.protocol import Tracker


def follow_recording(
    recording: Recording,
    tracker: Tracker,
    *,
    people: int | None = 1,
    joints: JointChoice | None = None,
    progress: Count | None = None,
) -> tuple[Person, ...]:
    """Follow the person, or the people, through a recording.

    Parameters
    ----------
    recording : read frame by frame, once
    tracker : makes a follower for each person
    people : how many are followed; None = all
    joints : where joints in the image are to come from
    progress : told after every frame

    Returns
    -------
    Everybody in order of appearance, each with one row per frame.

    Raises
    ------
    RecordingError
        A frame cannot be used.
    UsageError, ModelError
        Joints in the image were asked for, see `joint_source`.
    """
    choice = joints or JointChoice()
    give_joints(recording, choice)
    job = Job(recording, tracker, people, joint_source(recording, choice, tracker.joints_wanted))
    height, turns = floor_height(recording), int(recording.options.get("rotate", 0)) // 90
    floor = None if height is None else -height
    crowd = Crowd(tracker, finder_of(job), recording.up_camera, job.joints, floor)
    rows: list[Row] = []
    for frame in recording.stream(color=job.joints.needs_color):
        rows += crowd.step(frame)
        if progress is not None:
            progress(crowd.frames, len(recording))
    rows += crowd.finish()
    found: list[Person] = []
    for person in sorted({row.person for row in rows} - furniture(crowd.finder.evidence)):
        number, body = len(found) + 1, crowd.bodies[person]
        track = track_of([row for row in rows if row.person == person], tracker, body, height)
        name = folder_of(number) if people != 1 else recording.name
        found.append(Person(name, track, body, crowd.level_rotation, number, height, recording.name, turns))
    return tuple(found)


def track_of(rows: Sequence[Row], tracker: Tracker, body: Body, camera_height: float | None = None) -> Track:
    """The track of one person's rows, one for each frame in order."""
    results = [row.result for row in rows]
    track = Track(
        joints=np.array([r.joints for r in results], dtype=np.float32),
        pose=np.array([r.pose for r in results], dtype=np.float64),
        confidence=np.array([r.confidence for r in results], dtype=np.float32),
        state=np.array([r.state for r in results], dtype=np.uint8),
        source=np.array([r.source for r in results], dtype=np.uint8),
        timestamps=np.array([row.timestamp for row in rows], dtype=np.float64),
        stage_ms=np.array([r.stage_ms for r in results], dtype=np.float32),
        observed=np.array([r.observed for r in results], dtype=np.bool_),
        source_names=tracker.source_names,
        stage_names=tracker.stage_names,
    )
    return replace(track, contact=foot_contacts(body, track, camera_height))
