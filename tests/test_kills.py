"""A process that is killed inside a final write: what was there stays, what is there is whole, and writing again works.

Each writer runs in a forked process that copies what stands on the disk before each of its steps on the file system,
and in others that are killed: in the middle of these steps, and by the kernel within their writes.
"""

from __future__ import annotations

import gc
import os
import resource
import shutil
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
from toolkit.app.config import load_settings, settings_text
from toolkit.app.pipeline.manifest import DONE, MANIFEST_FILE, Manifest, ManifestRow
from toolkit.body import skeleton
from toolkit.io.files import save_text
from toolkit.output.export.run import export_run
from toolkit.output.rendering.encoders import FILM_SUFFIXES
from toolkit.output.rendering.film import FilmWriter, save_png
from toolkit.output.report.page import write_report
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings

OURS = (
    "pose database", "motion classes", "keyframe index", "track npz", "run json", "tracker state", "body npz",
    "recording npz", "sensors npz", "sensors csv", "sensor calibration json",
)  # fmt: skip
"""Formats whose files are written by the project itself."""
STEPS = {"open", "os.chmod", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate"}
"""What Python tells its audit hooks before it changes a file."""
LONGEST = 120
"""Seconds that a writer may take."""


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

    def die(number: int) -> None:
        if number == step:
            os.kill(os.getpid(), signal.SIGKILL)

    def limited() -> None:
        if size is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        write()

    return os.WIFSIGNALED(beside(limited, folder, die))


def beside(write: Callable[[], object], folder: Path, before: Callable[[int], None]) -> int:
    """Run `write` in a forked process that is told the number of each step before it changes a file in the folder.

    Returns how the process ended, as `os.waitpid` says.
    """
    child = os.fork()
    if child == 0:
        gc.freeze()  # a film among the parent's garbage would wait for its threads, which no fork has
        signal.alarm(LONGEST)
        count, busy = [0], [False]

        def hook(event: str, details: tuple[object, ...]) -> None:
            if event in STEPS and not busy[0] and str(details[0]).startswith(str(folder)):
                busy[0] = True
                before(count[0])
                busy[0] = False
                count[0] += 1

        try:
            sys.addaudithook(hook)
            write()
        finally:
            os._exit(0)  # whatever it raised: an error is an end too, and its traceback nobody's business
    status = os.waitpid(child, 0)[1]
    assert not (os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM), "it never ended"
    return status


def left_behind(write: Callable[[], object], folder: Path, size: int) -> Iterator[tuple[str, Path]]:
    """What a folder holds after the writer ended anywhere, and where that was.

    A process that is killed before a step leaves what stands on the disk at that moment: one process copies that before
    each of its steps. Then processes are killed indeed: in the middle, and by the kernel within their writes.
    """
    copies = folder.with_name("copies")
    copies.mkdir()
    beside(write, folder, lambda number: shutil.copytree(folder, copies / str(number)))
    steps = len(list(copies.iterdir()))
    assert steps >= 3, "a file is made, put in place, and something is tidied up"
    for step in range(steps):
        yield f"step {step}", copies / str(step)
    first = copies / "0"
    for step, largest in ((steps // 2, None), (None, 0), (None, size // 2)):
        shutil.rmtree(folder)
        shutil.copytree(first, folder)
        assert killed(write, folder, step, largest) or largest is not None
        yield f"step {step}" if largest is None else f"size {largest}", folder


@pytest.mark.parametrize("before", ["nothing", "the file"])
@pytest.mark.parametrize("name", WRITERS)
def test_a_killed_writer_leaves_the_old_file_or_none(name: str, before: str, tmp_path: Path) -> None:
    kind, folder = WRITERS[name], tmp_path / "work"
    (tmp_path / "whole").mkdir()
    folder.mkdir()
    whole = kind.make(tmp_path / "whole")
    place, expected = whole.relative_to(tmp_path / "whole"), meaning(kind.read(whole))
    if before == "the file":
        kind.make(folder)
    for how, left in left_behind(lambda: kind.make(folder), folder, whole.stat().st_size):
        path = left / place
        if before == "the file" or path.exists():
            assert meaning(kind.read(path)) == expected, how
        for partial in left.rglob("track.partial"):  # to go on from, but here is nothing to resume
            partial.unlink()
        shutil.copytree(left, tmp_path / "all", dirs_exist_ok=True)
    if before == "nothing":
        (tmp_path / "all" / place).unlink(missing_ok=True)
    assert meaning(kind.read(kind.make(tmp_path / "all"))) == expected, "writing again works, whatever is left"


def test_a_killed_batch_keeps_the_rows_that_it_wrote(tmp_path: Path) -> None:
    first, second = (ManifestRow(f"{name}.npz", f"runs/{name}", DONE) for name in "ab")
    manifest = Manifest(tmp_path)
    manifest.append(first)
    before = (tmp_path / MANIFEST_FILE).read_bytes()
    for how in (*((step, None) for step in range(4)), *((None, len(before) + more) for more in (0, 1, 20))):
        killed(lambda: manifest.append(second), tmp_path, *how)
        assert (tmp_path / MANIFEST_FILE).read_bytes().startswith(before), how
        (tmp_path / MANIFEST_FILE).write_bytes(before)
