"""People before they were found: looked for with time reversed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, scene
from toolkit.people.sighting import Sighting
from toolkit.people.survey import find_people
from toolkit.pipeline.earlier import BEFORE, sightings_before
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.recording import Recording
from toolkit.tracking.sightings import SightingFile

ROOM = {"height": 1.2, "wall": 4.0, "floor": True}
RATE = 10
SHOWN = 5
"""Frame from which on the walker is in the image."""


def walking(path: Path, frames: int = 40, others: Sequence[tuple[float, float]] = ()) -> tuple[Recording, np.ndarray]:
    """Somebody walks in and stays, others stand: the recording with its empty scene, and who is where (T, H, W)."""
    places = [(-1.9 + 0.12 * min(k, 16), 2.4) for k in range(frames)]
    shown = [scene(KINECT, (place, *others), **ROOM) for place in places]
    depth = np.stack([depth for depth, _ in shown])
    background = scene(KINECT, (), **ROOM)[0]
    recording = Recording(
        path=path / "walk.npz", name="walk", camera=KINECT, up_camera=np.array([0.0, -1.0, 0.0]),
        timestamps=np.arange(frames) / RATE, frames=depth, background=background,
    )  # fmt: skip
    return recording, np.stack([who for _, who in shown])
