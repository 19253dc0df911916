"""Point clouds (PCD, PLY) as depth recordings: a file is a frame, a folder a recording.

A cloud that keeps the camera's pixel grid (an organised PCD) gives its depth image back, and its intrinsics by least
squares. One without is seen by a virtual camera at the origin: its points fall into pixels wide enough for the
cloud's density, the nearest one counts. So clouds must be in the frame of the camera that measured them, which is
the origin; everything downstream works on the pixel grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.io.safe_open import open_file
from toolkit.kernels.image import depth as kernels
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import FileFacts, chosen_camera, damaged, natural_key, recording_of_source
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import FrameSource, Recording

SUFFIXES = (".pcd", ".ply")
GRID_RESIDUAL = 0.5  # pixels by which points may miss the pixel they claim to be from
GRID_POINTS = 100  # that a fit of four intrinsics needs at the least
LARGEST_SIDE = 640  # pixels of a virtual camera
SPACING_SAMPLES = 2000
LARGEST_CLOUD = 50_000_000
"""Points of a cloud, ten times as many as a depth camera has pixels: Open3D takes memory for as many as are stated."""
LONGEST_WORD = 255
"""Characters of a word in the text of a PLY file: Open3D's reader writes a longer one past a buffer."""
NEAREST, FARTHEST = (
    1e-4,
    1e5,
)  # file units: what lies nearer or farther than millimetres and metres do is no measurement
FIELD = np.array(
    [0.56, 0.42]
)  # slopes that a virtual camera covers at least, a Kinect's: people move after the first frame


def matches(path: Path) -> bool:
    """Whether `path` is a PCD or PLY file, or a folder that holds some."""
    return bool(_files(path))


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path] if path.suffix.lower() in SUFFIXES else []
    return sorted((p for p in path.iterdir() if p.suffix.lower() in SUFFIXES), key=natural_key)


@dataclass(frozen=True, eq=False)
class RawCloud:
    """A cloud as read: points (N, 3) in the camera frame, file units, invalid ones 0; colours uint8 (N, 3) or None;
    and the size (height, width) of its pixel grid or None."""

    points: np.ndarray
    colors: np.ndarray | None
    grid: tuple[int, int] | None


def load_cloud(path: Path, axes: str) -> RawCloud:
    """Read one PCD or PLY file; `axes` as in `ReaderOptions`.

    Raises
    ------
    RecordingError
        It cannot be read, is empty, or lies behind the camera.
    """
    import open3d as o3d

    header = _header(path)
    if path.suffix.lower() == ".pcd" and not _stated(header):  # Open3D would take any number for that of the points
        raise RecordingError(f"{path} states no points; it is empty, truncated or no PCD")
    if path.suffix.lower() == ".ply" and _longest_word(path) > LONGEST_WORD:
        raise RecordingError(f"{path} holds a word of more than {LONGEST_WORD} characters; it is damaged or no PLY")
    if _stated(header) > LARGEST_CLOUD:
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
    if axes == "graphics":
        points[:, 1:] *= -1.0
    points[(np.abs(points) > FARTHEST).any(axis=1)] = np.nan
    usable = np.isfinite(points).all(axis=1) & (points[:, 2] > NEAREST)
    if not np.isfinite(points).all(axis=1).any():
        raise RecordingError(f"no point of {path} is finite; it holds no measurement")
    if not usable.any() and (np.nan_to_num(points[:, 2]) < 0).any():
        raise RecordingError(f"all points of {path} lie behind the camera; give --axes graphics if y is up there")
    if not usable.any():
        raise RecordingError(f"no point of {path} lies in front of the camera; it holds no measurement")
    points[~usable] = 0.0
    colors = cloud.point.colors.numpy() if "colors" in cloud.point else None
    if colors is not None and colors.dtype != np.uint8:
        colors = np.rint(np.clip(colors, 0, 1) * 255).astype(np.uint8)
    return RawCloud(points, colors, _grid_of(header, len(points)))


def _header(path: Path) -> dict[str, int]:
    """Whole numbers of a PCD or PLY header by name: WIDTH, HEIGHT and POINTS, or VERTEX."""
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
    """Characters of the longest word of a PLY file's text: its header, and without a binary format all of it."""
    with damaged(path), open_file(path) as stream:
        content = stream.read()
    text, _, _ = content.partition(b"end_header")
    return max(map(len, (text if b"format binary_" in text else content).split()), default=0)


def _stated(header: dict[str, int]) -> int:
    """How many points a header states, at the most."""
    grid = header.get("HEIGHT", 0) * header.get("WIDTH", 0)
    return max(grid, header.get("POINTS", 0), header.get("VERTEX", 0))


def _grid_of(header: dict[str, int], count: int) -> tuple[int, int] | None:
    """Height and width that a PCD header states, where they are a grid of `count` points."""
    height, width = header.get("HEIGHT", 0), header.get("WIDTH", 0)
    return (height, width) if height > 1 and width > 1 and height * width == count else None


