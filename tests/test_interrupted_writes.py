"""A writer that is killed leaves the previous file or none, and the next call succeeds.

Each writer runs in a forked process that is killed at one of three points: inside a write, before the rename that puts
the file in place, and after it.
"""

import gc
import os
import resource
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.file_formats import FORMATS, Format, digest
from tests.run_helpers import write_run
from toolkit.app.config import load_settings, settings_text
from toolkit.app.pipeline.batch import DONE, MANIFEST_FILE, Manifest, ManifestRow
from toolkit.body import skeleton
from toolkit.io.files import save_text
from toolkit.output.export.run import export_run
from toolkit.output.rendering.film import save_png
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings

WRITTEN = (
    "pose database", "motion classes", "keyframe index", "track npz", "run json", "tracker state", "body npz",
    "recording npz", "sensors npz", "sensor calibration json",
)  # fmt: skip
"""Formats that the project writes."""
PICTURE = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)


def _settings(folder: Path) -> Path:
    save_text(folder / "config.yaml", settings_text(HybridSettings()))
    return folder / "config.yaml"


def _picture(folder: Path) -> Path:
    save_png(folder / "sheet.png", PICTURE)
    return folder / "sheet.png"


def _motion(folder: Path) -> Path:
    run = folder.with_name("run")
    if not run.exists():
        write_run(run, np.zeros((3, skeleton.POSE_SIZE)))
    export_run(run, folder / "motion.bvh")
    return folder / "motion.bvh"


WRITERS: dict[str, Format] = {
    **{name: FORMATS[name] for name in WRITTEN},
    "settings": Format(_settings, lambda path: load_settings(HybridSettings, path)),
    "motion": Format(_motion, Path.read_bytes),
    "picture": Format(_picture, Path.read_bytes),
}


def killed(write: Callable[[], object], folder: Path, point: str, size: int) -> bool:
    """Run `write` in a forked process that is killed at the point; return whether it was killed."""
    child = os.fork()
    if child:
        return os.WIFSIGNALED(os.waitpid(child, 0)[1])
    gc.freeze()
    renamed = False

    def hook(event: str, details: tuple[object, ...]) -> None:
        nonlocal renamed
        if not str(details[0] if details else "").startswith(str(folder)):
            return
        if renamed or (event == "os.rename" and point == "before the rename"):
            os.kill(os.getpid(), signal.SIGKILL)
        renamed = event == "os.rename"

    try:
        if point == "in a write":
            signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        else:
            sys.addaudithook(hook)
        write()
        if point == "after the rename":
            os.kill(os.getpid(), signal.SIGKILL)
    finally:
        os._exit(0)


@pytest.mark.parametrize("point", ["in a write", "before the rename", "after the rename"])
@pytest.mark.parametrize("name", WRITERS)
def test_a_killed_writer_leaves_the_previous_file_or_none(name: str, point: str, tmp_path: Path) -> None:
    kind, folder, empty = WRITERS[name], tmp_path / "work", tmp_path / "empty"
    folder.mkdir()
    empty.mkdir()
    path = kind.make(folder)
    expected, size = digest(kind.read(path)), path.stat().st_size // 2
    assert killed(lambda: kind.make(folder), folder, point, size) or point == "in a write"
    assert digest(kind.read(path)) == expected
    assert killed(lambda: kind.make(empty), empty, point, size) or point == "in a write"
    fresh = empty / path.relative_to(folder)
    if fresh.exists():
        assert digest(kind.read(fresh)) == expected
    for partial in empty.rglob("track.partial"):
        partial.unlink()
    shutil.rmtree(folder)
    fresh.unlink(missing_ok=True)
    assert digest(kind.read(kind.make(empty))) == expected


def test_a_killed_batch_keeps_the_rows_that_it_wrote(tmp_path: Path) -> None:
    first, second = (ManifestRow(f"{name}.npz", f"runs/{name}", DONE) for name in "ab")
    manifest = Manifest(tmp_path)
    manifest.append(first)
    before = (tmp_path / MANIFEST_FILE).read_bytes()
    for size in (len(before), len(before) + 1, len(before) + 20):
        killed(lambda: manifest.append(second), tmp_path, "in a write", size)
        assert (tmp_path / MANIFEST_FILE).read_bytes().startswith(before), size
        (tmp_path / MANIFEST_FILE).write_bytes(before)
