"""A process that is killed inside a final write: what was there stays, what is there is whole, and writing again works.

Each writer runs in forked processes that are killed before one after another of its steps on the file system, and by
the kernel within its writes, at some sizes of a file.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.fuzz_formats import FORMATS
from tests.fuzzing import Format, meaning
from tests.run_helpers import write_run
from toolkit import skeleton
from toolkit.config import load_settings, settings_text
from toolkit.export.run import export_run
from toolkit.files import save_text
from toolkit.hybrid.tracker import HybridSettings
from toolkit.pipeline.manifest import DONE, MANIFEST_FILE, Manifest, ManifestRow
from toolkit.rendering.encoders import FILM_SUFFIXES
from toolkit.rendering.film import FilmWriter, save_png
from toolkit.report.page import write_report

OURS = (
    "pose database", "motion classes", "keyframe index", "track npz", "run json", "tracker state", "body npz",
    "recording npz", "sensors npz", "sensors csv", "sensor calibration json",
)  # fmt: skip
"""Formats whose files are written by the project itself."""
STEPS = {"open", "os.chmod", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate"}
"""What Python tells its audit hooks before it changes a file."""


def _run_beside(folder: Path) -> Path:
    run = folder.with_name("run")
    return run if run.exists() else write_run(run, np.zeros((3, skeleton.POSE_SIZE)))


def _exported(suffix: str) -> Format:
    def make(folder: Path) -> Path:
        export_run(_run_beside(folder), folder / f"motion{suffix}")
        return folder / f"motion{suffix}"

    return Format(make, Path.read_bytes)


def _settings(folder: Path) -> Path:
    save_text(folder / "config.yaml", settings_text(HybridSettings()))
    return folder / "config.yaml"


def pictures_of(film: Path) -> list[np.ndarray]:
    """Everything that a film shows; its file differs from writing to writing, for containers number themselves."""
    video, pictures = cv2.VideoCapture(str(film)), []
    while True:
        more, picture = video.read()
        if not more:
            return pictures
        pictures.append(picture)


def _film(suffix: str) -> Format:
    def make(folder: Path) -> Path:
        FilmWriter(folder / f"film{suffix}", 10.0).write(iter(PICTURES))
        return folder / f"film{suffix}"

    return Format(make, pictures_of)


def _picture(folder: Path) -> Path:
    save_png(folder / "sheet.png", PICTURES[0])
    return folder / "sheet.png"


def _pictures(folder: Path) -> Path:
    for i, picture in enumerate(PICTURES[:2]):
        save_png(folder / "film" / f"{i}.png", picture)
    return folder / "film" / "1.png"


def _page(folder: Path) -> Path:
    return write_report([_run_beside(folder)], folder / "report.html")


PICTURES = np.random.default_rng(0).integers(0, 256, (12, 48, 64, 3), dtype=np.uint8)
"""Of a film: noise, so that the file is no smaller than what a codec writes at once."""
WRITERS: dict[str, Format] = {
    **{name: FORMATS[name] for name in OURS},
    "settings": Format(_settings, lambda path: load_settings(HybridSettings, path)),
    **{f"export {suffix}": _exported(suffix) for suffix in (".glb", ".bvh", ".c3d", ".trc", ".csv", ".json")},
    **{f"film {suffix}": _film(suffix) for suffix in FILM_SUFFIXES},
    "picture": Format(_picture, Path.read_bytes),
    "folder of pictures": Format(_pictures, Path.read_bytes),
    "page": Format(_page, Path.read_bytes),
}


def killed(write: Callable[[], object], folder: Path, step: int | None, size: int | None) -> bool:
    """Run `write` in a forked process; kill it before the step, or in the write that lets a file exceed the size.

    Returns whether it was killed; a process that went on to its end was not.
    """
    child = os.fork()
    if child == 0:
        count = [0]

        def die_at_step(event: str, details: tuple[object, ...]) -> None:
            if event in STEPS and str(details[0]).startswith(str(folder)):
                if count[0] == step:
                    os.kill(os.getpid(), signal.SIGKILL)
                count[0] += 1

        try:
            sys.addaudithook(die_at_step)
            if size is not None:
                signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
                resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
            write()
        finally:
            os._exit(0)  # whatever it raised: an error is an end too, and its traceback nobody's business
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


def kills(write: Callable[[], object], folder: Path, size: int) -> Iterator[str]:
    """End the writer everywhere, one process after the other, and say where."""
    step = 0
    while killed(write, folder, step, None):
        yield f"step {step}"
        step += 1
    assert step >= 3, "a file is made, put in place, and something is tidied up"
    for largest in (0, size // 2):
        killed(write, folder, None, largest)
        yield f"size {largest}"


@pytest.mark.parametrize("before", ["nothing", "the file"])
@pytest.mark.parametrize("name", WRITERS)
def test_a_killed_writer_leaves_the_old_file_or_none(name: str, before: str, tmp_path: Path) -> None:
    kind, folder = WRITERS[name], tmp_path / "work"
    (tmp_path / "whole").mkdir()
    folder.mkdir()
    whole = kind.make(tmp_path / "whole")
    path, expected = folder / whole.relative_to(tmp_path / "whole"), meaning(kind.read(whole))
    if before == "the file":
        kind.make(folder)
    for how in kills(lambda: kind.make(folder), folder, whole.stat().st_size):
        if before == "the file" or path.exists():
            assert meaning(kind.read(path)) == expected, how
        for left in folder.rglob("track.partial"):  # to go on from, but here is nothing to resume
            left.unlink()
        if before == "nothing":
            path.unlink(missing_ok=True)
    assert meaning(kind.read(kind.make(folder))) == expected, "writing again works"


def test_a_killed_batch_keeps_the_rows_that_it_wrote(tmp_path: Path) -> None:
    first, second = (ManifestRow(f"{name}.npz", f"runs/{name}", DONE) for name in "ab")
    Manifest(tmp_path).append(first)
    size = (tmp_path / MANIFEST_FILE).stat().st_size

    def write() -> None:
        Manifest(tmp_path).append(second)

    for how in (*((step, None) for step in range(4)), *((None, size + more) for more in (0, 1, 20))):
        killed(write, tmp_path, *how)
        rows = list(Manifest(tmp_path).rows.values())
        assert rows in ([first], [first, second]), how
    Manifest(tmp_path).append(second)
    assert list(Manifest(tmp_path).rows.values()) == [first, second]
