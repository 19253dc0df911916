"""MVNX files of Xsens MVN: XML with the orientations of 23 fitted body segments per frame.

The segments are not raw sensors: MVN has fitted them to a skeleton. Leading frames may be calibration poses (`npose`,
`tpose`, `identity`); only frames of the type `normal` are motion. The world has z up, x to north.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from toolkit.inertial.readers.base import SensorOptions, head_of, read_text
from toolkit.inertial.stream import Sensors, checked_stream
from toolkit.io.errors import InertialError

ORIGIN = "segment fitted by MVN"


def matches(path: Path) -> bool:
    """Return True for the suffix or root element of an MVNX file."""
    return path.suffix.lower() == ".mvnx" or "<mvnx" in head_of(path, 1024)


def read(path: Path, options: SensorOptions) -> Sensors:
    """Return one stream per segment; a placement selects some of them."""
    root = _tree(path)
    frames = [f for f in root.iter() if _tag(f) == "frame" and f.get("type") == "normal"]
    if len(frames) < 2:
        raise InertialError(f"{path} holds {len(frames)} frames of the type normal; export a recording with motion")
    labels = [str(s.get("label")) for s in root.iter() if _tag(s) == "segment" and s.get("label")]
    rate = next((_number(path, s, "frameRate") for s in root.iter() if s.get("frameRate")), options.rate)
    table = [_orientations(path, frame, len(labels)) for frame in frames]
    rotations = np.array(table).reshape(len(frames), len(labels), 4)
    times = _times(path, frames, rate)
    streams = [checked_stream(label, times, rotations=rotations[:, k], origin=ORIGIN) for k, label in enumerate(labels)]
    return Sensors(tuple(streams))


def _tree(path: Path) -> Any:
    from xml.etree import ElementTree

    text = read_text(path)
    if "<!ENTITY" in text:
        raise InertialError(f"{path} defines XML entities, which no MVNX file does; export it again")
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InertialError(f"{path} is no complete XML ({error}); copy it again") from error


def _tag(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]


def _number(path: Path, element: Any, attribute: str) -> float:
    text = element.get(attribute)
    try:
        return float(text)
    except ValueError:
        raise InertialError(
            f"{attribute} of a {_tag(element)} in {path} is {text[:80]!r} and no number; export it again"
        ) from None


def _orientations(path: Path, frame: Any, segments: int) -> np.ndarray:
    element = next((child for child in frame if _tag(child) == "orientation"), None)
    text = "" if element is None else element.text or ""
    try:
        values = np.array(text.split(), dtype=np.float64)
    except ValueError:
        values = np.empty(0)
    if len(values) != 4 * segments:
        raise InertialError(
            f"frame {frame.get('index')} of {path} has {len(values)} numbers of orientation for {segments} segments; "
            "export it with segment orientations"
        )
    return values


def _times(path: Path, frames: list[Any], rate: float | None) -> np.ndarray:
    """Return the times of the attribute `time` (milliseconds); if missing, the frame number over the rate."""
    if all(frame.get("time") is not None for frame in frames):
        times = np.array([_number(path, frame, "time") for frame in frames]) / 1000.0
        if (np.diff(times) > 0).all():
            return times
    if not rate:
        raise InertialError(f"{path} has neither times nor a frame rate; give --rate in frames a second")
    return np.array([_number(path, f, "index") if f.get("index") else i for i, f in enumerate(frames)]) / rate
