"""Recordings of Open3D's own types in memory: point clouds, and images with depth and colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import RecordingError, UsageError
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import chosen_camera, recording_of_source
from toolkit.recordings.readers.cloud import GRID_POINTS, RawCloud, camera_of_grid, cloud_frames, usable_cloud
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import FrameSource, Recording, memory_path


def is_open3d(frames: Any) -> bool:
    """Return True for an object of Open3D, or a list or tuple that begins with one; Open3D is not imported."""
    first = frames[0] if isinstance(frames, (list, tuple)) and frames else frames
    return type(first).__module__.split(".")[0] == "open3d"


def recording_of_open3d(
    frames: Any,
    *,
    timestamps: np.ndarray | None = None,
    background: np.ndarray | None = None,
    name: str = "open3d",
    **options: Any,
) -> Recording:
    """Return a recording of clouds or RGB-D images, one for each frame.

    Parameters
    ----------
    frames : an `open3d.geometry` or `open3d.t.geometry` PointCloud or RGBDImage, or a list of one kind. Clouds are in
        the frame of the camera that measured them, metres unless `depth_unit` is given; NaN and infinite points
        are no measurement, normals are not used, and a cloud without points is a frame without a measurement
    timestamps : (T,), seconds; without them `frame_rate` counts, or 30 frames a second
    background : (H, W), depth of the empty scene, of images alone
    name : name of the recording
    options : of `ReaderOptions`; `intrinsics` may be an `open3d.camera.PinholeCameraIntrinsic`. Images need it. A
        cloud whose points are the pixels of an image, row by row, is recognised and gives its intrinsics itself; any
        other is projected into the camera of `intrinsics` and `size`, or without them into a virtual camera

    Raises
    ------
    RecordingError
        No frame holds a measurement, the frames differ in kind or size, or the intrinsics are missing.
    UsageError
        An option is unknown or wrong, or a frame is of no supported type.
    """
    several = list(frames) if isinstance(frames, (list, tuple)) else [frames]
    kinds = sorted({type(frame).__name__ for frame in several})
    if len(kinds) != 1 or kinds[0] not in ("PointCloud", "RGBDImage"):
        raise UsageError(f"frames are of type {', '.join(kinds)}; give PointCloud or RGBDImage of Open3D, all of one")
    chosen, path = _options(options), memory_path(name)
    times = None if timestamps is None else np.asarray(timestamps, dtype=np.float64)
    if kinds == ["RGBDImage"]:
        source, shape = _image_frames(several)
        camera = chosen_camera(chosen, shape, path)
    else:
        source, camera = _clouds(several, chosen, path)
    return recording_of_source(
        path, source, camera, chosen, name=name, unit="m", timestamps=times, background=background
    )


def _options(options: dict[str, Any]) -> ReaderOptions:
    """Return the reader options, with the numbers of an intrinsic object of Open3D in its place."""
    camera: Any = options.get("intrinsics")
    if not hasattr(camera, "get_focal_length"):
        return ReaderOptions.from_mapping(options)
    numbers = (*camera.get_focal_length(), *camera.get_principal_point())
    sized = {"size": (camera.width, camera.height)} if camera.width > 0 and camera.height > 0 else {}
    return ReaderOptions.from_mapping({**sized, **options, "intrinsics": numbers})


def _clouds(clouds: Sequence[Any], options: ReaderOptions, path: Path) -> tuple[FrameSource, Camera]:
    """Return frames of clouds and their camera; the first one that has points decides on the camera."""

    grid: tuple[int, int] | None = None

    def loaded(i: int) -> RawCloud | None:
        points, colors = _arrays(clouds[i])
        if not len(points):
            return None
        fits = grid is not None and len(points) == grid[0] * grid[1]
        return usable_cloud(points, colors, grid if fits else None, options.axes, f"cloud {i}")

    first = next((cloud for i in range(len(clouds)) if (cloud := loaded(i)) is not None), None)
    if first is None:
        raise RecordingError(f"none of the {len(clouds)} clouds holds a point; give at least one measurement")
    grid = _grid_of(first.points, options.size)
    names = [f"cloud {i}" for i in range(len(clouds))]
    return cloud_frames(names, loaded, replace(first, grid=grid), options, path)


def _grid_of(points: np.ndarray, size: tuple[int, int] | None) -> tuple[int, int] | None:
    """Return height and width of the image whose pixels the points (N, 3) are, row by row; None if they are none.

    `size` (width, height) is tried alone if it is given, else every image of N pixels with sides up to 2.5 : 1.
    """
    count = len(points)
    if count < GRID_POINTS:
        return None
    if size is not None:
        sizes = [(size[1], size[0])] if size[0] * size[1] == count else []
    else:
        widest = 2.5  # ratio of the sides of an image of N pixels (16:9 is 1.8)
        heights = np.arange(int(np.sqrt(count / widest)), int(np.sqrt(count * widest)) + 1)
        sizes = [(int(h), count // int(h)) for h in heights if h > 1 and count % h == 0 and count // h > 1]
    return next((grid for grid in sizes if camera_of_grid(points, grid) is not None), None)


def _arrays(cloud: Any) -> tuple[np.ndarray, np.ndarray | None]:
    """Return points float64 (N, 3), a copy, and colours (N, 3) or None of a cloud of either kind."""
    if hasattr(cloud, "point"):
        points = cloud.point.positions.cpu().numpy() if "positions" in cloud.point else np.zeros((0, 3))
        colors = cloud.point.colors.cpu().numpy() if "colors" in cloud.point else None
    else:
        points, colors = np.asarray(cloud.points), np.asarray(cloud.colors) if cloud.has_colors() else None
    return np.array(points, dtype=np.float64), colors


def _image_frames(images: Sequence[Any]) -> tuple[FrameSource, tuple[int, ...]]:
    """Return the frames of RGB-D images and their shape; whole numbers are millimetres, others metres.

    Colour is None for an image without one, a grey one or one of another size.
    """
    shape = _pixels(images[0].depth).shape
    if len(shape) != 2 or 0 in shape:
        raise RecordingError(f"the depth of image 0 has shape {shape}; give images (height, width)")

    def depth(i: int) -> np.ndarray:
        pixels = _pixels(images[i].depth)
        return pixels if pixels.dtype.kind == "f" else pixels.astype(np.float32) / np.float32(1000.0)

    def color(i: int) -> np.ndarray | None:
        pixels = _pixels(images[i].color)
        if pixels.shape != (*shape, 3):
            return None
        return pixels if pixels.dtype == np.uint8 else np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)

    return FrameSource(len(images), depth, color), shape


def _pixels(image: Any) -> np.ndarray:
    """Return an image of either kind as an array (H, W) or (H, W, C)."""
    array = image.cpu().numpy() if hasattr(image, "cpu") else np.asarray(image)
    return array[..., 0] if array.ndim == 3 and array.shape[2] == 1 else array
