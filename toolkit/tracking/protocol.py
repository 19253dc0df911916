"""What every tracker offers; the pipeline knows no more than this."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from toolkit.body.body import Body
from toolkit.sensing.cleaning import SensingSettings
from toolkit.sensing.recording import Recording
from toolkit.track import FrameResult

__all__ = ["FrameResult", "Tracker", "TrackerSettings"]


class TrackerSettings(Protocol):
    """A frozen dataclass of settings, of which one section says how depth is segmented and cleaned."""

    @property
    def sensing(self) -> SensingSettings:
        """How depth is segmented and cleaned."""
        ...


class Tracker(Protocol):
    """Follows one person through a recording, frame by frame, without being given any pose.

    Attributes
    ----------
    memory : everything that the next step depends on besides the depth image, picklable; setting it after `start`
        continues an interrupted run exactly
    """

    memory: Any

    @property
    def stage_names(self) -> tuple[str, ...]:
        """Names of the timed stages, in the order of `FrameResult.stage_ms`."""
        ...

    @property
    def source_names(self) -> tuple[str, ...]:
        """Names of the hypotheses that can win, indexed by `FrameResult.source`."""
        ...

    @property
    def settings(self) -> TrackerSettings:
        """What it was made with, written beside its results."""
        ...

    @property
    def database(self) -> str:
        """Path of the pose database it uses, empty for none."""
        ...

    @property
    def body(self) -> Body:
        """The body as fitted so far, with its shape and scale; known from `start` on."""
        ...

    def start(self, recording: Recording) -> None:
        """Forget everything and get ready for the first frame of a recording (its camera, vertical and background)."""
        ...

    def step(self, depth_mm: np.ndarray, timestamp: float) -> FrameResult:
        """Find the person in the next frame: depth uint16 (H, W) in millimetres, timestamp in seconds."""
        ...
