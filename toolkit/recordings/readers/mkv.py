"""Azure Kinect and Orbbec Femto recordings (`.mkv` of the k4arecorder and of Orbbec's viewer).

The depth track holds uncompressed 16-bit big-endian millimetres (`b16g`). The factory calibration is a JSON attachment
relative to the whole sensor; a depth mode bins the sensor and crops a window, as in the SDK's `transformation`. The
lens model is Brown-Conrady with six radial coefficients (OpenCV's rational model). Accelerations give the vertical.
Colour is registered to depth through the calibration.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.io.yaml_reader import parse_json
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import chosen_camera, damaged, decoded, recording_of_source, upright
from toolkit.recordings.readers.matroska import Matroska, MatroskaTrack
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import FrameSource, Recording

DEPTH_CODE, COLOR_CODE = b"b16g", b"MJPG"
"""Codec at byte 16 of a video track's private data (a BITMAPINFOHEADER)."""
DEPTH_MODES = {
    (640, 576): (1024, 192, 180),
    (320, 288): (512, 96, 90),
    (512, 512): (512, 0, 0),
    (1024, 1024): (1024, 0, 0),
}
"""Image size -> side of the binned sensor in pixels, and first column and row of the window."""
IMU_CODEC, IMU_SAMPLE = "S_K4A/IMU", struct.Struct("<Q3fQ3f")
"""Record of time in ns, acceleration in m/s^2, time, and angular velocity."""


@dataclass(frozen=True)
class FactoryCalibration:
    """Factory calibration: both cameras, and the transforms between the sensors.

    Attributes
    ----------
    depth, color : the cameras; `color` is None without colour of this size
    R_color_depth, t_color_depth : float64 (3, 3) and (3,), metres: `p_color = R p_depth + t`
    R_imu_depth : float64 (3, 3), from the axes of the depth camera to those of the accelerometer
    """

    depth: Camera
    color: Camera | None
    R_color_depth: np.ndarray
    t_color_depth: np.ndarray
    R_imu_depth: np.ndarray


