"""Poses of our body as AMASS files, for tests and for corpora of AMASS's size."""

from pathlib import Path
from typing import Any

import numpy as np

from toolkit.mocap.clip import PoseClip
from toolkit.output.export.amass import amass_arrays


def write_amass(path: Path, clip: PoseClip, **changes: object) -> Path:
    """Write our poses as an AMASS file of SMPL-H, z up, with unchanged foot positions.

    Parameters
    ----------
    changes : arrays by name that replace those of the file; None leaves one out
    """
    arrays: dict[str, Any] = {**amass_arrays(clip.poses, clip.frame_rate), **changes}
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return path
