"""Export for the rerun viewer (`.rrd`): depth, bodies, joints and plots on one time line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import optional_package
from toolkit.io.files import atomic_path
from toolkit.output.export.origin import Origin
from toolkit.output.rendering.style import FAINT, person_color
from toolkit.sensing.camera import Camera
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracks import STATE_NAMES
from toolkit.tracks.runs import Person


def export_rerun(path: str | Path, people: Sequence[Person], origin: Origin, recording: Recording | None) -> None:
    """Write all people, and the measured depth if the recording is available, for `rerun FILE`.

    Entities: `world/camera/depth` (depth images, which the viewer shows as points), `world/<person>/body` (mesh),
    `world/<person>/joints` (unobserved ones are grey), `world/<person>/bones`; `plots/<person>/...` confidence, state
    and foot contacts. The time line `time` is in seconds from the first frame. Entities are cleared in frames without
    the person.

    Parameters
    ----------
    path : the file, `.rrd`
    people : in the frame of the origin
    origin : position of (0, 0, 0); y is up
    recording : gives the depth

    Raises
    ------
    UsageError
        The package rerun is not installed.
    OutputError
        The file cannot be written.
    """
    rr = optional_package("rerun", "rerun", "a .rrd file")
    views = optional_package("rerun.blueprint", "rerun", "a .rrd file")
    with atomic_path(path) as temporary:
        stream = rr.RecordingStream("depthmocap", recording_id="depthmocap")
        scene, plots = views.Spatial3DView(origin="world"), views.TimeSeriesView(origin="plots")
        layout = views.Blueprint(views.Horizontal(scene, plots, column_shares=[2, 1]), collapse_panels=True)
        stream.save(str(temporary), default_blueprint=layout)
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
        times = people[0].times
        if recording is not None:
            _write_depth(rr, stream, recording, times, people[0].R_level_camera, origin.offset)
        for number, person in enumerate(people):
            _write_person(rr, stream, person, times, person_color(number))
        stream.flush()
        stream.disconnect()


def _write_depth(
    rr: Any, stream: Any, recording: Recording, times: np.ndarray, R_level_camera: np.ndarray, offset: np.ndarray
) -> None:
    """Write the camera, and undistorted depth images as PNG with about 6,000 measured pixels."""
    polisher = DepthFilter(recording.camera, SensingSettings())
    step = point_step(recording.depth(0))
    place = rr.Transform3D(translation=-offset, mat3x3=R_level_camera)
    log_camera(rr, stream, polisher.flat_camera.subsampled(step), place)
    facts = rr.EncodedDepthImage.from_fields(
        media_type="image/png", meter=1000.0, colormap="grayscale", point_fill_ratio=0.3
    )
    stream.log("world/camera/depth", facts, static=True)
    for time, depth in zip(times.tolist(), recording.frames(), strict=False):
        stream.set_time("time", duration=time)
        image = _png(polisher.undistort(depth)[::step, ::step])
        stream.log("world/camera/depth", rr.EncodedDepthImage.from_fields(blob=image))


def point_step(depth_mm: np.ndarray) -> int:
    """Return the step of rows and columns at which a frame has about 6,000 measured pixels."""
    streamed_points = 6000
    return max(1, int(np.ceil(np.sqrt(np.count_nonzero(depth_mm) / streamed_points))))


def log_camera(rr: Any, stream: Any, camera: Camera, place: Any) -> None:
    """Log the camera of the depth images and its place, a transform of rerun."""
    lens = rr.Pinhole(
        image_from_camera=camera.matrix, resolution=[camera.width, camera.height], camera_xyz=rr.ViewCoordinates.RDF
    )
    stream.log("world/camera", place, lens, static=True)


def _png(image: np.ndarray) -> bytes:
    import cv2

    return cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes()


def _write_person(rr: Any, stream: Any, person: Person, times: np.ndarray, color: tuple[int, int, int]) -> None:
    """Write what is constant once, and each quantity of all frames as columns."""
    track, place, plots = person.track, f"world/{person.name}", f"plots/{person.name}"
    there = np.flatnonzero(person.there)
    mesh = rr.Mesh3D.from_fields(triangle_indices=person.body.faces, albedo_factor=color)
    dots = rr.Points3D.from_fields(radii=0.02, labels=list(skeleton.REPORTED), show_labels=False)
    stream.log(f"{place}/body", mesh, static=True)
    stream.log(f"{place}/joints", dots, static=True)
    stream.log(f"{place}/bones", rr.LineStrips3D.from_fields(colors=color, radii=0.008), static=True)

    def write(entity: str, frames: np.ndarray, columns: Any, lengths: int | None = None) -> None:
        index = rr.TimeColumn("time", duration=times[frames])
        rows = columns if lengths is None else columns.partition([lengths] * len(frames))
        stream.send_columns(entity, indexes=[index], columns=rows)

    every = np.arange(len(times))
    write(f"{plots}/state", every, rr.TextLog.columns(text=[STATE_NAMES[state] for state in track.state]))
    if len(there):
        joints = person.joints_level[there]
        vertices = np.concatenate([person.body.vertex_positions(track.pose[frame]) for frame in there])
        write(f"{place}/body", there, rr.Mesh3D.columns(vertex_positions=vertices), len(person.body.vertices))
        colors = np.where(track.observed[there][..., None], np.array(color), np.array(FAINT))
        dots = rr.Points3D.columns(positions=joints.reshape(-1, 3), colors=colors.astype(np.uint8).reshape(-1, 3))
        write(f"{place}/joints", there, dots, len(skeleton.REPORTED))
        strips = joints[:, skeleton.BONE_ROWS].reshape(-1, 2, 3)
        write(f"{place}/bones", there, rr.LineStrips3D.columns(strips=strips), len(skeleton.BONE_ROWS))
        write(f"{plots}/confidence/mean", there, rr.Scalars.columns(scalars=track.confidence[there].mean(axis=1)))
        for side, contact in zip(("left", "right"), track.contact[there].T.astype(np.float64), strict=True):
            write(f"{plots}/contact/{side}_foot", there, rr.Scalars.columns(scalars=contact))
    gone = np.flatnonzero(person.there[:-1] & ~person.there[1:]) + 1
    for time in times[gone].tolist():  # after the columns: a recursive clear reaches the entities that exist
        stream.set_time("time", duration=time)
        stream.log(place, rr.Clear(recursive=True))
