"""Simulation of depth recordings with exact truth: any clips, bodies and cameras, two sensors, furniture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.errors import UsageError
from toolkit.io.files import check_output
from toolkit.io.progress import Count, silent
from toolkit.mocap.clip import PoseClip
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording
from toolkit.simulation.appearance import Appearance, vertex_colors
from toolkit.simulation.furniture import Box, boxes_mesh
from toolkit.simulation.mesh import Mesh, joined
from toolkit.simulation.person import (
    PosedSubject,
    SimulatedPerson,
    check_apart,
    check_clear,
    check_ranges,
    furniture_of,
    prepare_person,
)
from toolkit.simulation.picture import FINER, Backdrop
from toolkit.simulation.raycast import Hits, cast
from toolkit.simulation.scene import PlacedCamera, RoomMaker, Scenery, cut_tilt, place_camera, surroundings
from toolkit.simulation.seating import neck_height
from toolkit.simulation.sensors import Sensor, Surface, make_sensor

AIM_HEIGHT = 0.52
"""Height at which a camera without a given tilt aims, as a fraction of the subject's stature."""
RANGES: dict[str, tuple[float, float, str]] = {
    "frame_rate": (0.1, 1000.0, "frames a second of depth cameras"),
    "distance": (0.1, 60.0, "metres, as far as depth is stored"),
    "height": (0.01, 60.0, "metres above the floor"),
    "tilt": (-90.0, 90.0, "degrees"),
    "cut": (-5.0, 5.0, "metres below the neck"),
    "seconds": (1e-3, 86_400.0, "seconds, a day at most"),
}
"""Inclusive ranges of the numbers of `CaptureSettings`, with their unit."""


@dataclass(frozen=True, kw_only=True)
class CaptureSettings:
    """Settings of a simulated recording.

    Attributes
    ----------
    sensor : `tof` (176 x 144) or `kinect` (320 x 240), or a sensor with other noise
    distance : metres, horizontally, from the camera to the origin of the floor plan
    height : metres of the camera above the floor; None is the height of the first person's neck
    tilt : degrees downwards; None aims at the middle of the first person's body
    cut : metres below the first person's neck of the lower image border, instead of a tilt; None truncates no person
    frame_rate : frames a second of the recording; mocap is resampled, poses are thinned out
    furnished : the recording contains the room; False: people only (already segmented)
    background : a furnished recording has the depth of its room without people
    room : function that makes the room around the people; None is a bare room
    boxes : furniture of the room, on the floor plan
    seconds : length of a recording without people
    seed : seed of the sensor's noise, of sitting postures and of colours
    color : the recording has colour, registered to the depth, of people in a room
    skinning : function for the mesh (V, 3) of a body in a pose (P,); trackers use the linear one

    Raises
    ------
    UsageError
        A number is out of range.
    """

    sensor: str | Sensor = "tof"
    distance: float = 3.0
    height: float | None = 1.0
    tilt: float | None = None
    cut: float | None = None
    frame_rate: float = 30.0
    furnished: bool = True
    background: bool = True
    room: RoomMaker | None = None
    boxes: tuple[Box, ...] = ()
    seconds: float = 3.0
    seed: int = 0
    color: bool = False
    skinning: Callable[[Body, np.ndarray], np.ndarray] = Body.vertex_positions

    def __post_init__(self) -> None:
        check_ranges(self, RANGES)
        if self.cut is not None and self.tilt is not None:
            raise UsageError(f"a cut of {self.cut} m and a tilt of {self.tilt} exclude each other; give one")
        if self.room is not None and not self.furnished:
            raise UsageError("the room is removed with the background; leave out one of the two")
        if self.seed < 0:
            raise UsageError(f"the seed {self.seed} is negative; give a whole number from 0 on")


