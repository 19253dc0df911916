"""Small recordings in the formats of cameras and robots, written by independent software or byte by byte."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.sensing_scenes import TOF, person_alone

ACCELERATION = (0.0, -9.81 * np.cos(0.2), -9.81 * np.sin(0.2))
"""Acceleration at rest in the frame of a camera tilted downwards by 0.2 rad."""


def frames(count: int = 3) -> list[np.ndarray]:
    """Return depth images of a person who walks sideways, uint16 (144, 176), millimetres."""
    return [person_alone(TOF, 0.1 * i) for i in range(count)]


class RosWriter:
    """Writer of one depth topic with its camera info by `rosbags`, as ROS 1 bag, ROS 2 folder or mcap."""

    def __init__(self, path: Path) -> None:
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2
        from rosbags.typesys import Stores, get_typestore

        self.ros1 = path.suffix == ".bag"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        plugin = StoragePlugin.MCAP if path.name.endswith("mcap") else StoragePlugin.SQLITE3
        self.bag: Any = Writer1(path) if self.ros1 else Writer2(path, version=9, storage_plugin=plugin)
        self.connections: dict[str, Any] = {}

    def __enter__(self) -> RosWriter:
        self.bag.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.bag.close()

    def message(self, kind: str, **values: Any) -> Any:
        return self.store.types[kind](**values)

    def header(self, frame: str = "camera_depth_optical_frame") -> Any:
        stamp = self.message("builtin_interfaces/msg/Time", sec=0, nanosec=0)
        running = {"seq": 0} if self.ros1 else {}
        return self.message("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **running)

    def write(self, topic: str, time: float, message: Any) -> None:
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.bag.add_connection(topic, kind, typestore=self.store)
        data = self.store.serialize_ros1(message, kind) if self.ros1 else self.store.serialize_cdr(message, kind)
        self.bag.write(self.connections[topic], round(1e9 * time), data)

    def image(self, topic: str, time: float, pixels: np.ndarray, encoding: str) -> None:
        data = np.frombuffer(np.ascontiguousarray(pixels).tobytes(), np.uint8)
        shape = {"height": pixels.shape[0], "width": pixels.shape[1], "step": pixels.strides[0]}
        image = self.message(
            "sensor_msgs/msg/Image", header=self.header(), encoding=encoding, is_bigendian=0, data=data, **shape
        )
        self.write(topic, time, image)

    def camera(self, topic: str, time: float, lens: Sequence[float] = (0.0,) * 5) -> None:
        names = ("d", "k", "r", "p") if not self.ros1 else ("D", "K", "R", "P")
        matrix = TOF.matrix
        arrays = (np.array(lens), matrix.ravel(), np.eye(3).ravel(), np.column_stack([matrix, np.zeros(3)]).ravel())
        region = dict(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        info = self.message(
            "sensor_msgs/msg/CameraInfo", header=self.header(), height=TOF.height, width=TOF.width,
            distortion_model="plumb_bob", binning_x=0, binning_y=0,
            roi=self.message("sensor_msgs/msg/RegionOfInterest", **region), **dict(zip(names, arrays, strict=True)),
        )  # fmt: skip
        self.write(topic, time, info)

    def imu(self, topic: str, time: float, frame: str) -> None:
        def vector(x: float, y: float, z: float) -> Any:
            return self.message("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

        nothing = np.zeros(9)
        imu = self.message(
            "sensor_msgs/msg/Imu", header=self.header(frame),
            orientation=self.message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=nothing, angular_velocity=vector(0.0, 0.0, 0.0),
            angular_velocity_covariance=nothing, linear_acceleration=vector(*map(float, ACCELERATION)),
            linear_acceleration_covariance=nothing,
        )  # fmt: skip
        self.write(topic, time, imu)


def ros_recording(path: Path, count: int = 3, topic: str = "/camera/depth/image_raw") -> Path:
    """Write a recording as ROS drivers do: raw 16-bit images, `CameraInfo`, accelerations."""
    with RosWriter(path) as writer:
        for i, depth in enumerate(frames(count)):
            writer.camera(topic.rsplit("/", 1)[0] + "/camera_info", 5.0 + 0.1 * i)
            writer.image(topic, 5.0 + 0.1 * i, depth, "16UC1")
            writer.imu("/camera/accel/sample", 5.0 + 0.1 * i, "camera_accel_optical_frame")
    return path


def realsense_recording(path: Path, count: int = 4) -> Path:
    """Write a recording of the RealSense SDK's software device."""
    import time

    import pyrealsense2 as rs

    device = rs.software_device()
    sensor = device.add_sensor("Depth")
    intrinsics = rs.intrinsics()
    intrinsics.width, intrinsics.height = TOF.width, TOF.height
    intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy = TOF.intrinsics
    intrinsics.model, intrinsics.coeffs = rs.distortion.brown_conrady, [0.0] * 5
    stream = rs.video_stream()
    stream.type, stream.index, stream.uid, stream.fmt = rs.stream.depth, 0, 0, rs.format.z16
    stream.width, stream.height, stream.fps, stream.bpp, stream.intrinsics = TOF.width, TOF.height, 30, 2, intrinsics
    profile = sensor.add_video_stream(stream)
    sensor.add_read_only_option(rs.option.depth_units, 0.0005)
    recorder = rs.recorder(str(path), device)
    recorded = recorder.query_sensors()[0]
    queue = rs.frame_queue(10)
    recorded.open(recorded.get_stream_profiles()[0])
    recorded.start(queue)
    for i, depth in enumerate(frames(count)):
        frame = rs.software_video_frame()
        frame.pixels, frame.stride, frame.bpp = depth * 2, 2 * TOF.width, 2
        frame.timestamp, frame.frame_number, frame.depth_units = 1000 + 33.3 * i, i, 0.0005
        frame.domain, frame.profile = rs.timestamp_domain.hardware_clock, profile.as_video_stream_profile()
        sensor.on_video_frame(frame)
        time.sleep(0.03)
    recorded.stop()
    recorded.close()
    del recorder, recorded, device
    return path