def _calibration_of(text: str, depth: tuple[int, int], color: tuple[int, int] | None, where: str) -> FactoryCalibration:
    """Read the attachment for images of `depth` and `color` size, each (width, height)."""
    hint = "record it again, or give --intrinsics fx,fy,cx,cy"
    content = parse_json(text, f"the calibration of {where}", RecordingError, hint)
    if depth not in DEPTH_MODES:
        raise RecordingError(f"the depth of {where} has {depth[0]}x{depth[1]} pixels, no mode of the sensor; {hint}")
    side, left, top = DEPTH_MODES[depth]
    try:
        information = content["CalibrationInformation"]
        cameras = {entry["Purpose"].rsplit("Purpose", 1)[-1]: entry for entry in information["Cameras"]}
        inertial = {entry["SensorType"].rsplit("_", 1)[-1]: entry for entry in information.get("InertialSensors", [])}
        first = _camera(cameras["Depth"], depth, (side, side), (left, top))
        second = None
        if color is not None and "PhotoVideo" in cameras:
            whole = (color[0], color[0] * 3 // 4)
            second = _camera(cameras["PhotoVideo"], color, whole, (0, (whole[1] - color[1]) // 2))
        rotation, shift = _pose(cameras.get("PhotoVideo"))
        return FactoryCalibration(first, second, rotation, shift, _pose(inertial.get("Accelerometer"))[0])
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise RecordingError(f"the calibration of {where} is incomplete ({error!r}); {hint}") from error


def _camera(entry: Any, size: tuple[int, int], sensor: tuple[int, int], window: tuple[int, int]) -> Camera:
    cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, _, _, p2, p1 = (float(v) for v in entry["Intrinsics"]["ModelParameters"])
    # Stored relative to the sensor's size with 0 at its corner; our origin is the centre of the first pixel.
    centre = (cx * sensor[0] - window[0] - 0.5, cy * sensor[1] - window[1] - 0.5)
    return Camera(fx * sensor[0], fy * sensor[1], *centre, *size, (k1, k2, p1, p2, k3, k4, k5, k6))


def _pose(entry: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation and translation (metres) from the depth camera's frame to a sensor's; identity without it."""
    if entry is None:
        return np.eye(3), np.zeros(3)
    rotation = np.array(entry["Rt"]["Rotation"], dtype=np.float64).reshape(3, 3)
    return rotation, np.array(entry["Rt"]["Translation"], dtype=np.float64).reshape(3)


def _frames(
    path: Path, file: Matroska, track: MatroskaTrack, colors: MatroskaTrack | None, lenses: FactoryCalibration | None
) -> FrameSource:
    """Return the depth blocks of a track, with the colour block that is nearest in time registered to each."""
    shape = (track.height, track.width)

    def depth(i: int) -> np.ndarray:
        with damaged(path):
            data = file.read(track.blocks[i])
            if len(data) != 2 * shape[0] * shape[1]:
                raise ValueError(f"frame {i} has {len(data)} bytes")
        return np.frombuffer(data, ">u2").reshape(shape).astype(np.uint16)

    def color(i: int) -> np.ndarray | None:
        if colors is None or lenses is None or lenses.color is None or not colors.blocks:
            return None
        import cv2

        times = np.array([block.time for block in colors.blocks])
        nearest = colors.blocks[int(np.abs(times - track.blocks[i].time).argmin())]
        with damaged(path):
            image = decoded(file.read(nearest), cv2.IMREAD_COLOR)
            if image is None:
                raise ValueError(f"the colour of frame {i} is no JPEG")
        return registered(depth(i), image[:, :, ::-1], lenses)

    return FrameSource(len(track.blocks), depth, color)


def registered(depth_mm: np.ndarray, color: np.ndarray, lenses: FactoryCalibration) -> np.ndarray:
    """Register colour (h, w, 3) to a depth image (H, W): uint8 (H, W, 3), RGB, black out of view of the colour camera
    or where `lenses` are undefined."""
    import cv2

    camera = lenses.color
    out = np.zeros((*depth_mm.shape, 3), np.uint8)
    v, u = np.nonzero(depth_mm)
    if camera is None or not len(v):
        return out
    z = depth_mm[v, u] / 1000.0
    points = np.column_stack([lenses.depth.rays()[v, u] * z[:, None], z])
    turn = cv2.Rodrigues(lenses.R_color_depth)[0]
    pixels = cv2.projectPoints(points, turn, lenses.t_color_depth, camera.matrix, np.array(camera.distortion or ()))[0][
        :, 0
    ]
    at = np.rint(np.nan_to_num(pixels, nan=-1.0, posinf=-1.0, neginf=-1.0).clip(-1, 1 << 20)).astype(np.int64)
    seen = (at >= 0).all(axis=1) & (at[:, 0] < color.shape[1]) & (at[:, 1] < color.shape[0])
    out[v[seen], u[seen]] = color[at[seen, 1], at[seen, 0]]
    return out


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a recording; the option `track` names one of several depth tracks."""
    with damaged(path):
        file = Matroska(path)
    depth = _depth_track(path, file, options.track)
    color = next((t for t in file.tracks if t.name == "COLOR" and t.private[16:20] == COLOR_CODE), None)
    lenses = None
    if "calibration.json" in file.attachments:
        text = file.attachments["calibration.json"].rstrip(b"\0").decode("utf-8", "replace")
        size = None if color is None else (color.width, color.height)
        lenses = _calibration_of(text, (depth.width, depth.height), size, str(path))
    source = _frames(path, file, depth, color, lenses)
    own = lenses is not None and options.intrinsics is None
    camera = lenses.depth if own and lenses else chosen_camera(options, (depth.height, depth.width), path)
    times = 1e-9 * np.array([block.time - depth.blocks[0].time for block in depth.blocks], dtype=np.float64)
    return recording_of_source(path, source, camera, options, timestamps=times, up=_up(path, file, lenses))


def _depth_track(path: Path, file: Matroska, wanted: str | None) -> MatroskaTrack:
    names = ", ".join(f"{track.name or track.number} ({track.codec})" for track in file.tracks) or "none"
    found = [t for t in file.tracks if (t.name == wanted if wanted is not None else "DEPTH" in t.name.upper())]
    if not found:
        raise RecordingError(f"{path} has no depth track{f' {wanted!r}' if wanted else ''}; its tracks are: {names}")
    if len(found) > 1:
        raise RecordingError(f"{path} has {len(found)} depth tracks; give --track NAME for one of: {names}")
    track = found[0]
    if track.private[16:20] != DEPTH_CODE:
        raise RecordingError(
            f"the depth of {path} is coded as {track.codec} {track.private[16:20]!r}; record it uncompressed (b16g)"
        )
    if not track.blocks or not (track.width and track.height):
        raise RecordingError(f"the depth track of {path} holds no frame; record it again")
    return track


def _up(path: Path, file: Matroska, lenses: FactoryCalibration | None) -> np.ndarray | None:
    """Return the vertical in the depth camera's frame from the accelerometer, or None."""
    blocks = [block for track in file.tracks if track.codec == IMU_CODEC for block in track.blocks]
    if lenses is None or not blocks:
        return None
    accelerations = 2000  # number of samples in the median of the vertical (some seconds)
    with damaged(path):
        samples = [
            sample[1:4]
            for block in blocks[:accelerations]
            for sample in IMU_SAMPLE.iter_unpack(file.read(block)[: block.size // IMU_SAMPLE.size * IMU_SAMPLE.size])
        ]
    measured = np.array(samples, dtype=np.float64).reshape(-1, 3)
    return upright((measured[:, :, None] * lenses.R_imu_depth).sum(axis=1)) if len(measured) else None