@dataclass(frozen=True)
class SimulatedFrame:
    """Simulated frame with its truth.

    Attributes
    ----------
    depth : uint16 (H, W), millimetres along z, 0 = no measurement
    joints : float32 (N, 20, 3), true reported joints, metres, camera frame; NaN for absent people
    person : int16 (H, W), number of the person in a pixel, -1 = no person
    timestamp : seconds
    color : uint8 (H, W, 3), RGB registered to the depth, or None
    """

    depth: np.ndarray
    joints: np.ndarray
    person: np.ndarray
    timestamp: float
    color: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Simulation:
    """Simulated scene of people in front of a sensor.

    Attributes
    ----------
    shot : settings of the recording
    performers : people on the floor plan
    furniture : furniture around them
    view : position of the camera
    sensor : depth sensor
    frames_in_all : length of the recording
    frame_rate : frames a second
    """

    shot: CaptureSettings
    performers: tuple[PosedSubject, ...]
    furniture: Mesh
    view: PlacedCamera
    sensor: Sensor
    frames_in_all: int
    frame_rate: float

    @cached_property
    def _rays(self) -> Camera:
        """Camera of the sensor's rays, of which a pixel may have several."""
        return self.sensor.camera.scaled(self.sensor.rays_per_side)

    @cached_property
    def _surroundings(self) -> Scenery:
        """The room without people, camera frame."""
        used = [p.body.joint_positions(p.poses).reshape(-1, 3) for p in self.performers]
        empty_reach = np.array([[-0.8, 0.0, -0.5], [0.8, 1.8, 0.5]])  # corners of the space of a person, metres
        return surroundings(self.shot.room, used or [empty_reach], self.furniture, self.view)

    @cached_property
    def _room(self) -> Surface:
        """Surface of the room without people."""
        hits = cast(self._surroundings.mesh.vertices, self._surroundings.mesh.faces, self._rays)
        everywhere = np.ones(hits.depth.shape, dtype=bool)
        cosines = self._cosines(hits, everywhere).reshape(everywhere.shape)
        no_person = np.full(everywhere.shape, -1, dtype=np.int16)
        return Surface(hits.depth, cosines, no_person, self._surroundings.reflectance_of(hits.triangles))

    @cached_property
    def _backdrop(self) -> Backdrop:
        """Colour image of the room without people."""
        camera = self.sensor.camera.scaled(FINER)
        hits = cast(self._surroundings.mesh.vertices, self._surroundings.mesh.faces, camera)
        return Backdrop.of_room(hits, camera, self.view, np.random.default_rng([self.shot.seed, 4]))

    @cached_property
    def _skins(self) -> tuple[np.ndarray, ...]:
        """Vertex colours of each person."""
        looks = (Appearance.drawn(np.random.default_rng([self.shot.seed, 5, i])) for i in range(len(self.performers)))
        return tuple(vertex_colors(p.body, look, p.hanging) for p, look in zip(self.performers, looks, strict=True))

    def background(self) -> np.ndarray | None:
        """Return the depth of the empty room, uint16 (H, W) millimetres; None if not furnished.

        The background is the median of a few noisy frames.
        """
        if not self.shot.furnished:
            return None
        rng = np.random.default_rng([self.shot.seed, 1])
        empty_frames = 9  # number of frames of the empty room whose median becomes the recorded background
        frames = [self.sensor.measure(self._room, rng)[0] for _ in range(empty_frames)]
        return np.median(frames, axis=0).astype(np.uint16)

    def frames(self) -> Iterator[SimulatedFrame]:
        """Yield the frames, equal for equal seeds."""
        rng, painter = (np.random.default_rng([self.shot.seed, k]) for k in (0, 3))
        joints = self.joints()
        for i in range(self.frames_in_all):
            present = self._present(i)
            depth, person = self.sensor.measure(self._surface(present, self._things(i)), rng)
            if not self.shot.furnished:
                depth = np.where(person >= 0, depth, 0).astype(np.uint16)
            measured = np.where(depth > 0, person, -1).astype(np.int16)
            color = self._picture(present, painter) if self.shot.color else None
            yield SimulatedFrame(depth, joints[:, i], measured, i / self.frame_rate, color)

    def joints(self) -> np.ndarray:
        """Return the true joints of all people, float32 (N, T, 20, 3), metres, camera frame, NaN while absent."""
        joints = np.full((len(self.performers), self.frames_in_all, len(skeleton.REPORTED), 3), np.nan, np.float32)
        for own, p in zip(joints, self.performers, strict=True):
            own[p.first : p.end] = self.view.to_camera(p.body.joint_positions(p.poses))
        return joints

    def _present(self, frame: int) -> dict[int, np.ndarray]:
        """Return the vertices (V, 3) of the people in a frame, camera frame, by their number."""
        return {
            i: self.view.to_camera(self.shot.skinning(p.body, p.poses[frame - p.first]))
            for i, p in enumerate(self.performers)
            if p.first <= frame < p.end
        }

    def _picture(self, present: Mapping[int, np.ndarray], rng: np.random.Generator) -> np.ndarray:
        people = [Mesh(at, self.performers[i].body.faces, self._skins[i]) for i, at in present.items()]
        return self._backdrop.with_people(people, rng)

    def _things(self, frame: int) -> list[Mesh]:
        """Return the held objects in a frame, camera frame."""
        held = [p.held_thing(frame) for p in self.performers if p.first <= frame < p.end]
        return [Mesh(self.view.to_camera(thing.vertices), thing.faces) for thing in held if thing is not None]

    def _surface(self, present: Mapping[int, np.ndarray], things: Sequence[Mesh]) -> Surface:
        """Return the nearest surface of people, held objects and room."""
        behind = self._room
        depth, cosine, person = behind.depth.copy(), behind.cosine.copy(), behind.person.copy()
        reflectance = None if behind.reflectance is None else behind.reflectance.copy()
        seen = [(i, Mesh(vertices, self.performers[i].body.faces)) for i, vertices in present.items()]
        for i, mesh in [*seen, *((-1, thing) for thing in things)]:
            hits = cast(mesh.vertices, mesh.faces, self._rays)
            nearer = (hits.depth > 0) & ((depth == 0) | (hits.depth <= depth))
            depth[nearer] = hits.depth[nearer]
            cosine[nearer] = self._cosines(hits, nearer)
            person[nearer] = i
            if reflectance is not None:
                reflectance[nearer] = 1.0
        return Surface(depth, cosine, person, reflectance)

    def _cosines(self, hits: Hits, where: np.ndarray) -> np.ndarray:
        """Return cosines between rays and normals at the pixels `where` (N,): float32; both sides of a face count."""
        rays, normals = self._rays.rays()[where], hits.normals[where]
        towards = np.abs((normals[:, :2] * rays).sum(axis=1) + normals[:, 2])
        return np.clip(towards / np.sqrt(1.0 + (rays**2).sum(axis=1)), 0.0, 1.0).astype(np.float32)


