"""Writer of recordings as NPZ, frame by frame."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from toolkit.io.errors import OutputError, RecordingError
from toolkit.io.files import atomic_path
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import check_rows
from toolkit.sensing.recording import check_joints, check_timestamps


class RecordingWriter:
    """Writer that collects frames on disk and puts the NPZ file in place on success.

    Use as a context manager:

    >>> with RecordingWriter("take.npz", camera, up_camera=(0, -1, 0)) as writer:  # doctest: +SKIP
    ...     for depth, time in frames:
    ...         writer.append(depth, time)

    Frames are buffered in an unnamed temporary file of the target's folder, so that memory does not grow and a killed
    run leaves no file.

    Parameters
    ----------
    path : the file to write
    camera : camera of every frame
    background : uint16 (H, W), depth of the empty scene, millimetres
    up_camera : (3,), the vertical in the camera frame
    """

    def __init__(
        self,
        path: str | Path,
        camera: Camera,
        *,
        background: np.ndarray | None = None,
        up_camera: Iterable[float] | None = None,
    ) -> None:
        self._path, self._camera = Path(path), camera
        self._fixed: dict[str, np.ndarray] = {"intrinsics": camera.intrinsics}
        if camera.distortion is not None:
            self._fixed["distortion"] = np.asarray(camera.distortion, dtype=np.float64)
        if background is not None:
            self._fixed["background"] = self._checked(np.asarray(background), camera.shape, np.dtype(np.uint16))
        if up_camera is not None:
            self._fixed["up_camera"] = np.asarray(list(up_camera), dtype=np.float64)
        self._rows: dict[str, list[Any]] = {"timestamps": [], "joints": [], "reference_joints": [], "joints_2d": []}
        self._images: dict[str, IO[bytes]] = {}
        self._count = 0

    @property
    def frames(self) -> int:
        """Number of frames that were given."""
        return self._count

    def append(
        self,
        depth: np.ndarray,
        timestamp: float,
        *,
        color: np.ndarray | None = None,
        joints: np.ndarray | None = None,
    ) -> None:
        """Append one frame.

        Parameters
        ----------
        depth : uint16 (H, W), millimetres along z, 0 = no measurement
        timestamp : seconds
        color : uint8 (H, W, 3), RGB registered to depth; for all frames or for none
        joints : (20, 3), or (N, 20, 3) of N people, metres, camera frame, NaN = unknown; for all frames or for none

        Raises
        ------
        RecordingError
            An image has another size or type.
        OutputError
            The disk is full or the folder cannot be written.
        """
        shape = self._camera.shape
        self._write_image("depth", self._checked(np.asarray(depth), shape, np.dtype(np.uint16)))
        if color is not None:
            self._write_image("color", self._checked(np.asarray(color), (*shape, 3), np.dtype(np.uint8)))
        self._rows["timestamps"].append(timestamp)
        if joints is not None:
            self._rows["joints"].append(np.asarray(joints, dtype=np.float32))
        self._count += 1

    def set_joints(
        self,
        joints: np.ndarray | None,
        reference_joints: np.ndarray | None,
        joints_2d: np.ndarray | None,
    ) -> None:
        """Set the joints of all frames, (T, 20, 3) or (N, T, 20, 3) each or None, instead of frame by frame.

        `joints_2d` holds u, v in pixels of the depth image and confidence (see `Joints2D`).
        """
        for key, value in (("joints", joints), ("reference_joints", reference_joints), ("joints_2d", joints_2d)):
            if value is not None:
                array = np.asarray(value, dtype=np.float32)
                self._rows[key] = list(array.swapaxes(0, 1) if array.ndim == 4 else array)

    def close(self) -> None:
        """Write the file.

        Raises
        ------
        RecordingError
            No frame was appended, or colour or joints are missing in some frames.
        OutputError
            The file cannot be written.
        """
        compression = 3  # zlib level of 9: a tenth of the size, a third of the default level's time
        try:
            arrays = self._arrays()
            with atomic_path(self._path) as temporary:
                with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=compression) as archive:
                    for key, array in arrays.items():
                        with archive.open(f"{key}.npy", "w") as member:
                            npy.write_array(member, array, allow_pickle=False)
                    for key, stream in self._images.items():
                        self._copy_images(archive, key, stream)
        finally:
            self.discard()

    def discard(self) -> None:
        """Discard all frames without writing a file."""
        for stream in self._images.values():
            stream.close()
        self._images = {}

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()

    def _arrays(self) -> dict[str, np.ndarray]:
        if self._count == 0:
            raise RecordingError(f"no frame was given for {self._path}; a recording has at least one")
        arrays = dict(self._fixed)
        arrays["timestamps"] = check_timestamps(np.array(self._rows["timestamps"]), self._count, self._path)
        for key in ("joints", "reference_joints"):
            joints = check_joints(self._stacked(key), self._count, key, self._path)
            if joints is not None:
                arrays[key] = joints
        found = check_rows(self._stacked("joints_2d"), self._count, self._path)
        if found is not None:
            arrays["joints_2d"] = found[0] if len(found) == 1 else found
        return arrays

    def _stacked(self, key: str) -> np.ndarray | None:
        """Return the rows of all frames, people first, or None."""
        rows = np.array(self._rows[key]) if self._rows[key] else None
        return rows.swapaxes(0, 1) if rows is not None and rows.ndim == 4 else rows

    def _write_image(self, key: str, image: np.ndarray) -> None:
        try:
            if key not in self._images:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._images[key] = tempfile.TemporaryFile(dir=self._path.parent)
            self._images[key].write(np.ascontiguousarray(image).data)
        except OSError as error:
            self.discard()
            raise OutputError(
                f"cannot write {self._path}: {error.strerror or error}; free some space or choose another folder"
            ) from error

    def _copy_images(self, archive: zipfile.ZipFile, key: str, stream: IO[bytes]) -> None:
        tail, dtype = ((), np.uint16) if key == "depth" else ((3,), np.uint8)
        shape = (self._count, *self._camera.shape, *tail)
        if stream.tell() != int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize:
            raise RecordingError(f"{key} was given for some frames of {self._path} only; give it for all or for none")
        stream.seek(0)
        block_bytes = 1 << 20
        with archive.open(f"{key}.npy", "w", force_zip64=True) as member:
            header = {"descr": npy.dtype_to_descr(np.dtype(dtype)), "fortran_order": False, "shape": shape}
            npy.write_array_header_1_0(member, header)
            while block := stream.read(block_bytes):
                member.write(block)

    def _checked(self, image: np.ndarray, shape: tuple[int, ...], dtype: np.dtype) -> np.ndarray:
        if image.shape != shape or image.dtype != dtype:
            raise RecordingError(f"an image for {self._path} is {image.dtype} {image.shape}; expected {dtype} {shape}")
        return image


def save_recording(
    path: str | Path,
    *,
    depth: Iterable[np.ndarray],
    camera: Camera,
    timestamps: Iterable[float],
    background: np.ndarray | None = None,
    color: Iterable[np.ndarray] | None = None,
    up_camera: Iterable[float] | None = None,
    joints: np.ndarray | None = None,
    reference_joints: np.ndarray | None = None,
    joints_2d: np.ndarray | None = None,
) -> None:
    """Write a recording from arrays or iterators of frames; one frame is held in memory.

    Parameters
    ----------
    depth : uint16 (T, H, W) or an iterable of (H, W), millimetres along z, 0 = no measurement
    timestamps : (T,), seconds
    background, color, up_camera, joints, reference_joints, joints_2d : see `RecordingWriter`; the joints float32
        (T, 20, 3) or (N, T, 20, 3)

    Raises
    ------
    RecordingError
        Shapes or types do not match.
    OutputError
        The file cannot be written.
    """
    times = iter(timestamps)
    colors = None if color is None else iter(color)
    with RecordingWriter(path, camera, background=background, up_camera=up_camera) as writer:
        for image in depth:
            time = next(times, None)
            if time is None:
                raise RecordingError(f"there are fewer timestamps than frames for {path}; give one per frame")
            writer.append(image, float(time), color=None if colors is None else next(colors, None))
        writer.set_joints(joints, reference_joints, joints_2d)
