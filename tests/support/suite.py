"""Simulated suite: people with other bodies than the tracker's, two sensors, exact truth.

Five groups of takes: basic, fast (kicks, throws, hops, jogs), turn (the subject is spun about the vertical by 180 to
360 degrees, by construction), side (seen from 45 to 90 degrees) and low (squats, bends, the floor). The database is
made of CMU without the subjects 02 and 49 and of HDM05 actor bd; the `tune` split of HDM05 actor bk; the `report`
split, for reporting only, of HDM05 actor dg and the CMU subjects 02 and 49, of whose acrobatics a cartwheel (49_06,
unspun, in turn) takes part.

Who travels walks on a treadmill: the slow part of the path over the floor is taken away, so that the subject stays in
the image. Clips shorter than 60 frames are played forwards and backwards. The camera stands as near as the whole motion
stays in the image, times `spare`. Where the mocap is absent, bundled `database` and `subject` motions take its place.

Takes are scenes of one person. Recordings (`scenes.record_scene`) and databases are kept in a work folder, under names
that change with everything they are made from.
"""

import hashlib
import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from database_builder.build import SAMPLING_THRESHOLD, Sampling, build_database
from tests.support.casting import Actor, Scene, listed
from toolkit.body.body import Body
from toolkit.datasets.folder import data_folder
from toolkit.io.progress import Progress, silent
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SUBJECT_MOTIONS, procedural_clips
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.simulation.person import mean_place, turned

ROOT = Path(__file__).resolve().parents[2]
MOCAP = data_folder() / "mocap"
WORK = ROOT / "benchmarks" / ".work"

GROUPS = ("basic", "fast", "turn", "side", "low")
RATE = 30.0
SHORTEST, LONGEST = 60, 130
"""Frames of a take."""
TREADMILL = 0.8
"""Metres of travel over the floor above which the subject is kept in place."""
SLOW = 0.5
"""Standard deviation, seconds, of the Gaussian that separates the path from the swaying."""
BODIES = ("slim_male", "heavy_female", "tall_male", "child", "short_female", "heavy_male", "teenager", "slim_female")


def has_mocap() -> bool:
    """Return True if the suite is made of real mocap."""
    return MOCAP.is_dir()


def takes(split: str) -> tuple[Scene, ...]:
    """Return the takes of `tune` or `report`; of bundled motions if there is no mocap."""
    first = 0 if split == "tune" else 100
    chosen = listed("clean", split) if has_mocap() else _bundled(first)
    return tuple(replace(take, seed=take.seed + first + i) for i, take in enumerate(chosen))


def _bundled(first: int) -> list[Scene]:
    """Return takes of the bundled `subject` motions: basic and fast from the front, turning, from the side, and low."""
    found = []
    for i, motion in enumerate(name for name in SUBJECT_MOTIONS if name != "half_squat_reach"):
        sensor, height = ("tof", "kinect")[i % 2], (1.0, 1.6, 0.7)[i % 3]
        for k, (group, yaw, spin) in enumerate(
            (("basic", 10, 0), ("fast", -20, 0), ("turn", 0, (360, -360)[i % 2]), ("side", (45, -60, 90)[i % 3], 0))
        ):
            actor = Actor(f"bundled_{motion}", BODIES[(2 * i + 3 * k + first) % len(BODIES)], yaw=yaw, spin=spin)
            found.append(_take(group, actor, sensor, height, first, "background" if i == k else "cut"))
    for i, yaw in enumerate((0, 25, -30, 45)):
        actor = Actor("bundled_half_squat_reach", BODIES[(i + first) % len(BODIES)], yaw=yaw)
        found.append(_take("low", actor, ("tof", "kinect")[i % 2], 1.0, first))
    return found


def _take(group: str, actor: Actor, sensor: str, height: float, seed: int, view: str = "cut") -> Scene:
    return Scene(group, (actor,), sensor, distance=None, height=height, view=view, frames=LONGEST, seed=seed)


