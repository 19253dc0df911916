"""TotalCapture: `*.sensors` with orientations `w x y z`.

The first line says how many sensors and frames there are. A frame is its number and one line per sensor: name,
orientation, acceleration, and in the long form gyroscope and magnetometer. 60 frames a second.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.inertial.readers.base import SensorOptions, head_of, read_text
from toolkit.inertial.stream import Sensors, checked_stream
from toolkit.io.errors import InertialError

RATE = 60.0
WIDTHS = (7, 13)
"""Numbers behind a sensor's name: orientation and acceleration; with gyroscope and magnetometer."""


def matches(path: Path) -> bool:
    """Whether it is called so or begins with two whole numbers."""
    words = (head_of(path, 256).splitlines() or [""])[0].split()
    return path.suffix.lower() == ".sensors" or (
        path.suffix.lower() == ".txt" and len(words) == 2 and all(word.isdigit() for word in words)
    )


def read(path: Path, options: SensorOptions) -> Sensors:
    """All sensors of a file."""
    lines = [line.split() for line in read_text(path).splitlines() if line.strip()]
    try:
        count, frames = (int(word) for word in lines[0])
    except (ValueError, IndexError):
        raise InertialError(
            f"{path} does not begin with its numbers of sensors and frames; is it TotalCapture's?"
        ) from None
    block = count + 1
    whole = min(frames, (len(lines) - 1) // block if block else 0)
    if count < 1 or whole < 2:
        raise InertialError(f"{path} holds {whole} whole frames of {count} sensors; copy it again")
    names = [words[0] for words in lines[2 : 2 + count]]
    width = len(lines[2]) - 1
    if width not in WIDTHS:
        raise InertialError(f"sensor {names[0]} of {path} has {width} numbers; expected one of {WIDTHS}")
    values = np.full((whole, count, width), np.nan)
    for f in range(whole):
        for k, words in enumerate(lines[1 + f * block + 1 : 1 + (f + 1) * block]):
            if words[0] != names[k] or len(words) != width + 1:
                raise InertialError(f"frame {f} of {path} has {words[0]!r} where sensor {names[k]!r} was expected")
            try:
                values[f, k] = [float(word) for word in words[1:]]
            except ValueError:
                continue  # a row that is no number is left unknown
    times = np.arange(whole) / (options.rate or RATE)
    streams = [
        checked_stream(
            name,
            times,
            rotations=values[:, k, :4],
            acceleration=values[:, k, 4:7],
            gyro=values[:, k, 7:10] if width > 7 else None,
            magnetic=values[:, k, 10:13] if width > 7 else None,
        )
        for k, name in enumerate(names)
    ]
    return Sensors(tuple(streams))
