"""Depth recordings with exact truth: any clip, any body, any camera, two sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.raycast import Hits, cast
from toolkit.body.shape import subject_body
from toolkit.errors import UsageError
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording, open_recording
from toolkit.sensing.writer import RecordingWriter
from toolkit.simulation.scene import View, place_camera, room
from toolkit.simulation.sensors import Sensor, Surface, make_sensor

EMPTY_FRAMES = 9
"""Frames of the empty room whose median becomes the recorded background."""
MIDDLE = 0.52
"""Share of the subject's height at which an untilted choice of the camera aims: the middle of the body."""


@dataclass(frozen=True)
class SimulatedFrame:
    """One frame and its truth.

    Attributes
    ----------
    depth : uint16 (H, W), millimetres along z, 0 = no measurement
    joints : float32 (20, 3), true reported joints, metres, camera frame
    subject : bool (H, W), pixels that measure the subject
    timestamp : seconds
    """

    depth: np.ndarray
    joints: np.ndarray
    subject: np.ndarray
    timestamp: float


@dataclass(frozen=True, eq=False)
class Simulation:
    """A subject that moves before a sensor.

    Attributes
    ----------
    body : the subject
    clip : its poses in the clip's world frame, at the recording's frame rate
    view : the camera's place
    sensor : the camera and its noise
    furnished : True: the depth shows a room, `background` the empty room. False: all that is not the subject is 0
    seed : of all noise
    """

    body: Body
    clip: PoseClip
    view: View
    sensor: Sensor
    furnished: bool = True
    seed: int = 0

    @cached_property
    def _rays(self) -> Camera:
        """The camera of the sensor's rays, of which a pixel may have several."""
        return self.sensor.camera.scaled(self.sensor.rays_per_side)

    @cached_property
    def _room(self) -> Surface:
        """The room without the subject."""
        joints = self.view.to_level(self.body.joint_positions(self.clip.poses)).reshape(-1, 3)
        floor = self.view.to_level(np.array([0.0, floor_of(self.body, self.clip), 0.0]))[1]
        vertices, faces = room(np.array([joints.min(axis=0), joints.max(axis=0)]), float(floor))
        hits = cast(vertices @ self.view.R_level_camera, faces, self._rays)
        nothing = np.zeros(hits.depth.shape, dtype=bool)
        return Surface(hits.depth, self._cosines(hits, ~nothing).reshape(nothing.shape), nothing)

    def background(self) -> np.ndarray | None:
        """Depth of the empty room, uint16 (H, W) millimetres, median of a few noisy frames; None if not furnished."""
        if not self.furnished:
            return None
        rng = np.random.default_rng([self.seed, 1])
        frames = [self.sensor.measure(self._room, rng)[0] for _ in range(EMPTY_FRAMES)]
        return np.median(frames, axis=0).astype(np.uint16)

    def frames(self) -> Iterator[SimulatedFrame]:
        """Frame after frame, always the same for the same seed."""
        rng = np.random.default_rng([self.seed, 0])
        joints = self.view.to_camera(self.body.joint_positions(self.clip.poses)).astype(np.float32)
        for i, (pose, truth) in enumerate(zip(self.clip.poses, joints, strict=True)):
            depth, subject = self.sensor.measure(self._surface(pose), rng)
            if not self.furnished:
                depth = np.where(subject, depth, 0).astype(np.uint16)
            yield SimulatedFrame(depth, truth, subject & (depth > 0), i / self.clip.frame_rate)

    def _surface(self, pose: np.ndarray) -> Surface:
        vertices = self.view.to_camera(self.body.vertex_positions(pose))
        hits = cast(vertices, self.body.faces, self._rays)
        behind = self._room
        subject = (hits.depth > 0) & ((behind.depth == 0) | (hits.depth <= behind.depth))
        depth, cosine = behind.depth.copy(), behind.cosine.copy()
        depth[subject] = hits.depth[subject]
        cosine[subject] = self._cosines(hits, subject)
        return Surface(depth, cosine, subject)

    def _cosines(self, hits: Hits, where: np.ndarray) -> np.ndarray:
        """Cosines between rays and normals at the pixels `where` (N,): float32, negative ones as 0."""
        rays, normals = self._rays.rays()[where], hits.normals[where]
        towards = -(normals[:, :2] * rays).sum(axis=1) - normals[:, 2]
        return np.clip(towards / np.sqrt(1.0 + (rays**2).sum(axis=1)), 0.0, 1.0).astype(np.float32)


def floor_of(body: Body, clip: PoseClip) -> float:
    """Height of the floor in a clip's world (metres): the lowest point of the body in at most 100 of its frames."""
    rows = np.linspace(0, len(clip) - 1, min(len(clip), 100)).astype(int)
    return min(float(body.vertex_positions(clip.poses[row])[:, 1].min()) for row in rows)


