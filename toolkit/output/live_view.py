"""People before a live camera in the viewer rerun, which is another process."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import OutputError, optional_package
from toolkit.output.pose_stream import LiveUpdate
from toolkit.output.rendering.style import FAINT, person_color
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracks import TRACKED


def spawn_viewer(stream: Any) -> None:
    """Start the viewer of the installed package and connect a stream of rerun with it.

    Raises
    ------
    OutputError
        The viewer cannot be started.
    """
    import rerun as rr

    # an environment that is not activated is not in PATH
    folders = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    try:
        rr.spawn(memory_limit="25%", executable_path=shutil.which("rerun", path=folders), recording=stream)
    except (OSError, RuntimeError) as error:
        raise OutputError(f"the viewer rerun cannot be started: {error}; leave out --view") from error


class RerunView:
    """`LiveOutput` that shows depth, joints and bones in the camera frame.

    Parameters
    ----------
    first : recording of the first frame, with the camera
    connect : connects a stream of rerun with a viewer or a file; default: a new viewer

    Raises
    ------
    UsageError
        The package rerun is not installed.
    """

    def __init__(self, first: Recording, connect: Callable[[Any], None] | None = None) -> None:
        rr = optional_package("rerun", "rerun", "--view")
        self._rr, self._stream = rr, rr.RecordingStream("depthmocap live")
        (connect or spawn_viewer)(self._stream)
        streamed_points = 6000  # measured pixels of a frame that are shown, about
        self._polisher = DepthFilter(first.camera, SensingSettings())
        self._step = max(1, int(np.ceil(np.sqrt(np.count_nonzero(first.depth(0)) / streamed_points))))
        self._shown: set[int] = set()
        self._begun: float | None = None
        self._stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Y_DOWN, static=True)
        camera = self._polisher.flat_camera.subsampled(self._step)
        size = [camera.width, camera.height]
        lens = rr.Pinhole(image_from_camera=camera.matrix, resolution=size, camera_xyz=rr.ViewCoordinates.RDF)
        self._stream.log("world/camera", rr.Transform3D(), lens, static=True)

    def send(self, update: LiveUpdate) -> None:
        """See `LiveOutput.send`; a thread of rerun transmits the frame."""
        rr, stream = self._rr, self._stream
        self._begun = update.timestamp if self._begun is None else self._begun
        stream.set_time("time", duration=update.timestamp - self._begun)
        depth = self._polisher.undistort(update.depth_mm)[:: self._step, :: self._step]
        stream.log("world/camera/depth", rr.DepthImage(np.ascontiguousarray(depth), meter=1000.0, colormap="grayscale"))
        tracked = [pose.row for pose in update.poses if pose.row.result.state == TRACKED]
        for row in tracked:
            self._log_person(row.person, row.result.joints.astype(np.float64), row.result.observed)
        present = {row.person for row in tracked}
        for person in sorted(self._shown - present):
            stream.log(f"world/person_{person:02d}", rr.Clear(recursive=True))
        self._shown = present

    def close(self) -> None:
        """Transmit the remaining data and disconnect."""
        self._stream.flush()
        self._stream.disconnect()

    def _log_person(self, person: int, joints: np.ndarray, observed: np.ndarray) -> None:
        """Log joints (20, 3), metres, camera frame, and the bones between them."""
        rr, place = self._rr, f"world/person_{person:02d}"
        color = person_color(person - 1)
        colors = np.where(observed[:, None], np.array(color), np.array(FAINT)).astype(np.uint8)
        labels = list(skeleton.REPORTED)
        points = rr.Points3D(joints, colors=colors, radii=0.02, labels=labels, show_labels=False)
        self._stream.log(f"{place}/joints", points)
        self._stream.log(f"{place}/bones", rr.LineStrips3D(list(joints[skeleton.BONE_ROWS]), colors=color, radii=0.008))
