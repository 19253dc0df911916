"""Point clouds (PCD, PLY) as depth recordings: a file is a frame, a folder a recording.

An organised PCD keeps the pixel grid of its camera; its depth image is restored, and its intrinsics are estimated by
least squares. Other clouds are projected into a virtual camera at the origin, with pixels wide enough for the density
of the points; the nearest point of a pixel counts. Clouds must therefore be in the frame of the camera that measured
them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.io.safe_open import open_file
from toolkit.kernels.image import depth as kernels
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import chosen_camera, damaged, natural_key, recording_of_source
from toolkit.sensing.camera import Camera
from toolkit.sensing.kd_tree import KdTree
from toolkit.sensing.recording import FrameSource, Recording

SUFFIXES = (".pcd", ".ply")
GRID_POINTS = 100  # minimum number of points for a fit of four intrinsics


def matches(path: Path) -> bool:
    """Return whether `path` is a PCD or PLY file, or a folder with some."""
    return bool(_files(path))


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path] if path.suffix.lower() in SUFFIXES else []
    return sorted((p for p in path.iterdir() if p.suffix.lower() in SUFFIXES), key=natural_key)


@dataclass(frozen=True, eq=False)
class RawCloud:
    """A cloud: points (N, 3) in the camera frame, file units, invalid ones 0; colours uint8 (N, 3) or None; size
    (height, width) of its pixel grid or None."""

    points: np.ndarray
    colors: np.ndarray | None
    grid: tuple[int, int] | None


def load_cloud(path: Path, axes: str) -> RawCloud:
    """Read one PCD or PLY file; `axes` as in `ReaderOptions`.

    Raises
    ------
    RecordingError
        The file cannot be read, is empty, or lies behind the camera.
    """
    import open3d as o3d

    header = _header(path)
    if path.suffix.lower() == ".pcd" and not _stated(header):  # Open3D accepts any number of points
        raise RecordingError(f"{path} states no points; it is empty, truncated or no PCD")
    # Maximum length of a word in the text of a PLY file, because Open3D's reader overflows its buffer for longer
    # ones.
    longest_word = 255
    if path.suffix.lower() == ".ply" and _longest_word(path) > longest_word:
        raise RecordingError(f"{path} holds a word of more than {longest_word} characters; it is damaged or no PLY")
    # Maximum number of points, ten times the pixels of a depth camera; Open3D allocates the stated number.
    largest_cloud = 50_000_000
    if _stated(header) > largest_cloud:
        raise RecordingError(f"{path} states {_stated(header)} points; it is damaged, or no picture of a camera")
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        try:
            cloud = o3d.t.io.read_point_cloud(path, remove_nan_points=False, remove_infinite_points=False)
            with np.errstate(invalid="ignore"):
                points = cloud.point.positions.numpy().astype(np.float64)
        except (RuntimeError, KeyError, TypeError, ValueError) as error:
            raise RecordingError(f"{path} cannot be read as a point cloud; it is truncated or no PCD or PLY") from error
    if not len(points):
        raise RecordingError(f"{path} holds no point; it is empty, truncated or no PCD or PLY")
    if len(points) >= GRID_POINTS and (points[:, 1:] == np.rint(points[:, 1:])).all() and np.ptp(points[:, 1:]) > 0:
        raise RecordingError(
            f"{path} has whole numbers as y and z: pixel numbers, no places; multiply the rays of its camera by "
            "the distance x and save depth images as .npy"
        )
    colors = cloud.point.colors.numpy() if "colors" in cloud.point else None
    return usable_cloud(points, colors, _grid_of(header, len(points)), axes, str(path))


def usable_cloud(
    points: np.ndarray, colors: np.ndarray | None, grid: tuple[int, int] | None, axes: str, name: str
) -> RawCloud:
    """Return a cloud in the camera frame whose invalid points are 0.

    Parameters
    ----------
    points : float64 (N, 3), file units, N at least 1; changed in place
    colors : uint8, or floating point in [0, 1], (N, 3), or None
    grid : height and width of the pixel grid, or None
    axes : as in `ReaderOptions`
    name : name of the cloud, for errors

    Raises
    ------
    RecordingError
        No point is finite, or none lies in front of the camera.
    """
    if axes == "graphics":
        points[:, 1:] *= -1.0
    nearest, farthest = 0.0001, 100000.0  # range of valid coordinates in millimetres and metres, file units
    points[(np.abs(points) > farthest).any(axis=1)] = np.nan
    finite = np.isfinite(points).all(axis=1)
    usable = finite & (points[:, 2] > nearest)
    if not finite.any():
        raise RecordingError(f"no point of {name} is finite; it holds no measurement")
    if not usable.any() and (np.nan_to_num(points[:, 2]) < 0).any():
        raise RecordingError(f"all points of {name} lie behind the camera; give --axes graphics if y is up there")
    if not usable.any():
        raise RecordingError(f"no point of {name} lies in front of the camera; it holds no measurement")
    points[~usable] = 0.0
    if colors is not None and colors.dtype != np.uint8:
        colors = np.rint(np.clip(np.nan_to_num(colors), 0, 1) * 255).astype(np.uint8)
    return RawCloud(points, colors, grid)


def _header(path: Path) -> dict[str, int]:
    """Return the integers of a PCD or PLY header by name: WIDTH, HEIGHT and POINTS, or VERTEX."""
    numbers = {}
    with damaged(path), open_file(path) as stream:
        for _ in range(32):
            words = stream.readline(200).decode("ascii", errors="replace").split()
            if words[:1] in (["DATA"], ["end_header"]):
                break
            if len(words) in (2, 3) and words[-1].isascii() and words[-1].isdigit():
                numbers[words[-2].upper()] = int(words[-1])
    return numbers


def _longest_word(path: Path) -> int:
    """Return the length of the longest word in a PLY file's text: its header, or the whole file if it is ASCII."""
    with damaged(path), open_file(path) as stream:
        content = stream.read()
    text, _, _ = content.partition(b"end_header")
    return max(map(len, (text if b"format binary_" in text else content).split()), default=0)


