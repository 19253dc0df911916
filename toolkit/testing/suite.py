"""The simulated suite: people who are not the tracker's body, before two sensors, with exact truth.

Five groups of takes: basic, fast (kicks, throws, hops, jogs), turn (the subject is spun about the vertical by 180 to
360 degrees, by construction), side (seen from 45 to 90 degrees) and low (squats, bends, the floor). The database is
made of CMU without the subjects 02 and 49 and of HDM05 actor bd; the `tune` split of HDM05 actor bk; the `report`
split, for reporting only, of HDM05 actor dg and the CMU subjects 02 and 49, of whose acrobatics a cartwheel (49_06,
unspun, in turn) takes part.

Who travels walks on a treadmill: the slow part of the path over the floor is taken away, so that the subject stays in
the image. Clips shorter than 60 frames are played forwards and backwards. The camera stands as near as the whole motion
stays in the image, times `room`. Where the mocap is absent, bundled `database` and `subject` motions take its place.

Recordings and databases are kept in a work folder, under names that change with everything they are made from.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from database_builder.build import THRESHOLD, Sampling, build_database
from database_builder.regressor import RegressorSettings
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SUBJECT_MOTIONS, procedural_clips
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.progress import Progress, silent
from toolkit.sensing.camera import Camera
from toolkit.simulation.person import Person, mean_place, prepare_person, turned
from toolkit.simulation.scene import place_camera
from toolkit.simulation.sensors import make_sensor
from toolkit.simulation.simulate import MIDDLE, simulate_recording

ROOT = Path(__file__).resolve().parents[2]
MOCAP = ROOT.parent / "shared" / "data" / "mocap"
WORK = ROOT / "benchmarks" / ".work"

GROUPS = ("basic", "fast", "turn", "side", "low")
RATE = 30.0
SHORTEST, LONGEST = 60, 130
"""Frames of a take."""
TREADMILL = 0.8
"""Metres of travel over the floor above which the subject is kept in place."""
SLOW = 0.5
"""Seconds: standard deviation of the Gaussian that tells the path from the swaying."""
MARGIN = 0.14
"""Metres from a joint to the outline of a body, at most."""


@dataclass(frozen=True)
class Take:
    """A recording of the suite before it is made.

    Attributes
    ----------
    group : out of `GROUPS`
    motion : `bk_squat_013` (HDM05 actor, motion, number), `02_05` (CMU) or `bundled_archery` (procedural)
    body, sensor : names of the subject and of the sensor
    yaw : degrees by which the subject is turned to its left in the first frame
    spin : degrees by which it is turned further, evenly until the last frame
    height : metres of the camera above the floor; it looks at the middle of a standing body
    room : factor on the smallest distance at which the motion fits into the image
    furnished : before the furniture of a room, whose empty background is recorded
    start : seconds of the motion that are skipped
    seed : of local deformations of the subject, of noise and of procedural variations
    """

    group: str
    motion: str
    body: str
    sensor: str = "tof"
    yaw: float = 0.0
    spin: float = 0.0
    height: float = 1.0
    room: float = 1.05
    furnished: bool = False
    start: float = 0.0
    seed: int = 0

    @property
    def name(self) -> str:
        """What the recording is called."""
        return f"{self.group}_{self.motion}_{self.body}_{self.sensor}"


TUNE = (
    Take("basic", "bk_rotateArms_005", "slim_male", height=1.4),
    Take("basic", "bk_rotateArms_007", "heavy_female", "kinect", yaw=-15, room=1.3),
    Take("basic", "bk_grabHigh_009", "tall_male", "kinect", height=0.7),
    Take("basic", "bk_elbowToKnee_008", "short_female", yaw=10, height=1.9),
    Take("basic", "bk_sneak_004", "teenager", "kinect", yaw=20, height=1.3, furnished=True),
    Take("basic", "bk_throwBasketball_004", "child", height=1.1),
    Take("fast", "bk_kick_009", "athletic_male", "kinect", height=1.6),
    Take("fast", "bk_kick_011", "slim_female", yaw=-25),
    Take("fast", "bk_throwBasketball_006", "heavy_male", "kinect", yaw=15, height=2.1, room=1.2),
    Take("fast", "bk_hop_016", "child", "kinect", height=0.8),
    Take("fast", "bk_hop_018", "tall_male", yaw=30, height=1.2),
    Take("fast", "bk_kick_007", "elderly", "kinect", yaw=20, furnished=True),
    Take("turn", "bk_grabHigh_010", "average_male", spin=360, height=1.2),
    Take("turn", "bk_sneak_005", "heavy_female", "kinect", spin=-360, height=1.6),
    Take("turn", "bk_throwBasketball_005", "slim_male", "kinect", yaw=-30, spin=270),
    Take("turn", "bk_jog_004", "short_female", spin=-200, height=0.8, room=1.2),
    Take("turn", "bk_elbowToKnee_012", "tall_male", "kinect", yaw=40, spin=-180, furnished=True),
    Take("turn", "bk_depositFloor_008", "teenager", spin=360, height=1.4),
    Take("side", "bk_rotateArms_006", "average_female", "kinect", yaw=60, height=1.2),
    Take("side", "bk_kick_010", "heavy_male", yaw=-45),
    Take("side", "bk_grabHigh_008", "slim_female", "kinect", yaw=-75, height=1.8),
    Take("side", "bk_sneak_004", "athletic_male", yaw=90, height=1.1),
    Take("side", "bk_throwBasketball_005", "child", "kinect", yaw=50, room=1.3),
    Take("low", "bk_squat_013", "heavy_male", "kinect", height=1.4),
    Take("low", "bk_squat_020", "child", yaw=20),
    Take("low", "bk_depositFloor_009", "slim_male", "kinect", yaw=-20, height=1.7, furnished=True),
    Take("low", "bk_depositFloor_010", "average_female", yaw=30, height=1.2),
    Take("low", "bk_lieDownFloor_006", "tall_male", "kinect", yaw=15, height=1.6, start=0.5),
    Take("low", "bk_lieDownFloor_008", "short_female", yaw=-30, height=2.2, start=0.5),
)
REPORT = (
    Take("basic", "dg_rotateArms_009", "athletic_male", "kinect", height=1.3),
    Take("basic", "dg_grabHigh_015", "elderly", yaw=15, height=1.6),
    Take("basic", "dg_elbowToKnee_016", "heavy_male", "kinect", yaw=-10, furnished=True),
    Take("basic", "02_01", "child", "kinect", yaw=20, height=1.1),
    Take("basic", "49_10", "slim_female", height=0.9, start=2.0),
    Take("basic", "02_07", "average_male", "kinect", yaw=-25, height=1.8, start=4.0, room=1.2),
    Take("fast", "dg_kick_016", "heavy_female", "kinect", height=1.2),
    Take("fast", "dg_kick_018", "child", yaw=25, height=1.0),
    Take("fast", "dg_hop_022", "slim_male", "kinect", yaw=-20, height=1.5),
    Take("fast", "02_05", "tall_male", yaw=10, start=3.0),
    Take("fast", "02_04", "teenager", "kinect", height=0.7, room=1.2),
    Take("fast", "49_02", "short_female", "kinect", yaw=-30, start=4.0, furnished=True),
    Take("turn", "dg_throwBasketball_008", "average_female", spin=360, height=1.3),
    Take("turn", "02_03", "heavy_male", "kinect", yaw=30, spin=-270, height=1.5),
    Take("turn", "49_01", "teenager", spin=-360, height=0.9),
    Take("turn", "dg_sneak_008", "slim_female", "kinect", spin=360, furnished=True),
    Take("turn", "dg_jog_010", "tall_male", "kinect", spin=200, room=1.2),
    Take("turn", "49_06", "athletic_male", "kinect", height=1.2),
    Take("side", "02_02", "elderly", "kinect", yaw=90, height=1.2),
    Take("side", "dg_kick_014", "average_male", yaw=-60),
    Take("side", "dg_grabHigh_014", "child", "kinect", yaw=45, height=1.6),
    Take("side", "49_03", "heavy_female", yaw=70, start=3.0),
    Take("side", "02_08", "slim_male", "kinect", yaw=-50, start=2.0, room=1.3),
    Take("low", "dg_squat_027", "short_female", "kinect", height=1.5),
    Take("low", "dg_squat_034", "athletic_male", yaw=-25),
    Take("low", "dg_depositFloor_017", "heavy_male", "kinect", yaw=25, height=1.8, furnished=True),
    Take("low", "02_06", "child", yaw=-15, height=1.3, start=5.0),
    Take("low", "dg_lieDownFloor_012", "slim_male", "kinect", yaw=20, height=1.6),
    Take("low", "dg_lieDownFloor_013", "elderly", yaw=-20, height=2.0),
)
BODIES = ("slim_male", "heavy_female", "tall_male", "child", "short_female", "heavy_male", "teenager", "slim_female")


def has_mocap() -> bool:
    """Whether the suite is made of real mocap."""
    return MOCAP.is_dir()


def takes(split: str) -> tuple[Take, ...]:
    """The takes of `tune` or `report`; of bundled motions where there is no mocap."""
    chosen = {"tune": TUNE, "report": REPORT}[split] if has_mocap() else _bundled(first=0 if split == "tune" else 100)
    return tuple(replace(take, seed=take.seed + i + (0 if split == "tune" else 100)) for i, take in enumerate(chosen))


def _bundled(first: int) -> tuple[Take, ...]:
    """Takes of the bundled `subject` motions: basic and fast from the front, turning, from the side, and low."""
    found = []
    for i, motion in enumerate(name for name in SUBJECT_MOTIONS if name != "half_squat_reach"):
        common: dict[str, Any] = {
            "motion": f"bundled_{motion}",
            "sensor": ("tof", "kinect")[i % 2],
            "height": (1.0, 1.6, 0.7)[i % 3],
        }
        for k, (group, yaw, spin) in enumerate(
            (("basic", 10, 0), ("fast", -20, 0), ("turn", 0, (360, -360)[i % 2]), ("side", (45, -60, 90)[i % 3], 0))
        ):
            body = BODIES[(2 * i + 3 * k + first) % len(BODIES)]
            found.append(Take(group, body=body, yaw=yaw, spin=spin, furnished=i == k, seed=first, **common))
    low = [("low", yaw, BODIES[(i + first) % len(BODIES)]) for i, yaw in enumerate((0, 25, -30, 45))]
    found += [
        Take(group, "bundled_half_squat_reach", body, ("tof", "kinect")[i % 2], yaw=yaw, seed=first)
        for i, (group, yaw, body) in enumerate(low)
    ]
    return tuple(found)


def chosen_takes(split: str, groups: Sequence[str] = (), count: int | None = None) -> list[Take]:
    """Takes of a split, of some groups only, and of each group at most `count`."""
    wanted = groups or GROUPS
    by_group = {group: [take for take in takes(split) if take.group == group] for group in wanted}
    return [take for group in wanted for take in by_group[group][:count]]


def record(take: Take, work: Path, frames: int = LONGEST, *, color: bool = False) -> Path:
    """The take as a recording of at most `frames` frames in `work`, made if it is not there yet; in colour if asked."""
    made_by = (performed, cut, in_place, spun, motion_of, motion_files, distance_needed)
    digest = digest_of(made_by, ["toolkit/simulation", "toolkit/mocap", "toolkit/body"], take, frames)
    path = work / "recordings" / f"{take.name}_{'color_' if color else ''}{digest}.npz"
    if not path.exists():
        body = subject_body(take.body, seed=take.seed)
        clip = performed(take, body, frames)
        distance = take.room * distance_needed(take, body, clip, make_sensor(take.sensor).camera)
        simulate_recording(
            clip, path, body=body, sensor=take.sensor, distance=distance, height=take.height, yaw=take.yaw,
            seed=take.seed, furnished=take.furnished, color=color,
        )  # fmt: skip
    return path


def performed(take: Take, body: Body, frames: int) -> PoseClip:
    """The motion on the subject's body: cut, in place, spun."""
    clip = motion_of(take.motion, body, seed=take.seed, fast=take.group == "fast")
    poses = in_place(cut(clip.poses, take.start, frames))
    return PoseClip(take.name, spun(poses, take.spin), RATE, clip.source)