def element(identifier: int, content: bytes) -> bytes:
    """Return one EBML element; sizes have eight bytes."""
    name = identifier.to_bytes((identifier.bit_length() + 7) // 8, "big")
    return name + (len(content) | 1 << 56).to_bytes(8, "big") + content


def whole(identifier: int, value: int) -> bytes:
    return element(identifier, value.to_bytes(8, "big"))


def mkv_track(number: int, name: str, code: bytes, size: tuple[int, int], codec: str = "V_MS/VFW/FOURCC") -> bytes:
    """Return the description of a track."""
    bitmap = struct.pack("<IiiHH4sIiiII", 40, *size, 1, 16, code, 0, 0, 0, 0, 0)
    video = element(0xE0, whole(0xB0, size[0]) + whole(0xBA, size[1])) if size[0] else b""
    return element(
        0xAE,
        whole(0xD7, number) + element(0x86, codec.encode()) + element(0x536E, name.encode())
        + element(0x63A2, bitmap if size[0] else b"") + video,
    )  # fmt: skip


def mkv_block(track: int, shift: int, content: bytes, flags: int = 0) -> bytes:
    """Return a simple block; `shift` counts from the time of its cluster."""
    return element(0xA3, bytes([0x80 | track]) + struct.pack(">hB", shift, flags) + content)


def calibration() -> dict[str, Any]:
    """Return a factory calibration without lens distortion; the accelerometer's x, y, z are the camera's z, x, y."""
    flat = [0.5, 0.5, 0.5, 0.5, *[0.0] * 10]
    still = {"Rotation": np.eye(3).ravel().tolist(), "Translation": [0, 0, 0]}
    turned = {"Rotation": [0, 0, 1, 1, 0, 0, 0, 1, 0], "Translation": [0, 0, 0]}
    cameras = [
        {"Purpose": "CALIBRATION_CameraPurposeDepth", "Intrinsics": {"ModelParameters": flat}, "Rt": still},
        {"Purpose": "CALIBRATION_CameraPurposePhotoVideo", "Intrinsics": {"ModelParameters": flat}, "Rt": still},
    ]
    sensors = [{"SensorType": "CALIBRATION_InertialSensorType_Accelerometer", "Rt": turned}]
    return {"CalibrationInformation": {"Cameras": cameras, "InertialSensors": sensors}}


MKV_SIZE = (320, 288)


def mkv_frames(count: int = 3) -> list[np.ndarray]:
    """Return depth images of the recorder's smallest mode, uint16 (288, 320), millimetres; 65000 means unmeasured."""
    images = [np.full(MKV_SIZE[::-1], 65000, np.uint16) for _ in range(count)]
    for i, depth in enumerate(frames(count)):
        images[i][100:244, 60:236] = np.where(depth > 0, depth, np.uint16(65000))
    return images


def mkv_recording(
    path: Path,
    *,
    start_us: int = 0,
    tracks: Sequence[tuple[str, bytes]] = (("DEPTH", b"b16g"),),
    known: dict[str, Any] | None = None,
    times_us: Sequence[int] = (0, 33_333, 66_666),
) -> Path:
    """Write a file in the layout of the Azure Kinect recorder, with accelerations; its clock begins at `start_us`."""
    entries = [mkv_track(i, name, code, MKV_SIZE) for i, (name, code) in enumerate(tracks, start=1)]
    entries.append(mkv_track(9, "IMU", b"", (0, 0), "S_K4A/IMU"))
    attached = element(0x466E, b"calibration.json") + element(0x465C, json.dumps(known or calibration()).encode())
    x, y, z = ACCELERATION
    sample = struct.pack("<Q3fQ3f", 0, z, x, y, 0, 0, 0, 0)
    clusters = []
    for time, depth in zip(times_us, mkv_frames(len(times_us)), strict=True):
        blocks = [mkv_block(i, 0, depth.astype(">u2").tobytes()) for i in range(1, len(tracks) + 1)]
        clusters.append(
            element(0x1F43B675, whole(0xE7, start_us + time) + b"".join([*blocks, mkv_block(9, 0, sample)]))
        )
    segment = element(0x1549A966, whole(0x2AD7B1, 1000)) + element(0x1654AE6B, b"".join(entries))
    segment += element(0x1941A469, element(0x61A7, attached)) + b"".join(clusters)
    path.write_bytes(element(0x1A45DFA3, b"") + element(0x18538067, segment))
    return path
