"""Pose database: canonical poses, their joints and features, its file and its query (Baak 2013, 5.3.3)."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.database.canonical import feature_vectors, torso_length
from toolkit.database.origin import observed_offsets
from toolkit.database.pose_search import FEATURE_SIZE, SEARCHES, Open3DSearch, ScanSearch
from toolkit.database.prior import PosePrior
from toolkit.io.archives import Column, check_columns, load_archive, save_archive
from toolkit.io.errors import DatabaseError
from toolkit.io.files import is_file
from toolkit.io.typed_values import TypedReader
from toolkit.io.yaml_reader import parse_json

FORMAT_VERSION = 2
"""Version of the file format; increased when the meaning of a stored array changes."""
STORED_TYPE = np.float16
"""Type of poses and offsets in a file; a step is half a millimetre or 0.06 degrees."""


def as_stored(poses: np.ndarray) -> np.ndarray:
    """Return poses (N, P) rounded as by a file: float32 with the precision of `STORED_TYPE`, without negative zeros."""
    return np.asarray(poses).astype(STORED_TYPE).astype(np.float32) + np.float32(0.0)


@dataclass(frozen=True, eq=False)
class PoseOrigins:
    """Sources of the poses of a database; attributes as in `PoseDatabase`."""

    sources: Sequence[str]
    hashes: Sequence[str]
    pose_source: np.ndarray
    pose_frame: np.ndarray
    mirrored: np.ndarray


@dataclass(frozen=True, eq=False)
class PoseDatabase:
    """Poses in the canonical frame (root at the origin, facing +z), with their search index.

    Attributes
    ----------
    poses : float32 (N, P), `skeleton.POSE_NAMES`, metres and radians, of the precision of `STORED_TYPE`
    joints : float32 (N, 20, 3), metres, canonical frame (`P_chi`)
    features : float32 (N, 15), metres: end effectors about each pose's centre, its facing +z (`E_chi^5`)
    offsets : float32 (N, 4): centre (metres) and facing yaw (radians) of each pose as seen by a camera, canonical frame
    pose_source, pose_frame : int32 (N,), number in `sources` and frame there
    mirrored : bool (N,), True for the mirror image of that frame
    sources : names of the files or generators of the poses
    hashes : SHA-256 of each file, of the poses themselves for a generator
    threshold : metres in the unit of Eq. 5.1, smallest distance between two poses (0: limited by a maximum count only)
    body_name, body_shape, body_scale, torso_length : the body of the joints and features; the last in metres
    notes : JSON-compatible record of the build (poses read, files skipped, settings)
    prior : pose prior learnt from these poses; None in older files
    search : name of the nearest-neighbour search among the features, one of `SEARCHES`
    """

    poses: np.ndarray
    joints: np.ndarray
    features: np.ndarray
    offsets: np.ndarray
    pose_source: np.ndarray
    pose_frame: np.ndarray
    mirrored: np.ndarray
    sources: tuple[str, ...]
    hashes: tuple[str, ...]
    threshold: float
    body_name: str
    body_shape: np.ndarray
    body_scale: float
    torso_length: float
    notes: dict[str, Any] = field(default_factory=dict)
    prior: PosePrior | None = None
    search: str = "scan"

    def __post_init__(self) -> None:
        check_columns(vars(self), _columns(len(self.sources)), DatabaseError, "the pose database", BUILT_AGAIN)
        if not len(self.poses):
            raise DatabaseError("the pose database has no poses; build it again from clips with frames")
        if len(self.hashes) != len(self.sources):
            raise DatabaseError(
                f"the pose database has {len(self.sources)} sources and {len(self.hashes)} hashes; {BUILT_AGAIN}"
            )
        TypedReader(DatabaseError, BUILT_AGAIN, loose=True, source="the notes of the pose database").read(
            self.notes, _Notes, ""
        )

    def __len__(self) -> int:
        return len(self.poses)

    @staticmethod
    def of_poses(
        poses: np.ndarray,
        body: Body,
        origins: PoseOrigins,
        *,
        offsets: np.ndarray | None = None,
        threshold: float = 0.0,
        notes: dict[str, Any] | None = None,
        prior: PosePrior | None = None,
    ) -> PoseDatabase:
        """Return the database of canonical poses (N, P) of `body`, with joints and features.

        Parameters are fields of the class. `offsets` (N, 4) are measured on rendered views (`observed_offsets`, about
        half a millisecond per pose) unless given.
        """
        stored = as_stored(poses)
        if offsets is None:
            offsets = observed_offsets(body, stored)
        return PoseDatabase(
            poses=stored,
            joints=np.zeros((len(stored), len(skeleton.REPORTED), 3), dtype=np.float32),
            features=np.zeros((len(stored), FEATURE_SIZE), dtype=np.float32),
            offsets=np.asarray(offsets).astype(STORED_TYPE).astype(np.float32),
            pose_source=np.asarray(origins.pose_source, dtype=np.int32),
            pose_frame=np.asarray(origins.pose_frame, dtype=np.int32),
            mirrored=np.asarray(origins.mirrored, dtype=np.bool_),
            sources=tuple(origins.sources),
            hashes=tuple(origins.hashes),
            threshold=threshold,
            body_name=body.name,
            body_shape=np.array(body.shape),
            body_scale=body.scale,
            torso_length=torso_length(body),
            notes={} if notes is None else notes,
            prior=prior,
        ).for_body(body)

    @cached_property
    def _search(self) -> ScanSearch | Open3DSearch:
        return SEARCHES[self.search](self.features)

    def query(self, features: np.ndarray, k: int, present: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return the `k` poses with the nearest features of each query, nearest first.

        Parameters
        ----------
        features : (M, 15), metres: labelled end effectors of a cloud about its centre and facing
        (`canonical.normalise`)
        k : neighbours of each query, at least 1; at most the number of poses
        present : bool (M, 5) or (5,), known end effectors of a query (`skeleton.END_EFFECTORS`), at least one per
            query; the others are ignored. None = all

        Returns
        -------
        distances : float64 (M, K), metres, Euclidean over the coordinates that are present; five times `delta` of Eq.
        5.5
        indices : int64 (M, K), rows of this database

        Raises
        ------
        DatabaseError
            Shapes do not fit, a known coordinate is not finite, or no end effector is known.
        """
        queries = np.atleast_2d(np.asarray(features, dtype=np.float32))
        if queries.ndim != 2 or queries.shape[1] != FEATURE_SIZE or k < 1:
            raise DatabaseError(
                f"a query has shape {queries.shape} and k = {k}; expected (M, {FEATURE_SIZE}) and k >= 1"
            )
        shape = (len(queries), len(skeleton.END_EFFECTORS))
        known = np.ones(shape, dtype=np.bool_) if present is None else np.asarray(present, dtype=np.bool_)
        if known.shape not in (shape, shape[1:]) or not known.any(axis=-1).all():
            raise DatabaseError(
                f"`present` has shape {known.shape}; expected {shape} with an end effector in every row"
            )
        used = np.repeat(np.broadcast_to(known, shape), 3, axis=1)
        queries = np.where(used, queries, np.float32(0.0))
        if not np.isfinite(queries).all():
            raise DatabaseError("a query holds values that are not finite; leave those end effectors out by `present`")
        return self._search.query(queries, min(k, len(self)), used)

    def for_body(self, body: Body) -> PoseDatabase:
        """Return the same poses with joints and features of another body; offsets scale with its torso length."""
        length = torso_length(body)
        poses = self.poses.astype(np.float64)
        offsets = self.offsets.astype(np.float64)
        offsets[:, :3] *= length / self.torso_length
        joints, end_effectors = body.key_points(poses)
        return replace(
            self,
            joints=joints.astype(np.float32),
            features=feature_vectors(end_effectors, offsets).astype(np.float32),
            offsets=offsets.astype(np.float32),
            body_name=body.name,
            body_shape=np.array(body.shape),
            body_scale=body.scale,
            torso_length=length,
        )

    def limited(self, count: int) -> PoseDatabase:
        """Return the first `count` poses, the sample of that size in farthest-first order."""
        if count < 1:
            raise DatabaseError(f"a pose database cannot be limited to {count} poses; keep at least 1")
        names = ("poses", "joints", "features", "offsets", "pose_source", "pose_frame", "mirrored")
        return replace(self, **{name: getattr(self, name)[:count] for name in names})

    def save(self, path: str | Path) -> None:
        """Write one NPZ file atomically, without joints and features, which follow from poses and body.

        Raises
        ------
        DatabaseError
            Its body is not of the shape space.
        OutputError
            The file cannot be written.
        """
        of_space = self.for_body(ShapeSpace.load().body(self.body_shape, self.body_scale, self.body_name))
        if not np.allclose(of_space.joints, self.joints, atol=1e-3):
            raise DatabaseError(f"a pose database of body {self.body_name} cannot be stored; store one of a named body")
        arrays = {name: getattr(self, name) for name in _STORED}
        arrays |= {name: arrays[name].astype(STORED_TYPE) for name in ("poses", "offsets")}
        arrays["notes"] = json.dumps(self.notes)
        if self.prior is not None:
            arrays |= {_PRIOR + name: array for name, array in self.prior.arrays().items()}
        save_archive(path, {**arrays, **_identity()})

    @staticmethod
    def load(path: str | Path) -> PoseDatabase:
        """Read a database file.

        Raises
        ------
        DatabaseError
            The file is missing, damaged, of another format version or made for another body.
        """
        file = Path(path)
        if not is_file(file):
            raise DatabaseError(f"there is no pose database {file}; build one with `{BUILD}`")
        again = _rebuild(file)
        stored = load_archive(file, DatabaseError, again)
        _check_identity(file, stored)
        missing = [name for name in _STORED if name not in stored]
        if missing:
            raise DatabaseError(f"{file} lacks {', '.join(missing)}; {again}")
        check_columns(stored, _TEXTS, DatabaseError, str(file), again)
        check_columns(stored, _columns(len(stored["sources"])), DatabaseError, str(file), again)
        body = ShapeSpace.load().body(stored["body_shape"], float(stored["body_scale"]), str(stored["body_name"]))
        origins = PoseOrigins(
            stored["sources"].tolist(), stored["hashes"].tolist(), stored["pose_source"], stored["pose_frame"],
            stored["mirrored"],
        )  # fmt: skip
        notes = parse_json(str(stored["notes"]), f"notes of {file}", DatabaseError, again)
        return PoseDatabase.of_poses(
            stored["poses"], body, origins, offsets=stored["offsets"], threshold=float(stored["threshold"]),
            notes=notes, prior=_stored_prior(stored),
        )  # fmt: skip


