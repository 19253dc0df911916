"""Export of all content of a track as JSON, for programs with their own skeleton."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.io.files import save_text
from toolkit.output.export.origin import CAMERA, Origin
from toolkit.tracks import STATE_NAMES
from toolkit.tracks.runs import Person

DECIMALS = 5
"""Decimal places of metres and radians (a hundredth of a millimetre)."""


def export_json(path: str | Path, people: Sequence[Person], origin: Origin) -> None:
    """Write tracks as JSON: joints of the camera frame in metres, poses in the level frame, confidences, states.

    With the floor as origin, joints and poses are both in the level frame, moved to it. Joints, pose, confidence,
    observed and contact are null in frames without the person (`"empty"`).

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    document = {
        "format": "depthmocap track",
        "units": {"length": "m", "angle": "rad", "time": "s"},
        "frames": {
            "joints": "camera: x right, y down, z forward" if origin.name == CAMERA else origin.note(),
            "pose": "level: origin at the camera, y up, z towards the camera"
            if origin.name == CAMERA
            else origin.note(),
        },
        "joint_names": skeleton.REPORTED,
        "pose_names": skeleton.POSE_NAMES,
        "contact_names": ["left_foot", "right_foot"],
        "people": [_person(person, origin) for person in people],
    }
    save_text(path, json.dumps(document, allow_nan=False) + "\n")


def _person(person: Person, origin: Origin) -> dict[str, Any]:
    track = person.track
    joints = track.joints if origin.name == CAMERA else np.nan_to_num(person.joints_level)

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