def _camera_of_grid(points: np.ndarray, grid: tuple[int, int]) -> Camera | None:
    """The camera behind an organised cloud (H * W, 3), by least squares of u and v against x/z and y/z.

    None where the points do not lie on a camera's pixel grid.
    """
    height, width = grid
    v, u = np.nonzero(points[:, 2].reshape(grid))
    if len(v) < GRID_POINTS or np.ptp(u) < 2 or np.ptp(v) < 2:
        return None
    x, y, z = points[v * width + u].T
    numbers = []
    for slope, pixel in ((x / z, u), (y / z, v)):
        if np.ptp(slope) == 0:
            return None
        line = np.polyfit(slope, pixel, 1)
        if np.quantile(np.abs(np.polyval(line, slope) - pixel), 0.99) > GRID_RESIDUAL:
            return None
        numbers.append(line)
    (fx, cx), (fy, cy) = numbers
    return Camera(float(fx), float(fy), float(cx), float(cy), width, height) if fx > 0 and fy > 0 else None


def _virtual_camera(points: np.ndarray) -> Camera:
    """A camera at the origin, looking along z, whose pixels are just wide enough for the density of `points` (N, 3)."""
    from scipy.spatial import cKDTree

    seen = points[points[:, 2] > 0]
    slopes = seen[:, :2] / seen[:, 2:]
    picked = slopes[np.linspace(0, len(slopes) - 1, min(SPACING_SAMPLES, len(slopes))).astype(np.int64)]
    gaps = cKDTree(slopes).query(picked, k=2)[0][:, 1] if len(slopes) > 1 else np.array([0.01])
    usual, wide = np.quantile(gaps, (0.5, 0.9))
    # On a grid all gaps are equal and a little more than one gap will do; at random, twice the mean leaves 2 % holes.
    pitch = 1.2 * wide * (wide / usual if usual > 0 else 1.0)
    low, high = np.minimum(slopes.min(axis=0), -FIELD), np.maximum(slopes.max(axis=0), FIELD)
    pitch = max(float(pitch), float((high - low).max()) / (LARGEST_SIDE - 1))
    width, height = (int(s) for s in np.ceil((high - low) / pitch) + 1)
    cx, cy = (float(c) for c in -low / pitch)
    return Camera(1 / pitch, 1 / pitch, cx, cy, width, height)


class _CloudFrames(FrameSource):
    """Depth images of clouds, one file each, in the files' unit (float64)."""

    def __init__(self, files: list[Path], axes: str, camera: Camera, organised: bool) -> None:
        self._files, self._axes, self._camera, self._organised = files, axes, camera, organised
        self._held: tuple[int, RawCloud] | None = None

    def __len__(self) -> int:
        return len(self._files)

    def depth(self, i: int) -> np.ndarray:
        """Frame `i`, float64 (H, W), file units, 0 = nothing."""
        cloud = self._cloud(i)
        if self._organised:
            return cloud.points[:, 2].reshape(self._camera.shape)
        image = np.zeros(self._camera.shape)
        kernels.z_buffer(cloud.points, self._camera.intrinsics, image)
        return image

    def color(self, i: int) -> np.ndarray | None:
        """Colour of an organised cloud, or None."""
        colors = self._cloud(i).colors
        return None if colors is None or not self._organised else colors.reshape(*self._camera.shape, 3)

    def _cloud(self, i: int) -> RawCloud:
        if self._held is None or self._held[0] != i:
            cloud = load_cloud(self._files[i], self._axes)
            if self._organised and cloud.grid != self._camera.shape:
                raise RecordingError(
                    f"{self._files[i]} has the pixel grid {cloud.grid}, the first cloud has {self._camera.shape}; "
                    "all frames must have one size"
                )
            self._held = (i, cloud)
        return self._held[1]


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a cloud or a folder of clouds, in metres unless `depth_unit` says otherwise."""
    files = _files(path)
    if not files:
        raise RecordingError(f"{path} holds no PCD or PLY file; give a cloud or a folder of clouds")
    first = load_cloud(files[0], options.axes)
    found = None if first.grid is None else _camera_of_grid(first.points, first.grid)
    if found is not None and first.grid is not None:
        camera = found if options.intrinsics is None else chosen_camera(options, first.grid, path)
    elif options.intrinsics is not None:
        if options.size is None:
            raise RecordingError(f"{path} has no pixel grid; give --size WIDTH,HEIGHT together with --intrinsics")
        camera = chosen_camera(options, (options.size[1], options.size[0]), path)
    else:
        camera = _virtual_camera(first.points)
    source = _CloudFrames(files, options.axes, camera, found is not None)
    return recording_of_source(path, source, camera, options, FileFacts(unit="m"))
