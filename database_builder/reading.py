"""Mocap files to canonical poses of one body, in parallel processes."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.database.canonical import canonicalise, mirrored
from toolkit.database.database import as_stored
from toolkit.io.errors import DepthMocapError, PlausibilityWarning
from toolkit.io.files import sha256_of
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget


@dataclass(frozen=True)
class MocapFile:
    """A mocap file: its name in reports and its path."""

    name: str
    path: Path


@dataclass(frozen=True, eq=False)
class CanonicalPoses:
    """Poses of one source as input of the sampling.

    Attributes
    ----------
    name : name of the source
    digest : SHA-256 of its file, or of the poses themselves
    poses : float32 (N, P), canonical, rounded as in the database, so that all results are equal on each processor; with
        mirroring the second half are the mirror images of the first
    joints : float32 (N, 20, 3), metres, the reported joints of these poses
    frames : number of frames of the source (N, or N / 2 with mirroring)
    error : reason why the source cannot be used (no poses); empty = it can
    doubts : texts of the warnings about the source when it was read
    """

    name: str
    digest: str
    poses: np.ndarray
    joints: np.ndarray
    frames: int
    error: str = ""
    doubts: tuple[str, ...] = ()


def find_sources(paths: Iterable[Path]) -> list[MocapFile]:
    """Return the motion files of files and folders, each once, sorted by path, with names relative to the input.

    Raises
    ------
    MocapError
        A path is missing or a folder holds no motion file.
    """
    found: dict[Path, str] = {}
    for root in paths:
        for file in find_clips(root):
            name = file.name if file == root else file.relative_to(root).as_posix()
            found.setdefault(file.resolve(), name)
    return [MocapFile(name, path) for path, name in sorted(found.items())]


def of_clip(clip: PoseClip, body: Body, mirror: bool) -> CanonicalPoses:
    """Return the canonical poses of a clip of our body."""
    result = _canonical(clip.name, "", clip.poses, body, mirror)
    return replace(result, digest=hashlib.sha256(result.poses.tobytes()).hexdigest())


def read_source(source: MocapFile, body: Body, mirror: bool) -> CanonicalPoses:
    """Return the canonical poses of a file.

    All failures of a file are reported in `error`, so that it does not stop the others.
    """
    try:
        digest = _digest(source.path)
        with warnings.catch_warnings(record=True) as doubts:  # the process of the build shows them
            warnings.simplefilter("always", PlausibilityWarning)
            poses = retarget(read_clip(source.path), body).poses
        result = _canonical(source.name, digest, poses, body, mirror)
    except Exception as error:
        reason = f"{error}" if isinstance(error, DepthMocapError) else f"{type(error).__name__}: {error}"
        empty = np.zeros((0, skeleton.POSE_SIZE), np.float32), np.zeros((0, len(skeleton.REPORTED), 3), np.float32)
        return CanonicalPoses(source.name, "", *empty, 0, reason)
    return replace(result, doubts=tuple(str(doubt.message) for doubt in doubts))


def _canonical(name: str, digest: str, world_poses: np.ndarray, body: Body, mirror: bool) -> CanonicalPoses:
    poses = canonicalise(world_poses)[0]
    if mirror:
        poses = np.concatenate([poses, mirrored(poses)])
    stored = as_stored(poses)
    joints = body.joint_positions(stored).astype(np.float32)
    return CanonicalPoses(name, digest, stored, joints, len(world_poses))


def _digest(path: Path) -> str:
    """Return the SHA-256 of a motion file; for AMC including the skeletons beside it."""
    digest = sha256_of(path)
    if path.suffix.lower() != ".amc":
        return digest
    skeletons = sorted(p for p in path.parent.iterdir() if p.suffix.lower() == ".asf")
    return hashlib.sha256("".join([digest, *map(sha256_of, skeletons)]).encode()).hexdigest()
