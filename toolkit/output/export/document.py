"""Export as JSON: all content of a track, and the format of the Azure Kinect body tracking SDK."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import k4abt, skeleton
from toolkit.io.errors import UsageError
from toolkit.io.files import save_text
from toolkit.sensing.camera import rotated_points
from toolkit.tracks import EMPTY, STATE_NAMES, TRACKED
from toolkit.tracks.runs import Person

DECIMALS = 5
"""Decimal places of metres and radians (a hundredth of a millimetre)."""


def export_json(path: str | Path, people: Sequence[Person], axes: str = "") -> None:
    """Write tracks as JSON: joints of the camera frame in metres, poses in the level frame, confidences, states.

    `axes` describes the frame of people whose level frame was moved to the floor; joints and poses are both in it.
    Joints, pose, confidence, observed and contact are null in frames without the person (`"empty"`).

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    document = {
        "format": "depthmocap track",
        "units": {"length": "m", "angle": "rad", "time": "s"},
        "frames": {
            "joints": axes or "camera: x right, y down, z forward",
            "pose": axes or "level: origin at the camera, y up, z towards the camera",
        },
        "joint_names": skeleton.REPORTED,
        "pose_names": skeleton.POSE_NAMES,
        "contact_names": ["left_foot", "right_foot"],
        "people": [_person(person, level=bool(axes)) for person in people],
    }
    save_text(path, json.dumps(document, allow_nan=False) + "\n")


def _person(person: Person, *, level: bool) -> dict[str, Any]:
    track = person.track
    joints = np.nan_to_num(person.joints_level) if level else track.joints

    def rows(values: np.ndarray) -> list[Any]:
        plain = values if values.dtype == np.bool_ else np.round(values.astype(np.float64), DECIMALS)
        return [row if here else None for row, here in zip(plain.tolist(), person.there, strict=True)]

    return {
        "name": person.name,
        "stature": round(person.body.height, DECIMALS),
        "rest_joints": np.round(person.body.joints, DECIMALS).tolist(),
        "R_level_camera": person.R_level_camera.tolist(),
        "timestamps": track.timestamps.tolist(),
        "state": [STATE_NAMES[state] for state in track.state],
        "source": [track.source_names[source] if track.source_names else "" for source in track.source],
        "camera_height": person.camera_height,
        "joints": rows(joints),
        "pose": rows(track.pose),
        "confidence": rows(track.confidence),
        "observed": rows(track.observed),
        "contact": rows(track.contact),
    }


def export_k4abt(path: str | Path, people: Sequence[Person]) -> None:
    """Write all people as the SDK's offline processor does: depth camera frame, millimetres, quaternions wxyz.

    `frames` holds all frames of the recording, `bodies` the people in each, `body_id` their id in `people.json`. Each
    body has the additional key `confidence_level` (none 0, low 1, medium 2), which the offline processor omits. A lost
    person has at most level low. If the images were turned upright (`--rotate`), the coordinates are still those of the
    camera as mounted, as in the SDK.

    Raises
    ------
    UsageError
        The tracks have different lengths.
    OutputError
        The file cannot be written.
    """
    lengths = {len(person.track) for person in people}
    if len(lengths) > 1:
        raise UsageError(f"the tracks have {sorted(lengths)} frames; a k4abt file holds people of one recording")
    times = np.rint(people[0].track.timestamps * 1e6).astype(np.int64)
    times -= min(0, int(times[0]))  # the ids of the SDK are unsigned
    bodies = [_bodies(person) for person in people]
    frames = []
    for i, time in enumerate(times.tolist()):
        here = [rows[i] for rows in bodies if rows[i] is not None]
        frames.append({"bodies": here, "frame_id": i, "num_bodies": len(here), "timestamp_usec": time})
    document = {
        "bone_list": k4abt.BONES,
        "frames": frames,
        "joint_names": k4abt.NAMES,
        "k4abt_sdk_version": "1.1.2",
        "source_file": people[0].recording or "",
    }
    save_text(path, json.dumps(document, allow_nan=False) + "\n")


def _bodies(person: Person) -> list[dict[str, Any] | None]:
    """Return the body of the person in each frame, None in frames without the person."""
    from scipy.spatial.transform import Rotation

    track, there = person.track, np.flatnonzero(person.track.state != EMPTY)
    placed = k4abt.place(person.body, track.pose[there])
    upright = rotated_points(np.eye(3), person.turns)  # the rows are the axes of the camera as mounted
    R_camera_level = upright @ person.R_level_camera.T
    decimals, quaternion_decimals = 4, 8  # decimal places of millimetres and of quaternions
    positions = np.round(placed.positions @ R_camera_level.T * 1000.0, decimals)
    turns = R_camera_level @ placed.frames
    quaternions = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_quat()[:, [3, 0, 1, 2]]
    quaternions = np.round(quaternions, quaternion_decimals).reshape(len(there), len(k4abt.NAMES), 4)
    levels = confidence_levels(person)[there]
    rows: list[dict[str, Any] | None] = [None] * len(track)
    for k, i in enumerate(there.tolist()):
        rows[i] = {
            "body_id": person.id,
            "confidence_level": levels[k].tolist(),
            "joint_orientations": quaternions[k].tolist(),
            "joint_positions": positions[k].tolist(),
        }
    return rows


def confidence_levels(person: Person) -> np.ndarray:
    """Return the SDK levels of the 32 joints, int64 (T, 32), from probability and visibility of our nearest joint."""
    track = person.track
    likely, seen = track.confidence[:, k4abt.WITNESS], track.observed[:, k4abt.WITNESS]
    none, low, medium = 0, 1, 2  # the SDK never uses its fourth level (high)
    # Minimum probability of an observed joint for level medium, and maximum one for level none.
    sure, guessed = 0.5, 0.1
    levels = np.where(likely < guessed, none, low)
    levels[(likely >= sure) & seen & (track.state == TRACKED)[:, None]] = medium
    return levels