@dataclass(frozen=True)
class _Notes:
    """Types of the displayed notes."""

    max_poses: int | None = None
    poses_read: int | None = None
    skipped: tuple[Any, ...] = ()


BUILD = "depthmocap database build MOCAP"
BUILT_AGAIN = f"build it again with `{BUILD}`"


def _rebuild(file: Path) -> str:
    """Return the advice for an unusable file, with a shell command."""
    return f"build it again with `{BUILD} --output {shlex.quote(str(file))}`"


def _columns(sources: int) -> dict[str, Column]:
    """Return the requirements on the arrays and numbers of a database."""
    largest_entry = 10.0  # largest absolute entry (metres, radians) of a canonical pose, joint, feature or offset
    return {
        "poses": Column("f", ("poses", skeleton.POSE_SIZE), -largest_entry, largest_entry),
        "joints": Column("f", ("poses", len(skeleton.REPORTED), 3), -largest_entry, largest_entry),
        "features": Column("f", ("poses", FEATURE_SIZE), -largest_entry, largest_entry),
        "offsets": Column("f", ("poses", 4), -largest_entry, largest_entry),
        "pose_source": Column("iu", ("poses",), 0, sources - 1),
        "pose_frame": Column("iu", ("poses",), 0),
        "mirrored": Column("b", ("poses",)),
        "body_shape": Column("f", (ShapeSpace.load().size,), -100, 100),
        "threshold": Column("iuf", (), 0, largest_entry),
        "body_scale": Column("iuf", (), 0.1, 10),
        "torso_length": Column("iuf", (), 0.05, largest_entry),
    }


