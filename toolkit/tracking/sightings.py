"""Sightings of a recording on disk, for following a person again in any order of the frames."""

from __future__ import annotations

import errno
import os
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.io.checkpoint import HINT
from toolkit.io.errors import OutputError, TrackError
from toolkit.io.safe_open import open_file
from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import window_of
from toolkit.sensing.joints2d import Joints2D

ENTRY = np.dtype([("frame", "<i8"), ("person", "<i4"), ("pixels", "<i4"), ("begin", "<i8"), ("end", "<i8")])
"""Index entry of a sighting: number of pixels, and bytes in the file of sightings."""
HEADER = np.dtype([("window", "<i4", 4), ("mask", "<i4"), ("joints", "<i4")])
"""Header of a sighting: rows and columns of its depth, ends excluded; bytes of the mask and number of joints."""
MILLIMETRE = float(np.float32(1e-3))
"""Metres per millimetre as in `kernels.depth.median_to_metres`, so that stored depth is equal to the bit."""
JOINTS_BYTES = len(skeleton.REPORTED) * 3 * 4


class StoredSighting(NamedTuple):
    """A sighting without the empty border of its depth, and its mask in bits."""

    id: int
    window: tuple[slice, slice]
    depth: np.ndarray
    unobserved: np.ndarray | None
    camera: Camera
    joints: Joints2D | None

    @classmethod
    def of(cls, sighting: Sighting) -> StoredSighting:
        """Return a sighting in stored form."""
        window = window_of(sighting.depth)
        bits = None if sighting.unobserved is None else np.packbits(sighting.unobserved)
        return cls(sighting.id, window, sighting.depth[window].copy(), bits, sighting.camera, sighting.joints)

    def sighting(self) -> Sighting:
        """Return the original sighting."""
        shape = self.camera.shape
        depth = np.zeros(shape, dtype=np.float32)
        depth[self.window] = self.depth
        unobserved = None
        if self.unobserved is not None:
            unobserved = np.unpackbits(self.unobserved, count=shape[0] * shape[1]).reshape(shape).astype(np.bool_)
        return Sighting(self.id, depth, unobserved, self.camera, self.joints)

    def packed(self) -> bytes:
        """Return the sighting as bytes; its depth is whole millimetres."""
        millimetres = np.rint(self.depth / MILLIMETRE).astype("<u2")
        mask = b"" if self.unobserved is None else self.unobserved.tobytes()
        joints = b"" if self.joints is None else self.joints.rows.astype("<f4").tobytes()
        rows, columns = self.window
        header = np.zeros((), dtype=HEADER)
        header["window"] = (rows.start, rows.stop, columns.start, columns.stop)
        header["mask"], header["joints"] = len(mask), len(joints)
        fastest = 1  # level of compression: a third of the time of the default, files a tenth larger
        return zlib.compress(b"".join([header.tobytes(), millimetres.tobytes(), mask, joints]), fastest)

    @classmethod
    def unpacked(cls, data: bytes, person: int, camera: Camera) -> StoredSighting:
        """Return a sighting from `packed`; raise ValueError for other bytes."""
        pixels = camera.width * camera.height
        mask_bytes, unpacking = -(-pixels // 8), zlib.decompressobj()
        plain = unpacking.decompress(data, HEADER.itemsize + 2 * pixels + mask_bytes + JOINTS_BYTES)
        header = np.frombuffer(plain, dtype=HEADER, count=1)[0]
        first, last, left, right = (int(edge) for edge in header["window"])
        fits = 0 <= first <= last <= camera.height and 0 <= left <= right <= camera.width
        if not (fits and unpacking.eof and header["mask"] in (0, mask_bytes) and header["joints"] in (0, JOINTS_BYTES)):
            raise ValueError("it is of another camera")
        end_of_mask = len(plain) - int(header["joints"])
        end_of_depth = end_of_mask - int(header["mask"])
        millimetres = np.frombuffer(plain[HEADER.itemsize : end_of_depth], dtype="<u2")
        depth = (millimetres * MILLIMETRE).astype(np.float32)
        mask = np.frombuffer(plain[end_of_depth:end_of_mask], dtype=np.uint8) if header["mask"] else None
        joints = None
        if header["joints"]:
            joints = Joints2D.of_rows(np.frombuffer(plain[end_of_mask:], dtype="<f4").reshape(-1, 3))
        window = slice(first, last), slice(left, right)
        return cls(person, window, depth.reshape(last - first, right - left), mask, camera, joints)


class SightingFile:
    """All sightings of a run in one file, with an index beside it; frames come in order.

    Parameters
    ----------
    folder : folder of the two files, made if it is missing
    camera : camera of every sighting
    frames : number of stored frames to keep; later ones are written again

    Raises
    ------
    OutputError
        The folder cannot be written.
    TrackError
        The files hold no sightings, or fewer than `frames`.
    """

    def __init__(self, folder: Path, camera: Camera, frames: int = 0) -> None:
        self._camera, self._folder = camera, folder
        try:
            if folder.is_symlink():
                raise OSError(errno.ELOOP, "it is a link")
            folder.mkdir(parents=True, exist_ok=True)
            self._index, self._data = (
                open_file(folder / name, "a+b", inside=True) for name in ("sightings.index", "sightings.data")
            )
            self._cut(frames)
        except OSError as error:
            raise _unwritable(folder, error) from error

    def append(self, frame: int, sightings: Iterable[Sighting]) -> None:
        """Append the sightings of the next frame; people without pixels are left out.

        Raises
        ------
        OutputError
            The disk is full, for example.
        """
        for sighting in sightings:
            pixels = np.count_nonzero(sighting.depth)
            if pixels == 0:
                continue
            packed = StoredSighting.of(sighting).packed()
            entry = np.zeros((), dtype=ENTRY)
            entry["frame"], entry["person"] = frame, sighting.id
            entry["pixels"] = pixels
            entry["begin"] = self._data.tell()
            entry["end"] = entry["begin"] + len(packed)
            try:
                self._data.write(packed)
                self._index.write(entry.tobytes())
            except OSError as error:
                raise _unwritable(self._folder, error) from error

    def flush(self) -> None:
        """Write all appended sightings to the disk, for a checkpoint."""
        self._data.flush()
        self._index.flush()

    def close(self) -> None:
        """Close the files."""
        self._data.close()
        self._index.close()

    def of(self, person: int, before: PersonSightings | None = None) -> PersonSightings:
        """Return the stored sightings of one person, and elsewhere of earlier frames (`before`)."""
        self.flush()
        entries = self._entries()
        own = entries[entries["person"] == person]
        return PersonSightings(self._folder / "sightings.data", own, self._camera, before)

    def _entries(self) -> np.ndarray:
        self._index.seek(0)
        data = self._index.read()
        return np.frombuffer(data, dtype=ENTRY, count=len(data) // ENTRY.itemsize)

    def _cut(self, frames: int) -> None:
        entries = self._entries()
        early = entries["frame"] < frames
        entries = entries[: np.count_nonzero(early)]
        places = np.concatenate([[0], entries["end"]])
        ordered = early[: len(entries)].all() and (np.diff(entries["frame"], prepend=0) >= 0).all()
        ordered = ordered and (np.diff(places) >= 0).all()
        if not ordered or (entries["begin"] != places[:-1]).any():
            raise TrackError(f"the sightings in {self._folder} are in no order; remove it and track again")
        kept, end = len(entries), int(places[-1])
        if os.path.getsize(self._folder / "sightings.data") < end:
            raise TrackError(f"{self._folder} lost some of its sightings; remove it and track again")
        for stream, size in ((self._index, kept * ENTRY.itemsize), (self._data, end)):
            stream.truncate(size)
            stream.seek(0, os.SEEK_END)


class PersonSightings:
    """Sightings of one person, read from disk on demand; those of earlier frames may be elsewhere.

    Attributes
    ----------
    frames : int64 (N,), rising: the frames in which the person was seen
    pixels : int64 (N,), measured points in each of them
    """

    def __init__(self, path: Path, entries: np.ndarray, camera: Camera, before: PersonSightings | None = None) -> None:
        self._path, self._camera, self._before = path, camera, before
        self._entries: np.ndarray = entries if before is None else np.concatenate([before._entries, entries])
        self.frames = self._entries["frame"].astype(np.int64)
        self.pixels = self._entries["pixels"].astype(np.int64)
        self._stream = open_file(path, inside=True)

    def __getitem__(self, frame: int) -> Sighting | None:
        """Return the person's sighting in a frame; None without one."""
        row = int(np.searchsorted(self.frames, frame))
        if self._before is not None and row < len(self._before.frames):
            return self._before[frame]
        if row == len(self.frames) or self.frames[row] != frame:
            return None
        entry = self._entries[row]
        self._stream.seek(int(entry["begin"]))
        data = self._stream.read(int(entry["end"]) - int(entry["begin"]))
        try:
            return StoredSighting.unpacked(data, int(entry["person"]), self._camera).sighting()
        except (ValueError, zlib.error) as error:
            raise TrackError(f"frame {frame} in {self._path} is damaged ({error}); {HINT}") from error


def _unwritable(folder: Path, error: OSError) -> OutputError:
    return OutputError(f"cannot write {folder}: {error.strerror or error}; free some space and continue with --resume")
