"""Export as C3D for motion laboratories, through the optional package ezc3d."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import UsageError, optional_package
from toolkit.io.files import atomic_path
from toolkit.tracks.runs import Person


def export_c3d(path: str | Path, people: Sequence[Person]) -> None:
    """Write the reported joints as points of a C3D file: y up (level frame), millimetres.

    Several people are in one file; their points are named `<person>:<joint>` as in Vicon files. Points are marked as
    missing in frames without the person. The format has no field for confidences.

    Raises
    ------
    UsageError
        The package is not installed, the tracks have different lengths, or are too short for a frame rate.
    OutputError
        The file cannot be written.
    """
    ezc3d = optional_package("ezc3d", "c3d", "a C3D file")
    rate, lengths = people[0].frame_rate(), {len(person.track) for person in people}
    if len(lengths) > 1:
        raise UsageError(f"the tracks have {sorted(lengths)} frames; a C3D file holds people of one recording")
    millimetres = 1000.0  # units per metre (millimetres)
    points = np.concatenate([person.joints_level for person in people], axis=1) * millimetres
    prefixes = [f"{person.name}:" for person in people] if len(people) > 1 else [""]
    file = ezc3d.c3d()
    parameters = file["parameters"]["POINT"]
    parameters["RATE"]["value"] = [rate]
    parameters["UNITS"]["value"] = ["mm"]
    parameters["LABELS"]["value"] = [prefix + name for prefix in prefixes for name in skeleton.REPORTED]
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Y"])
    file["data"]["points"] = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2).transpose(2, 1, 0)
    with atomic_path(path) as temporary:
        try:
            file.write(str(temporary))
        except RuntimeError as error:  # the package's message for a full disk
            raise OSError(str(error)) from error