def _stated(header: dict[str, int]) -> int:
    """Return the maximum number of points that a header states."""
    grid = header.get("HEIGHT", 0) * header.get("WIDTH", 0)
    return max(grid, header.get("POINTS", 0), header.get("VERTEX", 0))


def _grid_of(header: dict[str, int], count: int) -> tuple[int, int] | None:
    """Return height and width of a PCD header if they form a grid of `count` points, else None."""
    height, width = header.get("HEIGHT", 0), header.get("WIDTH", 0)
    return (height, width) if height > 1 and width > 1 and height * width == count else None


def camera_of_grid(points: np.ndarray, grid: tuple[int, int]) -> Camera | None:
    """Return the camera of an organised cloud (H * W, 3), by least squares of u and v against x/z and y/z.

    None if the points do not lie on the pixel grid of a camera.
    """
    height, width = grid
    v, u = np.nonzero(points[:, 2].reshape(grid))
    if len(v) < GRID_POINTS or np.ptp(u) < 2 or np.ptp(v) < 2:
        return None
    x, y, z = points[v * width + u].T
    numbers = []
    grid_residual = 0.5  # largest distance of projected points from their pixels, pixels
    for slope, pixel in ((x / z, u), (y / z, v)):
        if np.ptp(slope) == 0:
            return None
        line = np.polyfit(slope, pixel, 1)
        if np.quantile(np.abs(np.polyval(line, slope) - pixel), 0.99) > grid_residual:
            return None
        numbers.append(line)
    (fx, cx), (fy, cy) = numbers
    return Camera(float(fx), float(fy), float(cx), float(cy), width, height) if fx > 0 and fy > 0 else None


