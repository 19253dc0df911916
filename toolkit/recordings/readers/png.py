"""A folder of 16-bit PNG depth images, with intrinsics in a JSON file and optionally a folder of colour images."""

from __future__ import annotations

from pathlib import Path

from toolkit.io.errors import RecordingError
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import (
    camera_beside,
    chosen_camera,
    file_frames,
    natural_key,
    read_depth_png,
    recording_of_source,
)
from toolkit.sensing.recording import Recording

COLOR_SUFFIXES = (".png", ".jpg", ".jpeg")
COLOR_NAMES = ("color", "rgb")


def matches(path: Path) -> bool:
    """Return whether `path` is a PNG file, or a folder with PNG files in itself or in `depth` below it."""
    if path.is_file():
        return path.suffix == ".png"
    return bool(depth_files(path))


def depth_files(path: Path) -> list[Path]:
    """Return the depth images in natural order: the file itself, or the images of the folder in `depth`, with depth in
    their names, or all."""
    if path.is_file():
        return [path]
    folder = path / "depth" if (path / "depth").is_dir() else path
    files = sorted(folder.glob("*.png"), key=natural_key)
    return [p for p in files if "depth" in p.stem.lower()] or files


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a folder of depth images, or one image.

    Images lie in the folder or in `depth/` below it, colour in `color/` or `rgb/` beside that, and intrinsics in a
    `*.json` of the folder, or else of the one above. Where some names hold the word depth (`depth0.png` beside
    `color0.png`), these are the depth images, and colour has the same names with `color` or `rgb` in its place.
    """
    files = depth_files(path)
    if not files:
        raise RecordingError(f"{path} holds no PNG file; give the folder of the depth images")
    folder = files[0].parent
    source = file_frames(files, read_depth_png, color_files(folder, files))
    shape: tuple[int, int] = source.depth(0).shape
    own = [folder, path] if folder.parent == path else [folder]
    camera = None if options.intrinsics is not None else camera_beside(own, own[-1].parent, shape)
    camera = camera or chosen_camera(options, shape, path)
    return recording_of_source(path, source, camera, options)


def color_files(folder: Path, depth: list[Path]) -> list[Path]:
    """Return the colour images with the stems of the depth images, else equally many in sorted order, else none."""
    for name in COLOR_NAMES:
        named = [p.with_name(p.name.replace("depth", name)) for p in depth]
        if all("depth" in p.name and (folder / q.name).is_file() for p, q in zip(depth, named, strict=True)):
            return named
        beside = folder.parent / name
        if folder.name != "depth" or not beside.is_dir():
            continue
        found = sorted((p for p in beside.iterdir() if p.suffix.lower() in COLOR_SUFFIXES), key=natural_key)
        by_stem = {p.stem: p for p in found}
        if all(p.stem in by_stem for p in depth):
            return [by_stem[p.stem] for p in depth]
        if len(found) == len(depth):
            return found
    return []