def cut(poses: np.ndarray, start: float, frames: int, shortest: int = SHORTEST) -> np.ndarray:
    """At most `frames` poses (T, P) from `start` seconds on; fewer than `shortest` are played there and back."""
    poses = poses[round(start * RATE) :]
    if len(poses) < shortest:
        there_and_back = np.concatenate([poses, poses[-2:0:-1]])
        poses = np.tile(there_and_back, (-(-shortest // len(there_and_back)), 1))[:shortest]
    return poses[:frames].copy()


def in_place(poses: np.ndarray) -> np.ndarray:
    """Poses (T, P) of a person who travels as if on a treadmill; of any other as they are."""
    poses = poses.copy()
    floor_path = poses[:, [0, 2]]
    if np.ptp(floor_path, axis=0).max() > TREADMILL:
        poses[:, [0, 2]] -= gaussian_filter1d(floor_path, SLOW * RATE, axis=0, mode="nearest")
    return poses


def spun(poses: np.ndarray, degrees: float) -> np.ndarray:
    """Poses (T, P) turned about the vertical through their mean place, evenly up to `degrees` in the last one."""
    middle = mean_place(poses)
    return turned(poses, np.deg2rad(np.linspace(0.0, degrees, len(poses)))[:, None], middle, middle)


def motion_of(motion: str, body: Body, *, seed: int = 0, fast: bool = False) -> PoseClip:
    """A motion on a body at `RATE`: `bk_squat_013`, `02_05` or `bundled_archery`, which may be fast (by a half)."""
    kind, _, name = motion.partition("_")
    if kind == "bundled":
        return procedural_clips([name], rate=RATE / 1.5 if fast else RATE, body=body, seed=seed)[0]
    (path,) = motion_files(motion)
    clip = read_clip(path)
    if kind.isdigit():
        clip = clip.sliced(1, len(clip))  # the first frame of CMU clips is a T-pose and no motion
    return retarget(clip.resampled(RATE), body)


def motion_files(motion: str) -> list[Path]:
    """Files that `bk_squat_013` or `02_05` may mean; it should be one."""
    actor, _, rest = motion.partition("_")
    if actor.isdigit():
        return list(MOCAP.glob(f"cmu/{motion}.bvh"))
    name, _, number = rest.partition("_")
    return list(MOCAP.glob(f"hdm05/HDM_{actor}_{name}*_{number}_120.amc"))


def distance_needed(take: Take, body: Body, clip: PoseClip, camera: Camera) -> float:
    """Smallest distance in metres, in steps of 10 cm, at which all of the motion is in the image."""
    person = prepare_person(Person(clip, body, yaw=take.yaw), RATE, np.random.default_rng(0))
    joints = body.joint_positions(person.poses).reshape(-1, 3)
    for distance in np.arange(1.8, 7.0, 0.1):
        tilt = float(np.arctan2(take.height - MIDDLE * body.height, distance))
        view = place_camera(distance=float(distance), height=take.height, tilt=tilt)
        seen = view.to_camera(joints)
        border = camera.fx * MARGIN / np.maximum(seen[:, 2], 1e-3)
        pixels = camera.project(seen)
        inside = (pixels >= border[:, None]) & (pixels <= np.array([camera.width, camera.height]) - 1 - border[:, None])
        if (seen[:, 2] > 0.8).all() and inside.all():
            return float(distance)
    return 7.0


def database(
    work: Path, threshold: float = THRESHOLD, parts: RegressorSettings | None = None, progress: Progress = silent
) -> Path:
    """The pose database of the suite, with its joint regressor, made if it is not there yet."""
    parts = parts or RegressorSettings()
    made_from = ["database_builder", "toolkit/mocap", "toolkit/body", "toolkit/landmarks", "toolkit/database"]
    path = work / "databases" / f"poses_{digest_of([database_sources], made_from, threshold, parts)}.npz"
    if not path.exists():
        build_database(database_sources(), path, Sampling(threshold), parts=parts, progress=progress)
    return path


def database_sources() -> list[Path] | None:
    """Mocap of the actors who are in no take; None where there is no mocap."""
    if not has_mocap():
        return None
    cmu = [p for p in sorted(MOCAP.glob("cmu/*.bvh")) if p.stem.split("_")[0] not in ("02", "49")]
    return [*cmu, *sorted(MOCAP.glob("hdm05/HDM_bd_*.amc"))]


def digest_of(functions: Iterable[Callable[..., Any]], folders: Iterable[str], *settings: object) -> str:
    """Ten digits that change with the settings and with any source or asset that the result is made by."""
    digest = hashlib.sha256(repr((settings, has_mocap())).encode())
    for function in functions:
        digest.update(inspect.getsource(function).encode())
    files = [
        p for folder in folders for p in sorted((ROOT / folder).rglob("*")) if p.suffix in (".py", ".npz", ".yaml")
    ]
    for path in files:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:10]
