"""Export for the rerun viewer (`.rrd`): clouds, bodies, joints and plots on one time line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import UsageError
from toolkit.io.files import atomic_path
from toolkit.output.export.origin import Origin
from toolkit.output.export.pixels import camera_points
from toolkit.sensing.recording import Recording
from toolkit.tracks import STATE_NAMES
from toolkit.tracks.runs import Person

POINTS = 6000
"""Maximum number of cloud points per frame, for some hundred megabytes per minute."""
GREY = (150, 156, 166)


def export_rerun(path: str | Path, people: Sequence[Person], origin: Origin, recording: Recording | None) -> None:
    """Write all people, and the measured points if the recording is available, for `rerun FILE`.

    Entities: `world/points`, `world/<person>/body` (mesh), `world/<person>/joints` (unobserved ones are grey) and
    `world/<person>/bones`; `plots/<person>/...` confidence, state and foot contacts. The time line `time` is in seconds
    from the first frame. Entities are cleared in frames without the person.

    Parameters
    ----------
    path : the file, `.rrd`
    people : in the frame of the origin
    origin : position of (0, 0, 0); y is up
    recording : gives the points

    Raises
    ------
    UsageError
        The package rerun is not installed.
    OutputError
        The file cannot be written.
    """
    try:
        import rerun as rr
    except ImportError as error:
        raise UsageError("rerun files need its package; type `pip install '.[rerun]'` in the project") from error
    colors = ((91, 143, 249), (246, 144, 61), (97, 221, 170), (211, 173, 247), (246, 189, 22), (255, 153, 195))
    with atomic_path(path) as temporary:
        stream = rr.RecordingStream("depthmocap", recording_id="depthmocap")
        stream.save(str(temporary))
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
        frames = None if recording is None else recording.frames()
        for i, time in enumerate(people[0].times.tolist()):
            stream.set_time("time", duration=time)
            if frames is not None and recording is not None:
                log_points(rr, stream, next(frames), recording, people[0].R_level_camera, origin.offset)
            for number, person in enumerate(people):
                _log_person(rr, stream, person, i, colors[number % len(colors)])
        stream.flush()
        stream.disconnect()


def log_points(
    rr: Any, stream: Any, depth_mm: np.ndarray, recording: Recording, R_level_camera: np.ndarray, offset: np.ndarray
) -> None:
    """Return about `POINTS` measured points of a frame, level frame, metres."""
    millimetres = 1000.0
    points = camera_points(depth_mm / millimetres, recording.camera)
    points = points[:: max(1, -(-len(points) // POINTS))] @ R_level_camera.T - offset
    stream.log("world/points", rr.Points3D(points, colors=GREY, radii=0.006))


def _log_person(rr: Any, stream: Any, person: Person, frame: int, color: tuple[int, int, int]) -> None:
    track, place, plots = person.track, f"world/{person.name}", f"plots/{person.name}"
    stream.log(f"{plots}/state", rr.TextLog(STATE_NAMES[track.state[frame]]))
    if not person.there[frame]:
        stream.log(place, rr.Clear(recursive=True))
        return
    body, joints = person.body, person.joints_level[frame]
    seen = track.observed[frame]
    stream.log(
        f"{place}/body",
        rr.Mesh3D(
            vertex_positions=body.vertex_positions(track.pose[frame]), triangle_indices=body.faces, albedo_factor=color
        ),
    )
    colors = [color if known else GREY for known in seen]
    stream.log(f"{place}/joints", rr.Points3D(joints, colors=colors, radii=0.02, labels=list(skeleton.REPORTED)))
    stream.log(f"{place}/bones", rr.LineStrips3D(joints[skeleton.BONE_ROWS], colors=color, radii=0.008))
    stream.log(f"{plots}/confidence/mean", rr.Scalars(float(track.confidence[frame].mean())))
    for side, carries in zip(("left", "right"), track.contact[frame], strict=True):
        stream.log(f"{plots}/contact/{side}_foot", rr.Scalars(float(carries)))