def _virtual_camera(points: np.ndarray) -> Camera:
    """Return a camera at the origin, along z, with pixels just wide enough for the density of `points` (N, 3)."""
    seen = points[points[:, 2] > 0]
    slopes = seen[:, :2] / seen[:, 2:]
    slopes = slopes[np.lexsort(slopes.T)]  # Open3D returns the points of an image in varying order
    spacing_samples = 2000
    picked = slopes[np.linspace(0, len(slopes) - 1, min(spacing_samples, len(slopes))).astype(np.int64)]
    gaps = np.sqrt(KdTree(slopes).query(picked, 2)[1][:, 1]) if len(slopes) > 1 else np.array([0.01])
    usual, wide = np.quantile(gaps, (0.5, 0.9))
    # On a grid all gaps are equal, and pixels slightly wider than one gap suffice; at random, twice the mean leaves 2 %
    # holes.
    pitch = 1.2 * wide * (wide / usual if usual > 0 else 1.0)
    field = np.array([0.56, 0.42])  # least slopes of the border, those of a Kinect: people move after the first frame
    low, high = np.minimum(slopes.min(axis=0), -field), np.maximum(slopes.max(axis=0), field)
    largest_side = 640  # pixels of a virtual camera
    pitch = max(float(pitch), float((high - low).max()) / (largest_side - 1))
    width, height = (int(s) for s in np.ceil((high - low) / pitch) + 1)
    cx, cy = (float(c) for c in -low / pitch)
    return Camera(1 / pitch, 1 / pitch, cx, cy, width, height)


def cloud_frames(
    names: Sequence[str],
    load: Callable[[int], RawCloud | None],
    first: RawCloud,
    options: ReaderOptions,
    path: Path,
) -> tuple[FrameSource, Camera]:
    """Return depth images of clouds in the clouds' unit (float64), and the camera that sees the points.

    The camera is that of the options, of the pixel grid of the first cloud by least squares, or a virtual one. Clouds
    with a pixel grid and colour have colour images, black without points.

    Parameters
    ----------
    names : names of the clouds, for errors
    load : returns the cloud of a frame; None for a cloud without points, whose frame holds no measurement
    first : the first cloud that has points
    options : `intrinsics` and `size` of the camera
    path : path of the recording, for errors

    Raises
    ------
    RecordingError
        The options hold intrinsics without a size, and the cloud has no pixel grid.
    """
    found = None if first.grid is None else camera_of_grid(first.points, first.grid)
    if found is not None:
        camera = found if options.intrinsics is None else chosen_camera(options, found.shape, path)
    elif options.intrinsics is None:
        camera = _virtual_camera(first.points)
    elif options.size is None:
        raise RecordingError(f"{path} has no pixel grid; give --size WIDTH,HEIGHT together with --intrinsics")
    else:
        camera = chosen_camera(options, (options.size[1], options.size[0]), path)
    organised = found is not None

    @lru_cache(maxsize=1)
    def cloud_of(i: int) -> RawCloud | None:
        cloud = load(i)
        if organised and cloud is not None and cloud.grid != camera.shape:
            raise RecordingError(
                f"{names[i]} has the pixel grid {cloud.grid}, the first cloud has {camera.shape}; all frames must have "
                "one size"
            )
        return cloud

    def depth(i: int) -> np.ndarray:
        cloud, image = cloud_of(i), np.zeros(camera.shape)
        if cloud is None:
            return image
        if organised:
            return cloud.points[:, 2].reshape(camera.shape)
        kernels.z_buffer(cloud.points, camera.intrinsics, image)
        return image

    def color(i: int) -> np.ndarray | None:
        if not organised or first.colors is None:
            return None
        cloud = cloud_of(i)
        if cloud is None or cloud.colors is None:
            return np.zeros((*camera.shape, 3), dtype=np.uint8)
        return cloud.colors.reshape(*camera.shape, 3)

    return FrameSource(len(names), depth, color), camera


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a cloud or a folder of clouds, in metres unless `depth_unit` is given."""
    files = _files(path)
    if not files:
        raise RecordingError(f"{path} holds no PCD or PLY file; give a cloud or a folder of clouds")
    first = load_cloud(files[0], options.axes)
    names = [str(file) for file in files]
    source, camera = cloud_frames(names, lambda i: load_cloud(files[i], options.axes), first, options, path)
    return recording_of_source(path, source, camera, options, unit="m")