def facing_of(pose: np.ndarray) -> float:
    """Yaw of a pose's facing about +y from +z, radians."""
    from scipy.spatial.transform import Rotation

    facing = Rotation.from_rotvec(pose[skeleton.ROOT_ROTATION]).as_matrix()[:, 2]
    return float(np.arctan2(facing[0], facing[2]))


def subject_of(body: str | Sequence[float] | Body, subject_seed: int | None = None) -> Body:
    """The subject that `--body NAME|SHAPE` means: a name, coefficients (also as text with commas), or a body as it is.

    Raises
    ------
    BodyError
        The name is unknown or the coefficients do not fit.
    """
    if isinstance(body, Body):
        return body
    if isinstance(body, str) and "," in body:
        try:
            body = [float(word) for word in body.split(",")]
        except ValueError:
            raise UsageError(f"the shape {body!r} is no list of numbers; write for example 1.0,-0.5") from None
    return subject_body(body, seed=subject_seed)


def prepare(
    clip: str | Path | PoseClip,
    *,
    body: str | Sequence[float] | Body = "neutral",
    sensor: str | Sensor = "tof",
    distance: float = 3.0,
    height: float = 1.0,
    tilt: float | None = None,
    yaw: float = 0.0,
    seed: int = 0,
    frame_rate: float = 30.0,
    furnished: bool = True,
    subject_seed: int | None = None,
) -> Simulation:
    """Everything placed, nothing simulated yet. Arguments as in `simulate_recording`."""
    if not 0 < frame_rate < np.inf:
        raise UsageError(f"a frame rate of {frame_rate} is impossible; give frames a second, for example 30")
    subject = subject_of(body, subject_seed)
    if isinstance(clip, PoseClip):
        poses = clip.every(frame_rate)
    else:
        poses = retarget(read_clip(clip).resampled(frame_rate), subject)
    floor = floor_of(subject, poses)
    centre = np.array([*np.mean(poses.poses[:, :3], axis=0)])
    centre[1] = floor
    if tilt is None:
        pitch = float(np.arctan2(height - MIDDLE * subject.height, distance))
    else:
        pitch = float(np.deg2rad(tilt))
    view = place_camera(
        centre, facing_of(poses.poses[0]), distance=distance, height=height, tilt=pitch, yaw=float(np.deg2rad(yaw))
    )
    return Simulation(subject, poses, view, make_sensor(sensor) if isinstance(sensor, str) else sensor, furnished, seed)


def simulate_recording(
    clip: str | Path | PoseClip,
    output: str | Path,
    *,
    body: str | Sequence[float] | Body = "neutral",
    sensor: str | Sensor = "tof",
    distance: float = 3.0,
    height: float = 1.0,
    tilt: float | None = None,
    yaw: float = 0.0,
    seed: int = 0,
    frame_rate: float = 30.0,
    furnished: bool = True,
    subject_seed: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Recording:
    """Simulate a depth recording with exact joints and write it as NPZ (`depthmocap simulate`).

    Parameters
    ----------
    clip : a mocap file, or poses of the subject
    output : the NPZ file to write
    body : name or shape coefficients of a full-resolution subject, or any body
    sensor : `tof` (176 x 144), `kinect` (320 x 240), or a sensor of your own
    distance : metres, horizontally, from the camera to the mean place of the subject
    height : metres of the camera above the floor
    tilt : degrees downwards; None aims at the middle of the body
    yaw : degrees by which the subject is turned to its left in the first frame; 0 faces the camera
    seed : of the sensor's noise
    frame_rate : frames a second of the recording; mocap is resampled, poses are thinned out
    furnished : whether the recording shows a room (and holds its empty background) or the subject only
    subject_seed : seed of local deformations of the subject outside the shape space; None for none
    progress : called with the number of frames done and the number of all frames

    Returns
    -------
    The recording, opened for reading.

    Raises
    ------
    MocapError
        The clip cannot be read or retargeted.
    BodyError, UsageError
        An argument is unknown or out of range.
    OutputError
        The file cannot be written.
    """
    simulation = prepare(
        clip, body=body, sensor=sensor, distance=distance, height=height, tilt=tilt, yaw=yaw, seed=seed,
        frame_rate=frame_rate, furnished=furnished, subject_seed=subject_seed,
    )  # fmt: skip
    with RecordingWriter(
        output, simulation.sensor.camera, background=simulation.background(), up_camera=simulation.view.up_camera
    ) as writer:
        for i, frame in enumerate(simulation.frames()):
            writer.append(frame.depth, frame.timestamp, joints=frame.joints)
            if progress is not None:
                progress(i + 1, len(simulation.clip))
    return open_recording(output)