def prepare(people: Sequence[SimulatedPerson], shot: CaptureSettings | None = None) -> Simulation:
    """Place people, furniture and camera of a scene. Arguments and errors as in `simulate_scene`."""
    shot = shot or CaptureSettings()
    rate = min([shot.frame_rate, *(p.clip.frame_rate for p in people if isinstance(p.clip, PoseClip))])
    performers = tuple(
        prepare_person(person, rate, np.random.default_rng([shot.seed, 2, i])) for i, person in enumerate(people)
    )
    check_apart(performers)
    check_clear(performers, shot.boxes)
    pieces = [furniture_of(person, performer) for person, performer in zip(people, performers, strict=True)]
    sensor = make_sensor(shot.sensor) if isinstance(shot.sensor, str) else shot.sensor
    return Simulation(
        shot,
        performers,
        joined([*pieces, boxes_mesh(shot.boxes)]),
        _view(people, performers, shot, sensor.camera),
        sensor,
        max((p.end for p in performers), default=max(1, round(shot.seconds * rate))),
        rate,
    )


def _view(
    people: Sequence[SimulatedPerson], performers: Sequence[PosedSubject], shot: CaptureSettings, camera: Camera
) -> PlacedCamera:
    """Return the position of the camera: its height and tilt."""
    stature, neck = 1.7, 1.4  # metres, of a reference person in an empty room
    if performers:
        body = performers[0].body
        stature, neck = body.height, neck_height(body, seated=people[0].seated)
    height = neck if shot.height is None else shot.height
    tilt = np.arctan2(height - AIM_HEIGHT * stature, shot.distance)
    if shot.tilt is not None:
        tilt = np.deg2rad(shot.tilt)
    elif shot.cut is not None:
        tilt = cut_tilt(camera, height, shot.distance, neck - shot.cut)
    return place_camera(distance=shot.distance, height=height, tilt=float(tilt))


def simulate_scene(
    people: Sequence[SimulatedPerson],
    output: str | Path,
    shot: CaptureSettings | None = None,
    *,
    progress: Count = silent,
) -> Recording:
    """Simulate a depth recording with exact joints and write it as NPZ (`depthmocap simulate`).

    Parameters
    ----------
    people : any number of people; the true joints are (20, 3) a frame for one person and (N, 20, 3) otherwise
    output : NPZ file to write
    shot : settings of the recording
    progress : callback for the number of frames done

    Returns
    -------
    The recording, opened for reading.

    Raises
    ------
    MocapError
        A clip cannot be read or retargeted.
    BodyError, UsageError
        An argument is unknown or out of range, a person is inside another person or a box, or `output` is no .npz file
        or would overwrite a clip.
    OutputError
        The file cannot be written.
    """
    if Path(output).suffix != ".npz":
        raise UsageError(f"a recording is one .npz file, not {output}; choose a name such as take.npz")
    check_output(output, [person.clip for person in people if not isinstance(person.clip, PoseClip)])
    shot = shot or CaptureSettings()
    simulation = prepare(people, shot)
    background = simulation.background() if shot.background else None
    with RecordingWriter(
        output, simulation.sensor.camera, background=background, up_camera=simulation.view.up_camera
    ) as writer:
        for i, frame in enumerate(simulation.frames()):
            joints = frame.joints[0] if len(people) == 1 else frame.joints
            writer.append(frame.depth, frame.timestamp, color=frame.color, joints=joints)
            progress(i + 1, simulation.frames_in_all)
    return open_recording(output)


def simulate_recording(
    clip: str | Path | PoseClip,
    output: str | Path,
    *,
    body: str | Sequence[float] | Body = "neutral",
    yaw: float = 0.0,
    progress: Count = silent,
    **shot: Any,
) -> Recording:
    """Simulate one person with arguments of `SimulatedPerson` and keywords of `CaptureSettings`."""
    return simulate_scene(
        [SimulatedPerson(clip, body=body, yaw=yaw)], output, CaptureSettings(**shot), progress=progress
    )