_TEXTS = {
    "sources": Column("U", ("sources",)), "hashes": Column("U", ("sources",)), "body_name": Column("U", ()),
    "notes": Column("U", ()), "format_version": Column("iu", ()),
}  # fmt: skip
_LEFT_OUT = ("joints", "features", "search", "prior")
_STORED = tuple(item.name for item in fields(PoseDatabase) if item.name not in _LEFT_OUT)
_PRIOR = "prior_"


def _stored_prior(stored: dict[str, np.ndarray]) -> PosePrior | None:
    arrays = {name.removeprefix(_PRIOR): array for name, array in stored.items() if name.startswith(_PRIOR)}
    return PosePrior.of_arrays(arrays) if arrays else None


def _identity() -> dict[str, Any]:
    return {
        "format": "depthmocap pose database",
        "format_version": FORMAT_VERSION,
        "fingerprint": skeleton.fingerprint(),
        "pose_names": np.array(skeleton.POSE_NAMES),
        "joint_names": np.array(skeleton.REPORTED),
        "end_effector_names": np.array(skeleton.END_EFFECTORS),
    }


def _check_identity(file: Path, stored: dict[str, np.ndarray]) -> None:
    expected = _identity()
    if "format" not in stored or str(stored["format"]) != expected["format"]:
        raise DatabaseError(f"{file} is not a pose database; build one with `{BUILD}`")
    version = stored.get("format_version")
    if str(version) != str(FORMAT_VERSION):
        raise DatabaseError(
            f"{file} has format version {version}, this program reads {FORMAT_VERSION}; {_rebuild(file)}"
        )
    if str(stored.get("fingerprint")) != expected["fingerprint"]:
        raise DatabaseError(
            f"{file} was built for another body (fingerprint {stored.get('fingerprint')}, this one has "
            f"{expected['fingerprint']}); {_rebuild(file)}"
        )