def chosen_takes(split: str, groups: Sequence[str] = (), count: int | None = None) -> list[Scene]:
    """Return the takes of a split, of some groups, at most `count` of each."""
    wanted = groups or GROUPS
    by_group = {group: [take for take in takes(split) if take.group == group] for group in wanted}
    return [take for group in wanted for take in by_group[group][:count]]


def cut(poses: np.ndarray, start: float, frames: int, shortest: int = SHORTEST) -> np.ndarray:
    """Return at most `frames` poses (T, P) from `start` seconds on; fewer than `shortest` are repeated in reverse."""
    poses = poses[round(start * RATE) :]
    if len(poses) < shortest:
        there_and_back = np.concatenate([poses, poses[-2:0:-1]])
        poses = np.tile(there_and_back, (-(-shortest // len(there_and_back)), 1))[:shortest]
    return poses[:frames].copy()


def in_place(poses: np.ndarray) -> np.ndarray:
    """Return poses (T, P) of a travelling person as on a treadmill; of any other unchanged."""
    poses = poses.copy()
    floor_path = poses[:, [0, 2]]
    if np.ptp(floor_path, axis=0).max() > TREADMILL:
        poses[:, [0, 2]] -= gaussian_filter1d(floor_path, SLOW * RATE, axis=0, mode="nearest")
    return poses


def spun(poses: np.ndarray, degrees: float) -> np.ndarray:
    """Return poses (T, P) rotated about the vertical through their mean place, evenly up to `degrees` in the last
    one.
    """
    middle = mean_place(poses)
    return turned(poses, np.deg2rad(np.linspace(0.0, degrees, len(poses)))[:, None], middle, middle)


def motion_of(motion: str, body: Body, *, seed: int = 0, fast: bool = False) -> PoseClip:
    """Return a motion on a body at `RATE`: `bk_squat_013`, `02_05` or `bundled_archery`, optionally 1.5 times as
    fast.
    """
    kind, _, name = motion.partition("_")
    if kind == "bundled":
        return procedural_clips([name], rate=RATE / 1.5 if fast else RATE, body=body, seed=seed)[0]
    (path,) = motion_files(motion)
    clip = read_clip(path)
    if kind.isdigit():
        # the first frame of CMU clips is a T-pose
        clip = replace(clip, rotations=clip.rotations[1:], root_positions=clip.root_positions[1:])
    return retarget(clip.resampled(RATE), body)


def motion_files(motion: str) -> list[Path]:
    """Return the files of `bk_squat_013` or `02_05`; one is expected."""
    actor, _, rest = motion.partition("_")
    if actor.isdigit():
        return list(MOCAP.glob(f"cmu/{motion}.bvh"))
    name, _, number = rest.partition("_")
    return list(MOCAP.glob(f"hdm05/HDM_{actor}_{name}*_{number}_120.amc"))


def database(work: Path, threshold: float = SAMPLING_THRESHOLD, progress: Progress = silent) -> Path:
    """Return the path of the suite's pose database, made if missing."""
    made_from = ["database_builder", "toolkit/mocap", "toolkit/body", "toolkit/landmarks", "toolkit/database"]
    path = work / "databases" / f"poses_{digest_of([database_sources], made_from, threshold)}.npz"
    if not path.exists():
        build_database(database_sources(), path, Sampling(threshold), progress=progress)
    return path


def database_sources() -> list[Path] | None:
    """Return the mocap of the actors in no take; None if there is no mocap."""
    if not has_mocap():
        return None
    cmu = [p for p in sorted(MOCAP.glob("cmu/*.bvh")) if p.stem.split("_")[0] not in ("02", "49")]
    return [*cmu, *sorted(MOCAP.glob("hdm05/HDM_bd_*.amc"))]


def digest_of(sources: Iterable[Callable[..., Any] | ModuleType], folders: Iterable[str], *settings: object) -> str:
    """Return ten digits that depend on the settings and on each source or asset of the result."""
    digest = hashlib.sha256(repr((settings, has_mocap())).encode())
    for source in sources:
        digest.update(inspect.getsource(source).encode())
    files = [
        p for folder in folders for p in sorted((ROOT / folder).rglob("*")) if p.suffix in (".py", ".npz", ".yaml")
    ]
    for path in files:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:10]
